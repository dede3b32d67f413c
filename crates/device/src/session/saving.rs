//! A change of the store on its way to being durable: the host is answered when it is.

use link::{Refusal, Reply};

use super::Session;
use super::directory::{Directory, Entry};
use super::owner::Owner;
use super::upload::Refused;
use crate::port::SessionPort;
use crate::store::{Store, StoreError};

/// For how long after start-up a hello waits for the store to be open, ms. Reading a flash in order takes a tenth of it; one
/// that must first be repaired takes seconds, and then the host is told so instead of waiting.
const OPENING_PATIENCE_MS: u32 = 1000;

/// A change under way.
#[derive(Debug)]
pub(super) struct Saving {
    /// Session and number of the request.
    asker: Option<(u16, u16)>,
    change: Change,
}

/// What changes.
#[derive(Debug)]
enum Change {
    /// A place of the library.
    Place {
        slot: u8,
        /// What will stand there: nothing after a delete.
        entry: Option<Entry>,
        /// The session's primitive is still that of the image.
        built: bool,
    },
    /// The home of the arm.
    Home,
}

impl Saving {
    /// The session's primitive is going to be another one.
    pub(super) fn building(&mut self) {
        if let Change::Place { built, .. } = &mut self.change {
            *built = false;
        }
    }
}

impl<S: Store> Session<S> {
    /// Notes who asked for the change of a place that the store has begun. The answer comes from [`Self::settle`].
    pub(super) fn save(&mut self, of: u16, slot: u8, entry: Option<Entry>) {
        self.note(of, Change::Place { slot, built: entry.is_some(), entry });
    }

    /// The same for a change of the home.
    pub(super) fn save_home(&mut self, of: u16) {
        self.note(of, Change::Home);
    }

    fn note(&mut self, of: u16, change: Change) {
        let asker = self.owner.as_ref().map(|owner| (owner.session(), of));
        self.saving = Some(Saving { asker, change });
    }

    /// Whether a place is being emptied.
    pub(super) fn is_deleting(&self, place: u8) -> bool {
        let change = self.saving.as_ref().map(|saving| &saving.change);
        matches!(change, Some(Change::Place { slot, entry: None, .. }) if *slot == place)
    }

    /// Whether requests must wait because the store does not know yet what it holds.
    pub(super) fn is_opening(&mut self, now_ms: u32) -> bool {
        if !self.opened && self.store.is_open() {
            self.opened = true;
            self.directory = Directory::read(&self.store);
        }
        !self.opened && now_ms < OPENING_PATIENCE_MS
    }

    /// Answers the host whose change has become durable, or has failed.
    pub(super) fn settle(&mut self, now_ms: u32, port: &mut impl SessionPort) {
        let Some(outcome) = self.store.finished() else { return };
        let Some(Saving { asker, change }) = self.saving.take() else { return };
        let mut changed = None;
        if let (Ok(()), Change::Place { slot, entry, built }) = (outcome, change) {
            self.replace(slot, entry);
            if built {
                self.preload(slot, port);
            }
            changed = Some(slot);
        }
        let of = asker.filter(|(session, _)| self.owner.as_ref().map(Owner::session) == Some(*session));
        if let Some((_, of)) = of {
            let reply = match outcome.map_err(|error| -> Refused { error.into() }) {
                Ok(()) => Reply::Accepted { of },
                Err((reason, detail)) => Reply::Refused { of, reason, detail },
            };
            self.answer(now_ms, reply, port);
        }
        if let Some(slot) = changed {
            self.store_changed(now_ms, slot, port);
        }
    }

    /// Notes what stands at a place now.
    fn replace(&mut self, slot: u8, entry: Option<Entry>) {
        let old = self.directory.get(slot).cloned();
        let deleted = entry.is_none();
        self.directory.set(slot, entry);
        if deleted && self.loaded.as_ref().zip(old.as_ref()).is_some_and(|(loaded, old)| loaded.is_same(old)) {
            self.loaded = None;
        }
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
            other => (Refusal::StoreFailed, [other.code(), 0]),
        }
    }
}
