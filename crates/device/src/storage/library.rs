//! The library in memory, and what is to be done about it on the flash.

use core::mem;

use control::model::WeightCorrection;
use link::image::legible_name;
use link::{LostImage, Secret, StorageReport};

use super::loss::{Loss, Subject, end_of};
use super::survey::SETTINGS;
use crate::calibration::{HOME_BYTES, Home, StoredHome};
use crate::secret::StoredSecret;
use crate::storage::{HOME_KEY, Opening, SECRET_KEY, WEIGHT_KEY};
use crate::store::{RamStore, Store, StoreError};
use crate::weight::{StoredWeight, WEIGHT_BYTES};

/// Bytes of the largest setting: home, weight or secret.
const SETTING_BYTES: usize = WEIGHT_BYTES;

const _: () = assert!(HOME_BYTES <= SETTING_BYTES && crate::secret::STORED_BYTES <= SETTING_BYTES);

/// A change under way: what the flash must hold before the memory may.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Work {
    /// Keep the image being written as that of a place, or a setting: home, weight or secret.
    Save {
        /// The place, or [`HOME_KEY`], [`WEIGHT_KEY`] or [`SECRET_KEY`].
        slot: u8,
        /// Bytes of it.
        length: usize,
    },
    /// Forget the image of a place, or a setting.
    Delete {
        /// The place, or [`HOME_KEY`], [`WEIGHT_KEY`] or [`SECRET_KEY`].
        slot: u8,
    },
}

impl Work {
    /// True if it is about home, weight or secret, and about no place.
    fn is_of_setting(self) -> bool {
        let (Self::Save { slot, .. } | Self::Delete { slot }) = self;
        matches!(slot, HOME_KEY | WEIGHT_KEY | SECRET_KEY)
    }

    /// True if it is about the image being written.
    fn is_of_image(self) -> bool {
        matches!(self, Self::Save { .. }) && !self.is_of_setting()
    }
}

/// The note that the keeper is at. An empty library is all zeros, which `None` of an `Option` need not be: a board
/// would keep all of its memory, for images as well, a second time in its flash.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
enum Noting {
    /// None.
    Nothing,
    /// The one about this, and whether it was lost as the keeper began.
    Begun(Subject, bool),
}

/// Progress of a change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Job {
    /// Nothing to do.
    None,
    /// Asked for.
    Asked(Work),
    /// In the hands of the keeper.
    Begun(Work),
    /// Over; the session has not asked yet.
    Over(Result<(), StoreError>),
}

/// Primitives in memory whose changes become true when they are durable. Takes `(SLOTS + 1) * BYTES` bytes; put it into
/// a static. A new one is all zeros (an `Option<Opening>` would not be), so that no flash holds its content.
#[derive(Debug)]
pub struct Library<const SLOTS: usize, const BYTES: usize> {
    memory: RamStore<SLOTS, BYTES>,
    home: StoredHome,
    weight: StoredWeight,
    secret: StoredSecret,
    /// The home, weight or secret that is being kept.
    staged: [u8; SETTING_BYTES],
    job: Job,
    is_open: bool,
    opening: Opening,
    losses: [Loss; SLOTS],
    setting_losses: [Loss; SETTINGS.len()],
    noting: Noting,
    /// The flash has taken no note in this start.
    refuses_notes: bool,
}

impl<const SLOTS: usize, const BYTES: usize> Library<SLOTS, BYTES> {
    /// A library that has not been opened.
    #[must_use]
    pub const fn new() -> Self {
        const { assert!(SLOTS <= HOME_KEY as usize, "a place would have the key of the home") };
        Self {
            memory: RamStore::new(),
            home: StoredHome::Nothing,
            weight: StoredWeight::Nothing,
            secret: StoredSecret::Nothing,
            staged: [0; SETTING_BYTES],
            job: Job::None,
            is_open: false,
            opening: Opening::NOTHING,
            losses: [Loss::NONE; SLOTS],
            setting_losses: [Loss::NONE; SETTINGS.len()],
            noting: Noting::Nothing,
            refuses_notes: false,
        }
    }

    /// Content of the flash at start-up; `None` until it was read.
    #[must_use]
    pub fn opening(&self) -> Option<Opening> {
        self.is_open.then_some(self.opening)
    }

