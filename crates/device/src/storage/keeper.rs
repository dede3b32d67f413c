//! The one task that touches the flash.

use core::convert::Infallible;
use core::future::poll_fn;
use core::task::Poll;

use embedded_storage_async::nor_flash::NorFlash;
use sequential_storage::Error;
use sequential_storage::cache::{Cache, Uncached};
use sequential_storage::map::{MapConfig, MapStorage};

use super::journaled::{Found, JournaledError, JournaledFlash};
use super::library::Work;
use super::{HOME_KEY, Opening, SECRET_KEY, WEIGHT_KEY};
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

    /// All of the flash has been read.
    fn open(&mut self, opening: Opening);

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
    desk: &mut D,
) -> Infallible {
    let Scratch { image, value } = room;
    let mut log = match open(flash, value, desk).await {
        Some((log, opening)) => {
            desk.open(opening);
            Some(log)
        }
        None => {
            desk.open(Opening { failed: true, ..Opening::default() });
            None
        }
    };
    if let Some(open) = &mut log
        && clean(open).await.is_err()
    {
        log = None;
    }
    loop {
        let Some(work) = desk.take(image) else {
            pause().await;
            continue;
        };
        let outcome = match &mut log {
            Some(open) => change(open, image, value, work).await,
            None => Err(StoreError::Medium),
        };
        if outcome == Err(StoreError::Medium) {
            // Nothing is known of a flash that failed once; only a new start may trust it again.
            log = None;
        }
        desk.settle(outcome);
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

/// Lets the caller do something else.
async fn pause() {
    let mut paused = false;
    poll_fn(|_| {
        if paused {
            return Poll::Ready(());
        }
        paused = true;
        Poll::Pending
    })
    .await;
}

/// Reads everything, oldest first, into the library. `None`: the flash does not work.
async fn open<F: NorFlash, D: LibraryAccess>(flash: F, value: &mut [u8], desk: &mut D) -> Option<(Log<F>, Opening)> {
    let bytes = JournaledFlash::log_bytes(&flash)?;
    let (mut sound, found) = JournaledFlash::open(flash, bytes).await.ok()?;
    let cleaned = sound.clean_markers().await.ok()?;
    let config = MapConfig::try_new(0..bytes).ok()?;
    let mut log = Log::new(sound, config, Cache::new_uncached());
    let mut opening = Opening {
        resumed: found == Found::Resumed,
        cleaned,
        formatted: found == Found::Formatted,
        ..Opening::default()
    };
    match read_all(&mut log, value, desk).await {
        Ok((found, home)) => (opening.found, opening.home) = (found, home),
        Err(Error::Storage { .. }) => return None,
        Err(_) => {
            log.flash().format().await.ok()?;
            opening.formatted = true;
        }
    }
    Some((log, opening))
}

/// Tells the library every image, and weight and secret like one; the last one of a place counts. Returns the number of
/// places that hold one, and the home.
async fn read_all<F: NorFlash, D: LibraryAccess>(
    log: &mut Log<F>,
    value: &mut [u8],
    desk: &mut D,
) -> Result<(u8, StoredHome), Error<JournaledError<F::Error>>> {
    let mut holding = [false; 256];
    let mut home = StoredHome::Nothing;
    let mut values = log.fetch_all_items(value).await?;
    while let Some((slot, image)) = values.next::<&[u8]>(value).await? {
        if slot == HOME_KEY {
            home = StoredHome::read(image);
            continue;
        }
        if let Some(holds) = holding.get_mut(usize::from(slot)).filter(|_| !matches!(slot, WEIGHT_KEY | SECRET_KEY)) {
            *holds = !image.is_empty();
        }
        if image.is_empty() {
            desk.forget(slot);
        } else {
            desk.restore(slot, image);
        }
        // A long flash is read in parts: others have work to do.
        pause().await;
    }
    let found = u8::try_from(holding.iter().filter(|holds| **holds).count()).unwrap_or(u8::MAX);
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

fn refusal<E>(error: Error<E>) -> StoreError {
    match error {
        Error::FullStorage => StoreError::Full,
        Error::ItemTooBig | Error::BufferTooSmall(_) => StoreError::TooLarge,
        _ => StoreError::Medium,
    }
}
