//! The one task that touches the flash.

use core::convert::Infallible;

use embedded_storage_async::nor_flash::NorFlash;
use sequential_storage::Error;
use sequential_storage::cache::{Cache, Uncached};
use sequential_storage::map::{MapConfig, MapStorage};

use super::journaled::{Found, JournaledError, JournaledFlash};
use super::library::Work;
use super::pause::pause;
use super::survey::{PLACES, SETTINGS, Survey};
use super::{HOME_KEY, Opening};
use crate::calibration::StoredHome;
use crate::store::StoreError;

/// Bytes of a value with an image of at most this many bytes: key, image, filling up to the largest word.
#[must_use]
pub const fn value_bytes(image: usize) -> usize {
    (image + 1).next_multiple_of(32)
}

type NoCache = Cache<Uncached, Uncached, Uncached, u8>;
type Log<F> = MapStorage<u8, JournaledFlash<F>, NoCache>;

/// Memory the keeper works in: the image being saved, and a value of the log ([`value_bytes`]). Put it into a static.
#[derive(Debug)]
pub struct Scratch<const IMAGE: usize, const VALUE: usize> {
    image: [u8; IMAGE],
    value: [u8; VALUE],
}

impl<const IMAGE: usize, const VALUE: usize> Scratch<IMAGE, VALUE> {
    /// Empty.
    #[must_use]
    pub const fn new() -> Self {
        Self { image: [0; IMAGE], value: [0; VALUE] }
    }
}

impl<const IMAGE: usize, const VALUE: usize> Default for Scratch<IMAGE, VALUE> {
    fn default() -> Self {
        Self::new()
    }
}

/// Where the keeper meets the library, which others use at the same time. Each call is short.
pub trait LibraryAccess {
    /// An image was found on the flash.
    fn restore(&mut self, slot: u8, image: &[u8]);

    /// Notes that the flash holds a deletion for this place.
    fn forget(&mut self, slot: u8);

    /// True if the library has this under the key: an image, weight or secret, or nothing where it is empty.
    fn holds(&mut self, key: u8, bytes: &[u8]) -> bool;

    /// The newest image of a place cannot be read, or it was deleted and that cannot; `head` are its first bytes.
    fn lose(&mut self, slot: u8, head: &[u8]);

    /// All of the flash has been read.
    fn open(&mut self, opening: Opening);

    /// The flash fails though nobody has asked anything of it.
    fn fail(&mut self, error: StoreError);

    /// A change to make durable; the image to save is copied into `image`.
    fn take(&mut self, image: &mut [u8]) -> Option<Work>;

    /// The change is durable, or it is refused and the flash is as before.
    fn settle(&mut self, outcome: Result<(), StoreError>);
}

/// Opens the library on this flash and makes its changes durable, for ever. Poll it when nothing else is to be done,
/// again after every interrupt: it waits for the flash and for work by being pending, and wakes no task.
pub async fn keep<F: NorFlash, D: LibraryAccess, const IMAGE: usize, const VALUE: usize>(
    flash: F,
    room: &mut Scratch<IMAGE, VALUE>,
    library: &mut D,
) -> Infallible {
    let Scratch { image, value } = room;
    let mut log = match open(flash, value, library).await {
        Ok((log, opening)) => {
            library.open(opening);
            opening.bad_sector.map_or(Ok(log), |sector| Err(StoreError::Sector(sector)))
        }
        Err(error) => {
            let bad_sector = if let StoreError::Sector(sector) = error { Some(sector) } else { None };
            library.open(Opening { failed: true, bad_sector, ..Opening::default() });
            Err(error)
        }
    };
    if let Ok(open) = &mut log
        && let Err(error) = clean(open).await
    {
        let error = medium(error);
        // At once: whoever learned of it from a refused change would have relied on the storage until then.
        library.fail(error);
        log = Err(error);
    }
    loop {
        let Some(work) = library.take(image) else {
            pause().await;
            continue;
        };
        let outcome = match &mut log {
            Ok(open) => change(open, image, value, work).await,
            Err(error) => Err(*error),
        };
        if let Err(error @ (StoreError::Medium | StoreError::Sector(_))) = outcome {
            // Nothing is known of a flash that failed once; only a new start may trust it again.
            log = Err(error);
        }
        library.settle(outcome);
    }
}

/// Erases blank sectors in which bits have fallen over, before anything is written. It takes a while, and others have
/// work to do: a host that connects is not kept waiting.
async fn clean<F: NorFlash>(log: &mut Log<F>) -> Result<(), JournaledError<F::Error>> {
    let mut at = Some(0);
    while let Some(from) = at {
        at = log.flash().clean_part(from).await?;
        pause().await;
    }
    Ok(())
}