    /// The keeper found an image, the weight, the secret or the note about a loss.
    pub fn restore(&mut self, slot: u8, image: &[u8]) {
        if let Some(subject) = Subject::of_note(slot) {
            self.loss_mut(subject).into_iter().for_each(|loss| loss.read(image));
            return;
        }
        match slot {
            WEIGHT_KEY => return self.weight = StoredWeight::read(image),
            SECRET_KEY => return self.secret = StoredSecret::read(image),
            _ => {}
        }
        let kept = self.memory.begin(image.len()).and_then(|()| self.memory.write(0, image));
        if kept.and_then(|()| self.memory.commit(slot)).is_err() {
            // What does not fit is as good as not there, but an older one must not stand for it.
            self.forget(slot);
        }
        let _ = self.memory.finished();
    }

    /// The keeper found an image, the weight, the secret or a note, and it was deleted later.
    pub fn forget(&mut self, slot: u8) {
        if let Some(subject) = Subject::of_note(slot) {
            self.loss_mut(subject).into_iter().for_each(|loss| loss.read(&[]));
            return;
        }
        match slot {
            WEIGHT_KEY => return self.weight = StoredWeight::Nothing,
            SECRET_KEY => return self.secret = StoredSecret::Nothing,
            _ => {}
        }
        let _ = self.memory.delete(slot);
        let _ = self.memory.finished();
    }

    /// True if this is what was restored under the key; nothing, for an image that is empty.
    #[must_use]
    pub fn holds(&self, key: u8, bytes: &[u8]) -> bool {
        match key {
            WEIGHT_KEY if bytes.is_empty() => self.weight == StoredWeight::Nothing,
            WEIGHT_KEY => self.weight == StoredWeight::read(bytes),
            SECRET_KEY if bytes.is_empty() => self.secret == StoredSecret::Nothing,
            SECRET_KEY => self.secret == StoredSecret::read(bytes),
            // What is no place of this library cannot be lost to it.
            _ => key >= self.slots() || self.memory.image(key).unwrap_or_default() == bytes,
        }
    }

    /// The keeper found that the newest image of a place cannot be read; these are its first bytes.
    pub fn lose(&mut self, slot: u8, head: &[u8]) {
        self.loss_mut(Subject::Place(slot)).into_iter().for_each(|loss| loss.find(head));
    }

    /// The keeper found everything there was.
    pub fn open(&mut self, opening: Opening) {
        if opening.formatted || opening.failed {
            (0..self.memory.slots()).for_each(|slot| self.forget(slot));
            self.weight = StoredWeight::Nothing;
            self.secret = StoredSecret::Nothing;
            // What was read of notes is gone with the rest.
            self.losses.fill(Loss::NONE);
            self.setting_losses.fill(Loss::NONE);
        }
        self.home = opening.home;
        self.opening = Opening { weight: self.weight.source(), secret: self.secret.state(), ..opening };
        self.judge_losses();
        self.is_open = true;
    }

    /// Compares the notes about losses with what was read.
    fn judge_losses(&mut self) {
        for subject in self.subjects() {
            let standing = self.standing(subject);
            let is_found =
                matches!(subject, Subject::Setting(number) if self.opening.settings_lost & (1 << number) != 0);
            let Some(loss) = self.loss_mut(subject) else { continue };
            loss.judge(standing);
            if let Subject::Setting(number) = subject {
                loss.is_lost |= is_found;
                self.opening.settings_lost |= u8::from(loss.is_lost) << number;
            }
        }
    }

    /// Everything that may be lost.
    fn subjects(&self) -> impl Iterator<Item = Subject> + use<SLOTS, BYTES> {
        (0..self.memory.slots()).map(Subject::Place).chain([0, 1, 2].map(Subject::Setting))
    }

    fn loss_mut(&mut self, subject: Subject) -> Option<&mut Loss> {
        match subject {
            Subject::Place(place) => self.losses.get_mut(usize::from(place)),
            Subject::Setting(setting) => self.setting_losses.get_mut(usize::from(setting)),
        }
    }

    /// The end of the value that counts; 1 for one that stands and cannot be used.
    fn standing(&self, subject: Subject) -> u32 {
        let key = match subject {
            Subject::Place(place) => return end_of(self.memory.image(place).unwrap_or_default()),
            Subject::Setting(setting) => SETTINGS.get(usize::from(setting)).copied(),
        };
        match key {
            Some(HOME_KEY) => match self.home {
                StoredHome::Nothing => 0,
                StoredHome::Kept(home) => end_of(&home.encode()),
                StoredHome::Damaged | StoredHome::Foreign => 1,
            },
            Some(WEIGHT_KEY) => match &self.weight {
                StoredWeight::Nothing => 0,
                StoredWeight::Kept(weight) => end_of(&crate::weight::encode(weight)),
                StoredWeight::Damaged | StoredWeight::Foreign => 1,
            },
            _ => match &self.secret {
                StoredSecret::Nothing => 0,
                StoredSecret::Kept(secret) => end_of(&crate::secret::encode(secret)),
                StoredSecret::Unreadable => 1,
            },
        }
    }

