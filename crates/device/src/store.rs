//! Where primitives are kept: places for whole images, and a spare one in which an upload grows; and the home of the
//! arm, the weight of its links, and a secret.
//!
//! Invariants every [`Store`] keeps: an image is either wholly there or not at all; until [`Store::finished`] tells of
//! success, reading gives what it gave before the change was asked for; if power fails in between, the next start finds
//! the old or the new (for a store that outlives power); names are the session's business, not the store's.

use core::fmt;

use control::model::WeightCorrection;
use link::frame::CRC;
use link::{Secret, StorageReport};

use crate::calibration::{Home, StoredHome};
use crate::secret::StoredSecret;
use crate::weight::StoredWeight;

/// Places of the store of a device without flash of its own.
pub const STORE_SLOTS: usize = 8;

/// Bytes of a place: the largest image there can be.
pub const STORE_SLOT_BYTES: usize = link::image::IMAGE_BYTES_LIMIT;

/// Why the store did not do it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StoreError {
    /// The image is larger than a place.
    TooLarge,
    /// No image is being written, or bytes outside the announced length.
    NotOpen,
    /// There is no such place, or nothing in it.
    NoPlace,
    /// The medium failed.
    Medium,
    /// The store is being opened, or another change is not durable yet.
    Busy,
    /// The medium has no room for another image.
    Full,
    /// This sector of the medium cannot be erased or written.
    Sector(u8),
}

impl StoreError {
    /// Number of the error in the detail of a refusal; never renumbered.
    #[must_use]
    pub const fn code(self) -> u32 {
        match self {
            Self::TooLarge => 1,
            Self::NotOpen => 2,
            Self::NoPlace => 3,
            Self::Medium => 4,
            Self::Busy => 5,
            Self::Full => 6,
            Self::Sector(_) => 7,
        }
    }
}

impl fmt::Display for StoreError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TooLarge => "the image is larger than a place of the store",
            Self::NotOpen => "no image is being written",
            Self::NoPlace => "there is no image at that place",
            Self::Medium => "the storage failed",
            Self::Busy => "the storage is being read, or still writing the last change",
            Self::Full => "the storage is full",
            Self::Sector(_) => "a sector of the storage cannot be erased or written",
        })
    }
}

impl core::error::Error for StoreError {}

/// Places for images.
pub trait Store {
    /// True if the store knows by now what it holds.
    fn is_open(&self) -> bool {
        true
    }

    /// Number of places.
    fn slots(&self) -> u8;

    /// Most bytes of one image.
    fn slot_bytes(&self) -> usize;

    /// The image at a place.
    fn image(&self, slot: u8) -> Option<&[u8]>;

    /// Opens the spare place for an image of `length` bytes; forgets one that was being written.
    ///
    /// # Errors
    /// [`StoreError::TooLarge`], [`StoreError::Medium`], [`StoreError::Busy`]
    fn begin(&mut self, length: usize) -> Result<(), StoreError>;

    /// Writes a part of the image.
    ///
    /// # Errors
    /// [`StoreError::NotOpen`] outside the length announced, [`StoreError::Medium`]
    fn write(&mut self, offset: usize, bytes: &[u8]) -> Result<(), StoreError>;

    /// The image being written, all of its announced length.
    fn staged(&self) -> Option<&[u8]>;

    /// Begins to make the image being written the one at place `slot`, whatever was there. It is when
    /// [`Store::finished`] says so.
    ///
    /// # Errors
    /// [`StoreError::NotOpen`], [`StoreError::NoPlace`], [`StoreError::Medium`], [`StoreError::Busy`]. The store is
    /// then as before.
    fn commit(&mut self, slot: u8) -> Result<(), StoreError>;

    /// Forgets the image being written, unless it is being committed.
    fn abort(&mut self);

    /// Begins to empty a place. It is empty when [`Store::finished`] says so.
    ///
    /// # Errors
    /// [`StoreError::NoPlace`], [`StoreError::Medium`], [`StoreError::Busy`]
    fn delete(&mut self, slot: u8) -> Result<(), StoreError>;

    /// The home of the arm that is kept beside the images.
    fn home(&self) -> StoredHome;

    /// Begins to keep this home. It is kept when [`Store::finished`] says so.
    ///
    /// # Errors
    /// [`StoreError::Medium`], [`StoreError::Busy`]
    fn keep_home(&mut self, home: &Home) -> Result<(), StoreError>;

    /// Begins to forget it. It is forgotten when [`Store::finished`] says so.
    ///
    /// # Errors
    /// As [`Store::keep_home`].
    fn forget_home(&mut self) -> Result<(), StoreError>;

    /// The weight of the arm's links that is kept beside the images.
    fn weight(&self) -> StoredWeight;

