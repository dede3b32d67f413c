//! `Directory`: the content of the store by name, read once at start-up, kept up to date by the session.
//!
//! Checking an image costs a check sum over all its bytes; looking a name up must not.

use link::image::legible_name;
use link::{Listing, LostImage, Name, PrimitiveImage, StorageReport};

use crate::store::Store;

/// Most places of a store the session can look after.
pub(crate) const PLACES: usize = 16;

/// One stored image.
#[derive(Debug, Clone)]
pub(crate) struct Entry {
    pub(crate) name: Name,
    pub(crate) length: u32,
    pub(crate) crc: u32,
    duration: f32,
    kernels: u16,
    expectation: bool,
}

impl Entry {
    /// Describes a checked image.
    pub(crate) fn of(image: &PrimitiveImage<'_>) -> Self {
        let content = image.content();
        Self {
            name: image.name().clone(),
            length: u32::try_from(image.bytes().len()).unwrap_or(u32::MAX),
            crc: image.crc(),
            duration: content.duration,
            kernels: u16::try_from(content.kernels).unwrap_or(u16::MAX),
            expectation: image.has_expectation(),
        }
    }

    /// True if both are the same image, byte for byte.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        (&self.name, self.length, self.crc) == (&other.name, other.length, other.crc)
    }

    /// The entry as it goes over the link.
    pub(crate) fn listing(&self, index: u8, loaded: bool) -> Listing {
        Listing {
            index,
            name: self.name.clone(),
            length: self.length,
            crc: self.crc,
            duration: self.duration,
            kernels: self.kernels,
            expectation: self.expectation,
            loaded,
        }
    }
}

/// The entries of all places.
#[derive(Debug)]
pub(crate) struct Directory {
    entries: [Option<Entry>; PLACES],
    places: u8,
}

impl Directory {
    /// Reads a store. An image that is not sound is as good as none: its place is free.
    pub(crate) fn read(store: &impl Store) -> Self {
        let mut directory =
            Self { entries: [const { None }; PLACES], places: store.slots().min(u8::try_from(PLACES).unwrap_or(0)) };
        for (slot, entry) in (0..directory.places).zip(directory.entries.iter_mut()) {
            let image = store.image(slot).and_then(|bytes| PrimitiveImage::parse(bytes).ok());
            *entry = image.as_ref().map(Entry::of);
        }
        directory.keep_one_of_each(store);
        directory
    }

    /// Of two places with one name the one counts that has lost nothing: at the other a damaged image has let the one
    /// before it come back, whose name was given away since. That one is as good as none.
    fn keep_one_of_each(&mut self, store: &impl Store) {
        let has_lost = |slot: u8| store.report(slot).loss.is_some();
        for slot in 0..self.places {
            for other in 0..slot {
                let names = self.get(other).zip(self.get(slot)).map(|(other, entry)| (&other.name, &entry.name));
                if names.is_some_and(|(other, name)| other == name) {
                    // Where both have lost something nobody knows which is newer: the first one counts.
                    let dropped = if has_lost(other) && !has_lost(slot) { other } else { slot };
                    self.set(dropped, None);
                }
            }
        }
    }

    /// Number of places.
    pub(crate) fn places(&self) -> u8 {
        self.places
    }

    /// The entry of a place.
    pub(crate) fn get(&self, slot: u8) -> Option<&Entry> {
        self.entries.get(usize::from(slot))?.as_ref()
    }

    /// Place and entry of a name.
    pub(crate) fn find(&self, name: &Name) -> Option<(u8, &Entry)> {
        (0..self.places).find_map(|slot| self.get(slot).filter(|entry| entry.name == *name).map(|entry| (slot, entry)))
    }

    /// A place to put an image of a new name: a free one. One that has lost an image comes last: with another one there
    /// nobody would be told any more. Its store may still hold an unsound image there.
    pub(crate) fn free(&self, store: &impl Store) -> Option<u8> {
        let mut free = (0..self.places).filter(|slot| self.get(*slot).is_none());
        let first = free.clone().next();
        free.find(|slot| store.image(*slot).is_none() && store.report(*slot).loss.is_none()).or(first)
    }

    /// Adds to what the store reports about a place: an image that the store could read and that is not sound is lost,
    /// and one whose name stands elsewhere by now is not missed.
    pub(crate) fn complete(&self, store: &impl Store, place: u8) -> StorageReport {
        let mut report = store.report(place);
        if report.loss.is_none()
            && self.get(place).is_none()
            && let Some(image) = store.image(place)
        {
            report.loss = Some(LostImage { place, name: legible_name(image), older: false });
        }
        if let Some(loss) = &mut report.loss {
            // What came back under a name that stands elsewhere is not used.
            loss.older &= self.get(place).is_some();
        }
        let is_back = |loss: &LostImage| loss.name.as_ref().is_some_and(|name| self.find(name).is_some());
        report.loss = report.loss.filter(|loss| loss.older || !is_back(loss));
        report
    }

    /// Notes what is at a place now.
    pub(crate) fn set(&mut self, slot: u8, entry: Option<Entry>) {
        if let Some(place) = self.entries.get_mut(usize::from(slot)) {
            *place = entry;
        }
    }
}