    /// Hands a change to the keeper, with a copy of what is to be saved; where nobody asks for one, a note about a
    /// loss.
    pub fn take(&mut self, image: &mut [u8]) -> Option<Work> {
        let Job::Asked(work) = self.job else { return self.take_note(image) };
        if let Work::Save { length, .. } = work {
            let staged = if work.is_of_setting() { self.staged.get(..length) } else { self.memory.staged() };
            let pair = staged.zip(image.get_mut(..length)).filter(|(from, to)| from.len() == to.len());
            let Some((from, to)) = pair else {
                self.job = Job::Over(Err(StoreError::TooLarge));
                return None;
            };
            to.copy_from_slice(from);
        }
        self.job = Job::Begun(work);
        Some(work)
    }

    /// Hands the keeper the next note that the flash has and should not have, or the other way round.
    fn take_note(&mut self, room: &mut [u8]) -> Option<Work> {
        if !self.is_open || self.refuses_notes {
            return None;
        }
        let subject = self.subjects().find(|subject| self.loss_mut(*subject).is_some_and(|loss| loss.wants_note()))?;
        let standing = self.standing(subject);
        let note = self.loss_mut(subject)?.note(standing);
        self.noting = Noting::Begun(subject, note.is_some());
        let slot = subject.note_key();
        let Some(note) = note else { return Some(Work::Delete { slot }) };
        room.iter_mut().zip(note).for_each(|(place, byte)| *place = byte);
        Some(Work::Save { slot, length: note.len() })
    }

    /// The keeper is done with the change: it is durable, or the flash is as before.
    pub fn settle(&mut self, outcome: Result<(), StoreError>) {
        if let Noting::Begun(subject, is_noted) = mem::replace(&mut self.noting, Noting::Nothing) {
            match outcome {
                Ok(()) => self.loss_mut(subject).into_iter().for_each(|loss| loss.set_noted(is_noted)),
                Err(error) => {
                    self.refuses_notes = true;
                    self.fail(error);
                }
            }
            return;
        }
        let Job::Begun(work) = self.job else { return };
        let outcome = match work {
            Work::Save { slot: HOME_KEY, length } => {
                outcome.map(|()| self.home = StoredHome::read(self.setting(length)))
            }
            Work::Delete { slot: HOME_KEY } => outcome.map(|()| self.home = StoredHome::Nothing),
            Work::Save { slot: WEIGHT_KEY, length } => {
                outcome.map(|()| self.weight = StoredWeight::read(self.setting(length)))
            }
            Work::Delete { slot: WEIGHT_KEY } => outcome.map(|()| self.weight = StoredWeight::Nothing),
            Work::Save { slot: SECRET_KEY, length } => {
                outcome.map(|()| self.secret = StoredSecret::read(self.setting(length)))
            }
            Work::Delete { slot: SECRET_KEY } => outcome.map(|()| self.secret = StoredSecret::Nothing),
            Work::Save { slot, .. } => outcome.and_then(|()| self.memory.commit(slot)),
            Work::Delete { slot } => outcome.and_then(|()| self.memory.delete(slot)),
        };
        match outcome {
            Ok(()) => self.make_good(work),
            Err(error) => self.fail(error),
        }
        let _ = self.memory.finished();
        // Beside another change an upload may grow, which is none of its business.
        if outcome.is_err() && work.is_of_image() {
            self.memory.abort();
        }
        self.job = Job::Over(outcome);
    }

    /// The flash has failed: the keeper asks it nothing more before a restart.
    pub fn fail(&mut self, error: StoreError) {
        match error {
            StoreError::Sector(sector) => self.opening.bad_sector = Some(sector),
            StoreError::Medium => self.opening.failed = true,
            _ => {}
        }
    }

    /// Another value stands there now: nobody misses the lost one.
    fn make_good(&mut self, work: Work) {
        let (Work::Save { slot, .. } | Work::Delete { slot }) = work;
        let subject = Subject::of_value(slot);
        self.loss_mut(subject).into_iter().for_each(Loss::make_good);
        if let Subject::Setting(number) = subject {
            self.opening.settings_lost &= !(1 << number);
        }
    }

    /// The setting that is being kept.
    fn setting(&self, length: usize) -> &[u8] {
        self.staged.get(..length).unwrap_or_default()
    }