    /// Begins to keep this weight. It is kept when [`Store::finished`] says so.
    ///
    /// # Errors
    /// As [`Store::keep_home`].
    fn keep_weight(&mut self, weight: &WeightCorrection) -> Result<(), StoreError>;

    /// Begins to forget it. It is forgotten when [`Store::finished`] says so.
    ///
    /// # Errors
    /// As [`Store::keep_home`].
    fn forget_weight(&mut self) -> Result<(), StoreError>;

    /// The secret that is kept beside the images.
    fn secret(&self) -> StoredSecret;

    /// Begins to keep this secret. It is kept when [`Store::finished`] says so.
    ///
    /// # Errors
    /// As [`Store::keep_home`].
    fn keep_secret(&mut self, secret: &Secret) -> Result<(), StoreError>;

    /// Begins to forget it. It is forgotten when [`Store::finished`] says so.
    ///
    /// # Errors
    /// As [`Store::keep_home`].
    fn forget_secret(&mut self) -> Result<(), StoreError>;

    /// Losses and condition of the medium, with the lost image of place `slot`.
    fn report(&self, _slot: u8) -> StorageReport {
        StorageReport::default()
    }

    /// Returns the outcome of the change that was begun last, once, as soon as it is durable.
    fn finished(&mut self) -> Option<Result<(), StoreError>>;
}

/// Opens the spare place for a copy of the image at `slot` that begins with `head`, its check sum made anew.
///
/// # Errors
/// [`StoreError::NoPlace`] if there is no image longer than `head`; as [`Store::begin`] and [`Store::write`].
pub fn stage_copy(store: &mut impl Store, slot: u8, head: &[u8]) -> Result<(), StoreError> {
    const SUM_BYTES: usize = 4;
    // A store cannot be read and written at once: the copy goes through here.
    let mut part = [0; 64];
    let length = store.image(slot).ok_or(StoreError::NoPlace)?.len();
    let end = length.checked_sub(SUM_BYTES).filter(|end| *end >= head.len()).ok_or(StoreError::NoPlace)?;
    store.begin(length)?;
    store.write(0, head)?;
    let mut sum = CRC.digest();
    sum.update(head);
    let mut at = head.len();
    while at < end {
        let next = end.min(at + part.len());
        let from = store.image(slot).and_then(|image| image.get(at..next)).ok_or(StoreError::NoPlace)?;
        let to = part.get_mut(..from.len()).ok_or(StoreError::TooLarge)?;
        to.copy_from_slice(from);
        sum.update(to);
        store.write(at, to)?;
        at = next;
    }
    store.write(end, &sum.finalize().to_le_bytes())
}

impl<S: Store + ?Sized> Store for &mut S {
    fn is_open(&self) -> bool {
        (**self).is_open()
    }

    fn report(&self, slot: u8) -> StorageReport {
        (**self).report(slot)
    }

    fn finished(&mut self) -> Option<Result<(), StoreError>> {
        (**self).finished()
    }

    fn slots(&self) -> u8 {
        (**self).slots()
    }

    fn slot_bytes(&self) -> usize {
        (**self).slot_bytes()
    }

    fn image(&self, slot: u8) -> Option<&[u8]> {
        (**self).image(slot)
    }

    fn begin(&mut self, length: usize) -> Result<(), StoreError> {
        (**self).begin(length)
    }

    fn write(&mut self, offset: usize, bytes: &[u8]) -> Result<(), StoreError> {
        (**self).write(offset, bytes)
    }

    fn staged(&self) -> Option<&[u8]> {
        (**self).staged()
    }

    fn commit(&mut self, slot: u8) -> Result<(), StoreError> {
        (**self).commit(slot)
    }

    fn abort(&mut self) {
        (**self).abort();
    }

    fn delete(&mut self, slot: u8) -> Result<(), StoreError> {
        (**self).delete(slot)
    }

    fn home(&self) -> StoredHome {
        (**self).home()
    }

    fn keep_home(&mut self, home: &Home) -> Result<(), StoreError> {
        (**self).keep_home(home)
    }

    fn forget_home(&mut self) -> Result<(), StoreError> {
        (**self).forget_home()
    }

    fn weight(&self) -> StoredWeight {
        (**self).weight()
    }

    fn keep_weight(&mut self, weight: &WeightCorrection) -> Result<(), StoreError> {
        (**self).keep_weight(weight)
    }

    fn forget_weight(&mut self) -> Result<(), StoreError> {
        (**self).forget_weight()
    }

    fn secret(&self) -> StoredSecret {
        (**self).secret()
    }

    fn keep_secret(&mut self, secret: &Secret) -> Result<(), StoreError> {
        (**self).keep_secret(secret)
    }

    fn forget_secret(&mut self) -> Result<(), StoreError> {
        (**self).forget_secret()
    }
}