/// Reads everything, oldest first, into the library, and tells what is lost.
///
/// # Errors
/// The flash does not work.
async fn open<F: NorFlash, D: LibraryAccess>(
    flash: F,
    value: &mut [u8],
    library: &mut D,
) -> Result<(Log<F>, Opening), StoreError> {
    let bytes = JournaledFlash::log_bytes(&flash).ok_or(StoreError::Medium)?;
    let (mut sound, found) = JournaledFlash::open(flash, bytes).await.map_err(medium)?;
    let cleaned = match sound.clean_markers().await {
        Ok(cleaned) => cleaned,
        // What can be read is read nevertheless.
        Err(JournaledError::Sector(_)) if sound.bad_sector().is_some() => 0,
        Err(error) => return Err(medium(error)),
    };
    let config = MapConfig::try_new(0..bytes).map_err(|_| StoreError::Medium)?;
    let mut log = Log::new(sound, config, Cache::new_uncached());
    let mut opening = Opening {
        resumed: found == Found::Resumed,
        cleaned,
        formatted: found == Found::Formatted,
        ..Opening::default()
    };
    match read_all(&mut log, value, library).await {
        Ok((found, home)) => {
            (opening.found, opening.home) = (found, home);
            (opening.settings_lost, opening.unread) =
                tell_lost(log.flash(), value, library, home).await.map_err(medium)?;
        }
        Err(Error::Storage { value, .. }) => return Err(medium(value)),
        Err(_) => {
            log.flash().format().await.map_err(medium)?;
            opening.formatted = true;
        }
    }
    opening.bad_sector = log.flash().bad_sector();
    Ok((log, opening))
}

/// Tells the library which images are lost; returns which settings are, and how many values do not tell whose they are.
async fn tell_lost<F: NorFlash, D: LibraryAccess>(
    flash: &mut JournaledFlash<F>,
    value: &mut [u8],
    library: &mut D,
    home: StoredHome,
) -> Result<(u8, u8), JournaledError<F::Error>> {
    let mut survey = Survey::EMPTY;
    survey.look(flash).await?;
    let mut settings_lost = 0;
    for (key, bit) in SETTINGS.into_iter().zip([1, 2, 4]) {
        let Some((bytes, is_whole)) = survey.newest(key, flash, value).await? else { continue };
        let is_held = match key {
            HOME_KEY => StoredHome::read(bytes) == home,
            _ => library.holds(key, bytes),
        };
        settings_lost |= if is_whole && is_held { 0 } else { bit };
    }
    for place in 0..PLACES {
        let Some((bytes, is_whole)) = survey.newest(place, flash, value).await? else { continue };
        if !(is_whole && library.holds(place, bytes)) {
            library.lose(place, bytes);
        }
        pause().await;
    }
    Ok((settings_lost, survey.unread))
}

fn medium<E>(error: JournaledError<E>) -> StoreError {
    match error {
        JournaledError::Sector(sector) => StoreError::Sector(sector),
        JournaledError::Flash(_) | JournaledError::NotBlank => StoreError::Medium,
    }
}

/// Tells the library every image, and weight and secret like one; the last one of a place counts. Returns the number of
/// places that hold one, and the home.
async fn read_all<F: NorFlash, D: LibraryAccess>(
    log: &mut Log<F>,
    value: &mut [u8],
    library: &mut D,
) -> Result<(u8, StoredHome), Error<JournaledError<F::Error>>> {
    // A bit for each key: this lies on the stack.
    let mut holding = [0_u32; 8];
    let mut home = StoredHome::Nothing;
    let mut values = log.fetch_all_items(value).await?;
    while let Some((slot, image)) = values.next::<&[u8]>(value).await? {
        if slot == HOME_KEY {
            home = StoredHome::read(image);
            continue;
        }
        let group = holding.get_mut(usize::from(slot / 32)).filter(|_| slot < HOME_KEY);
        if let Some(group) = group {
            let bit = 1 << (slot % 32);
            *group = if image.is_empty() { *group & !bit } else { *group | bit };
        }
        if image.is_empty() {
            library.forget(slot);
        } else {
            library.restore(slot, image);
        }
        // A long flash is read in parts: others have work to do.
        pause().await;
    }
    let found = u8::try_from(holding.iter().map(|group| group.count_ones()).sum::<u32>()).unwrap_or(u8::MAX);
    Ok((found, home))
}

/// Appends the new value, and reads it back: it is durable when the flash says the same as the memory.
async fn change<F: NorFlash>(log: &mut Log<F>, image: &[u8], value: &mut [u8], work: Work) -> Result<(), StoreError> {
    // A flash cannot forget one value; an empty one stands for it.
    let (slot, content) = match work {
        Work::Save { slot, length } => (slot, image.get(..length).ok_or(StoreError::TooLarge)?),
        Work::Delete { slot } => (slot, image.get(..0).unwrap_or_default()),
    };
    // Once for each sector that has to be closed.
    loop {
        match log.store_item_generic(value, &slot, &content).await {
            Err(Error::Storage { value: JournaledError::NotBlank, .. })
                if log.flash().close_blocked().await.is_ok_and(|closed| closed) => {}
            outcome => break outcome.map_err(refusal)?,
        }
    }
    let kept = log.fetch_item::<&[u8]>(value, &slot).await.map_err(refusal)?;
    if kept == Some(content) { Ok(()) } else { Err(StoreError::Medium) }
}

fn refusal<E>(error: Error<JournaledError<E>>) -> StoreError {
    match error {
        Error::Storage { value, .. } => medium(value),
        Error::FullStorage => StoreError::Full,
        Error::ItemTooBig | Error::BufferTooSmall(_) => StoreError::TooLarge,
        _ => StoreError::Medium,
    }
}
