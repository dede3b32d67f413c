//! Losses of a device's storage, for `tactus list` and `tactus status`: in words and as data.

use lab::client::Client;
use lab::device::Device;
use lab::error::HostError;
use link::{LostImage, Name, Refusal};
use schemars::JsonSchema;
use serde::Serialize;

/// The storage of a device.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Storage {
    /// False: it does not work at all, nothing is kept over a restart.
    pub works: bool,
    /// It was blank or foreign at the start, or nothing in it could be read; it was erased.
    pub formatted: bool,
    /// The sector that cannot be erased or written; nothing more is kept then.
    pub bad_sector: Option<u8>,
    /// Images that cannot be read.
    pub lost: Vec<Lost>,
    /// Settings of which the newest value cannot be read: home, weight, secret.
    pub settings_lost: Vec<&'static str>,
    /// Damaged values that do not tell whose they are; they may be old ones that nobody misses.
    pub unread: u8,
}

/// An image that the device once kept and cannot read.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Lost {
    /// Number of its place.
    pub place: u8,
    /// Its name, if that can still be read.
    pub name: Option<String>,
    /// An image of before is at the place.
    pub older: bool,
}

/// Asks the device; `None`: it is still reading its storage.
///
/// # Errors
/// The device does not answer.
pub(super) fn ask(client: &mut Client<Device>) -> Result<Option<Storage>, HostError> {
    let (report, lost) = match client.storage() {
        Ok(told) => told,
        Err(HostError::Refused { reason: Refusal::StoreFailed, .. }) => return Ok(None),
        Err(error) => return Err(error),
    };
    let settings = ["home", "weight", "secret"];
    let is_lost = |place: &usize| report.settings_lost & (1 << place) != 0;
    Ok(Some(Storage {
        works: !report.failed,
        formatted: report.formatted,
        bad_sector: report.bad_sector,
        lost: lost
            .into_iter()
            .map(|lost| Lost {
                place: lost.place,
                name: lost.name.map(|name| name.as_str().to_owned()),
                older: lost.older,
            })
            .collect(),
        settings_lost: (0..settings.len()).filter(is_lost).map(|place| settings[place]).collect(),
        unread: report.unread,
    }))
}

/// The loss by which a primitive is not what was stored last under its name, or is not there any more. A lost image
/// whose name cannot be read may be it.
///
/// # Errors
/// The device does not answer, or still reads its storage.
pub(super) fn loss_of(client: &mut Client<Device>, name: &Name) -> Result<Option<LostImage>, HostError> {
    let (_, lost) = client.storage()?;
    if lost.is_empty() {
        return Ok(None);
    }
    let place = client.find(name)?.map(|listing| listing.index);
    Ok(lost.into_iter().find(|loss| match place {
        Some(place) => loss.place == place,
        None => loss.name.as_ref().is_none_or(|lost| lost == name),
    }))
}

/// The loss in words.
pub(super) fn missed(loss: &LostImage) -> String {
    let place = loss.place;
    let what = loss.name.as_ref().map_or("an image whose name cannot be read".to_owned(), |name| format!("'{name}'"));
    format!("what was stored last at place {place} of its storage is lost ({what})")
}

/// Complaints about it, one line each, with what helps; empty where all is well.
pub(super) fn complaints(storage: &Storage) -> Vec<String> {
    let mut lines = Vec::new();
    if let Some(sector) = storage.bad_sector {
        lines.push(format!(
            "sector {sector} cannot be erased or written, so nothing more is kept: save what there is with `tactus get \
             NAME` and `tactus config dump`, then restart the device once"
        ));
    }
    if !storage.works {
        lines.push("the storage does not work: nothing is kept over a restart".to_owned());
    }
    for Lost { place, name, older } in &storage.lost {
        let what = name.as_ref().map_or("an image whose name cannot be read".to_owned(), |name| format!("'{name}'"));
        lines.push(if *older {
            format!(
                "what was changed last at place {place} is lost ({what}), an image of before is there: `tactus upload` \
                 replaces it"
            )
        } else {
            format!("{what} of place {place} is lost: `tactus upload` brings it back")
        });
    }
    if !storage.settings_lost.is_empty() {
        let settings = storage.settings_lost.join(", ");
        lines.push(format!(
            "lost, or as they were before the last change: {settings}: `tactus config restore FILE` and `tactus secret \
             set FILE` bring them back"
        ));
    }
    if storage.unread > 0 {
        lines.push(format!("{} damaged values do not tell what they were, they may be old ones", storage.unread));
    }
    lines
}