/// One place in memory; empty while `length` is 0.
#[derive(Debug, Clone, Copy)]
struct Area<const BYTES: usize> {
    length: usize,
    bytes: [u8; BYTES],
}

impl<const BYTES: usize> Area<BYTES> {
    const EMPTY: Self = Self { length: 0, bytes: [0; BYTES] };

    fn image(&self) -> Option<&[u8]> {
        if self.length == 0 { None } else { self.bytes.get(..self.length) }
    }
}

/// A store in memory: gone when the power is. Takes `(SLOTS + 1) * BYTES` bytes; put it into a static.
#[derive(Debug, Clone)]
pub struct RamStore<const SLOTS: usize, const BYTES: usize> {
    areas: [Area<BYTES>; SLOTS],
    spare: Area<BYTES>,
    home: StoredHome,
    weight: StoredWeight,
    secret: StoredSecret,
    changed: bool,
}

impl<const SLOTS: usize, const BYTES: usize> RamStore<SLOTS, BYTES> {
    /// An empty store.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            areas: [Area::EMPTY; SLOTS],
            spare: Area::EMPTY,
            home: StoredHome::Nothing,
            weight: StoredWeight::Nothing,
            secret: StoredSecret::Nothing,
            changed: false,
        }
    }
}

impl<const SLOTS: usize, const BYTES: usize> Default for RamStore<SLOTS, BYTES> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const SLOTS: usize, const BYTES: usize> Store for RamStore<SLOTS, BYTES> {
    fn slots(&self) -> u8 {
        u8::try_from(SLOTS).unwrap_or(u8::MAX)
    }

    fn slot_bytes(&self) -> usize {
        BYTES
    }

    fn image(&self, slot: u8) -> Option<&[u8]> {
        self.areas.get(usize::from(slot))?.image()
    }

    fn begin(&mut self, length: usize) -> Result<(), StoreError> {
        self.abort();
        if length == 0 || length > BYTES {
            return Err(StoreError::TooLarge);
        }
        self.spare.length = length;
        Ok(())
    }

    fn write(&mut self, offset: usize, bytes: &[u8]) -> Result<(), StoreError> {
        let end = offset.checked_add(bytes.len()).ok_or(StoreError::NotOpen)?;
        if end > self.spare.length {
            return Err(StoreError::NotOpen);
        }
        self.spare.bytes.get_mut(offset..end).ok_or(StoreError::NotOpen)?.copy_from_slice(bytes);
        Ok(())
    }

    fn staged(&self) -> Option<&[u8]> {
        self.spare.image()
    }

    fn commit(&mut self, slot: u8) -> Result<(), StoreError> {
        if self.spare.length == 0 {
            return Err(StoreError::NotOpen);
        }
        let area = self.areas.get_mut(usize::from(slot)).ok_or(StoreError::NoPlace)?;
        core::mem::swap(area, &mut self.spare);
        self.abort();
        self.changed = true;
        Ok(())
    }

    fn abort(&mut self) {
        self.spare.length = 0;
    }

    fn delete(&mut self, slot: u8) -> Result<(), StoreError> {
        let area = self.areas.get_mut(usize::from(slot)).ok_or(StoreError::NoPlace)?;
        if core::mem::take(&mut area.length) == 0 {
            return Err(StoreError::NoPlace);
        }
        self.changed = true;
        Ok(())
    }

    fn home(&self) -> StoredHome {
        self.home
    }

    fn keep_home(&mut self, home: &Home) -> Result<(), StoreError> {
        self.home = StoredHome::Kept(*home);
        self.changed = true;
        Ok(())
    }

    fn forget_home(&mut self) -> Result<(), StoreError> {
        self.home = StoredHome::Nothing;
        self.changed = true;
        Ok(())
    }

    fn weight(&self) -> StoredWeight {
        self.weight
    }

    fn keep_weight(&mut self, weight: &WeightCorrection) -> Result<(), StoreError> {
        self.weight = StoredWeight::Kept(*weight);
        self.changed = true;
        Ok(())
    }

    fn forget_weight(&mut self) -> Result<(), StoreError> {
        self.weight = StoredWeight::Nothing;
        self.changed = true;
        Ok(())
    }

    fn secret(&self) -> StoredSecret {
        self.secret
    }

    fn keep_secret(&mut self, secret: &Secret) -> Result<(), StoreError> {
        self.secret = StoredSecret::Kept(*secret);
        self.changed = true;
        Ok(())
    }

    fn forget_secret(&mut self) -> Result<(), StoreError> {
        self.secret = StoredSecret::Nothing;
        self.changed = true;
        Ok(())
    }

    /// At once: memory has no power failure to survive.
    fn finished(&mut self) -> Option<Result<(), StoreError>> {
        core::mem::take(&mut self.changed).then_some(Ok(()))
    }
}