    /// Begins to keep a setting.
    fn keep(&mut self, key: u8, bytes: &[u8]) -> Result<(), StoreError> {
        self.ask(Work::Save { slot: key, length: bytes.len() })?;
        self.staged.iter_mut().zip(bytes).for_each(|(place, byte)| *place = *byte);
        Ok(())
    }

    fn ask(&mut self, work: Work) -> Result<(), StoreError> {
        if !self.is_open || self.job != Job::None {
            return Err(StoreError::Busy);
        }
        self.job = Job::Asked(work);
        Ok(())
    }

    /// True if the image being written is on its way to the flash.
    fn is_saving(&self) -> bool {
        match self.job {
            Job::Asked(work) | Job::Begun(work) => work.is_of_image(),
            Job::None | Job::Over(_) => false,
        }
    }
}

impl<const SLOTS: usize, const BYTES: usize> Default for Library<SLOTS, BYTES> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const SLOTS: usize, const BYTES: usize> Store for Library<SLOTS, BYTES> {
    fn is_open(&self) -> bool {
        self.is_open
    }

    fn slots(&self) -> u8 {
        self.memory.slots()
    }

    fn slot_bytes(&self) -> usize {
        self.memory.slot_bytes()
    }

    fn image(&self, slot: u8) -> Option<&[u8]> {
        self.memory.image(slot)
    }

    fn begin(&mut self, length: usize) -> Result<(), StoreError> {
        if !self.is_open || self.is_saving() {
            return Err(StoreError::Busy);
        }
        self.memory.begin(length)
    }

    fn write(&mut self, offset: usize, bytes: &[u8]) -> Result<(), StoreError> {
        if self.is_saving() {
            return Err(StoreError::Busy);
        }
        self.memory.write(offset, bytes)
    }

    fn staged(&self) -> Option<&[u8]> {
        self.memory.staged().filter(|_| !self.is_saving())
    }

    fn commit(&mut self, slot: u8) -> Result<(), StoreError> {
        let length = self.staged().ok_or(StoreError::NotOpen)?.len();
        if slot >= self.slots() {
            return Err(StoreError::NoPlace);
        }
        self.ask(Work::Save { slot, length })
    }

    fn abort(&mut self) {
        // What has been committed cannot be taken back.
        if !self.is_saving() {
            self.memory.abort();
        }
    }

    fn delete(&mut self, slot: u8) -> Result<(), StoreError> {
        self.image(slot).ok_or(StoreError::NoPlace)?;
        self.ask(Work::Delete { slot })
    }

    fn home(&self) -> StoredHome {
        self.home
    }

    fn keep_home(&mut self, home: &Home) -> Result<(), StoreError> {
        self.keep(HOME_KEY, &home.encode())
    }

    fn forget_home(&mut self) -> Result<(), StoreError> {
        self.ask(Work::Delete { slot: HOME_KEY })
    }

    fn weight(&self) -> StoredWeight {
        self.weight
    }

    fn keep_weight(&mut self, weight: &WeightCorrection) -> Result<(), StoreError> {
        self.keep(WEIGHT_KEY, &crate::weight::encode(weight))
    }

    fn forget_weight(&mut self) -> Result<(), StoreError> {
        self.ask(Work::Delete { slot: WEIGHT_KEY })
    }

    fn secret(&self) -> StoredSecret {
        self.secret
    }

    fn keep_secret(&mut self, secret: &Secret) -> Result<(), StoreError> {
        self.keep(SECRET_KEY, &crate::secret::encode(secret))
    }

    fn forget_secret(&mut self) -> Result<(), StoreError> {
        self.ask(Work::Delete { slot: SECRET_KEY })
    }

    fn report(&self, slot: u8) -> StorageReport {
        let Opening { formatted, failed, bad_sector, settings_lost, unread, .. } = self.opening;
        let loss = self.losses.get(usize::from(slot)).filter(|loss| loss.is_lost);
        StorageReport {
            formatted,
            failed,
            bad_sector,
            lost: u8::try_from(self.losses.iter().filter(|loss| loss.is_lost).count()).unwrap_or(u8::MAX),
            settings_lost,
            unread,
            loss: loss.map(|loss| LostImage {
                place: slot,
                name: legible_name(&loss.head),
                older: self.memory.image(slot).is_some(),
            }),
        }
    }

    fn finished(&mut self) -> Option<Result<(), StoreError>> {
        let Job::Over(outcome) = self.job else { return None };
        self.job = Job::None;
        Some(outcome)
    }
}
