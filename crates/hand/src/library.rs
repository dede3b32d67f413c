//! `Library`: the primitives the device holds, by name, in the form in which they run.

use link::{Listing, Name};

use crate::image::Summary;
use crate::primitive::{FingerPrimitive, FingerTables, Unfit};

/// Places for primitives.
pub const PLACES: usize = 3;

/// One place.
#[derive(Debug)]
struct Place {
    summary: Option<Summary>,
    primitive: FingerPrimitive,
}

/// All places, and the tables of an upload.
///
/// About 29 kB: a static of its own, lent to the session.
#[derive(Debug)]
pub struct Library {
    places: [Place; PLACES],
    /// What has come of an upload.
    pub(crate) staging: FingerTables,
}

impl Library {
    /// Without primitives.
    pub const EMPTY: Library = Library {
        places: [const { Place { summary: None, primitive: FingerPrimitive::EMPTY } }; PLACES],
        staging: FingerTables::EMPTY,
    };

    /// What is at a place.
    pub(crate) fn get(&self, place: usize) -> Option<&Summary> {
        self.places.get(place)?.summary.as_ref()
    }

    /// Place and summary of a name.
    pub(crate) fn find(&self, name: &Name) -> Option<(usize, &Summary)> {
        (0..PLACES).find_map(|place| self.get(place).filter(|entry| entry.name == *name).map(|entry| (place, entry)))
    }

    /// Where a primitive of this name goes: over the old one, or into a free place.
    pub(crate) fn place_for(&self, name: &Name) -> Option<usize> {
        self.find(name).map(|(place, _)| place).or_else(|| (0..PLACES).find(|place| self.get(*place).is_none()))
    }

    /// The primitive at a place.
    pub(crate) fn primitive(&self, place: usize) -> Option<&FingerPrimitive> {
        self.places.get(place).filter(|place| place.summary.is_some()).map(|place| &place.primitive)
    }

    /// Makes what was uploaded the primitive of a place.
    ///
    /// # Errors
    /// [`Unfit`]: the place holds what it held.
    pub(crate) fn commit(&mut self, place: usize, summary: Summary) -> Result<(), Unfit> {
        let Self { places, staging } = self;
        if let Some(place) = places.get_mut(place) {
            place.primitive.assign(staging)?;
            place.summary = Some(summary);
        }
        Ok(())
    }

    /// Empties a place.
    pub(crate) fn delete(&mut self, place: usize) {
        if let Some(place) = self.places.get_mut(place) {
            place.summary = None;
            place.primitive.clear();
        }
    }
}

/// An entry as it goes over the link.
pub(crate) fn listing(index: u8, entry: &Summary, loaded: bool) -> Listing {
    Listing {
        index,
        name: entry.name.clone(),
        length: entry.length,
        crc: entry.crc,
        duration: entry.duration,
        kernels: entry.kernels,
        expectation: entry.expectation,
        loaded,
    }
}
