//! A change of the store on its way to being durable: the host is answered when it is.

use link::{Name, Refusal, Reply};

use crate::application::{Refused, Saved, SessionPort};
use crate::controller::DeviceController;
use crate::session::arm::ArmApplication;
use crate::session::arm::directory::{Directory, Entry};
use crate::store::{Store, StoreError};

/// For how long after start-up a hello waits for the store to be open, ms. Reading a flash in order takes a tenth of
/// it; one that must first be repaired takes seconds, and then the host is told so instead of waiting.
const OPENING_TIMEOUT_MS: u32 = 1000;

/// A change that is being saved.
#[derive(Debug)]
pub(super) enum Change {
    /// A place of the library.
    Place {
        slot: u8,
        /// The new entry: none after a delete.
        entry: Option<Entry>,
        /// The primitive that was built is still that of the image.
        built: bool,
    },
    /// The home of the arm.
    Home,
    /// The weight of its links.
    Weight,
    /// The secret.
    Secret,
}

impl Change {
    /// The primitive that was built for the change under way is going to be another one.
    pub(super) fn note_building(saving: &mut Option<Self>) {
        if let Some(Change::Place { built, .. }) = saving {
            *built = false;
        }
    }
}

impl<S: Store> ArmApplication<S> {
    /// True while the primitive at a place is on its way out under this name: deleted or renamed.
    pub(super) fn is_leaving(&self, place: u8, name: &Name) -> bool {
        matches!(&self.saving, Some(Change::Place { slot, entry, .. })
            if *slot == place && entry.as_ref().is_none_or(|entry| entry.name != *name))
    }

    /// True while requests must wait because the store does not know yet what it holds.
    pub(super) fn is_opening(&mut self, now_ms: u32) -> bool {
        if !self.opened && self.store.is_open() {
            self.opened = true;
            self.directory = Directory::read(&self.store);
        }
        !self.opened && now_ms < OPENING_TIMEOUT_MS
    }

    /// The change that has become durable, or has failed, since the last call.
    pub(super) fn settle(&mut self, calm: bool, port: &mut impl SessionPort<DeviceController>) -> Option<Saved> {
        let outcome = self.store.finished()?;
        let change = self.saving.take()?;
        if outcome.is_ok() && matches!(change, Change::Weight) {
            self.weight_waits = true;
            self.hand_over_weight(port);
        }
        let mut place = None;
        if let (Ok(()), Change::Place { slot, entry, built }) = (outcome, change) {
            self.replace(slot, entry);
            if built {
                self.preload(slot, calm, port);
            }
            place = Some(slot);
        }
        Some(Saved { outcome: outcome.map_err(Refused::from), place })
    }

    /// Notes what stands at a place now.
    fn replace(&mut self, slot: u8, entry: Option<Entry>) {
        let old = self.directory.get(slot).cloned();
        // A name that is gone cannot be that of the primitive in use.
        let gone = old.as_ref().is_some_and(|old| entry.as_ref().is_none_or(|entry| entry.name != old.name));
        self.directory.set(slot, entry);
        if gone && self.loaded.as_ref().zip(old.as_ref()).is_some_and(|(loaded, old)| loaded.is_same(old)) {
            self.loaded = None;
        }
    }

    /// Losses of the storage; their number of lost images counts every place.
    #[inline(never)]
    pub(super) fn storage(&self, of: u16, place: u8) -> Result<Reply, Refused> {
        self.need_open()?;
        let places = self.directory.places();
        if place >= places {
            return Err((Refusal::NoSuchPrimitive, [places.into(), 0]));
        }
        let lost = (0..places).filter(|place| self.directory.complete(&self.store, *place).loss.is_some()).count();
        let mut storage = self.directory.complete(&self.store, place);
        storage.lost = u8::try_from(lost).unwrap_or(u8::MAX);
        Ok(Reply::Storage { of, storage })
    }

    /// Refuses what needs a store that is not open yet.
    pub(super) fn need_open(&self) -> Result<(), Refused> {
        if self.opened { Ok(()) } else { Err(StoreError::Busy.into()) }
    }
}

impl From<StoreError> for Refused {
    fn from(error: StoreError) -> Self {
        match error {
            StoreError::Full => (Refusal::StoreFull, [0, 0]),
            StoreError::Sector(sector) => (Refusal::StoreWorn, [sector.into(), 0]),
            other => (Refusal::StoreFailed, [other.code(), 0]),
        }
    }
}
