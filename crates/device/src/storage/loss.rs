//! `Loss`: the newest value of a place or a setting is missed; and the note about it on the flash.
//!
//! The damaged value tells of itself only while its sector is there, and while the value of before has not been copied
//! behind it. The note tells for as long as nobody has made the loss good:
//!
//! ```text
//! key 0xD0 + place, or 0xE0 + setting     standing u32, head of the lost image
//! ```
//! `standing` is the end of the value that counts instead, its check sum; 0 where there is none. Where another one
//! stands by now the note is out of date: power failed before it could be deleted. A firmware of before passes notes
//! over.

use link::image::NAMED_HEAD_BYTES;

use super::survey::{PLACES, SETTINGS};

/// Key of the note about place 0.
const OF_PLACES: u8 = 0xD0;

/// Key of the note about the first setting.
const OF_SETTINGS: u8 = OF_PLACES + PLACES;

/// Bytes of a note.
pub(super) const NOTE_BYTES: usize = 4 + NAMED_HEAD_BYTES;

/// Place or setting that a note is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Subject {
    /// The image of a place.
    Place(u8),
    /// The setting of this number in [`SETTINGS`].
    Setting(u8),
}

impl Subject {
    /// The subject of the value under a key that is no note.
    pub(super) fn of_value(key: u8) -> Self {
        let setting = SETTINGS.iter().position(|setting| *setting == key).and_then(|place| u8::try_from(place).ok());
        setting.map_or(Self::Place(key), Self::Setting)
    }

    /// The subject of the note under a key; `None`: it is no note.
    pub(super) fn of_note(key: u8) -> Option<Self> {
        let settings = u8::try_from(SETTINGS.len()).unwrap_or_default();
        let setting = key.checked_sub(OF_SETTINGS).filter(|setting| *setting < settings).map(Self::Setting);
        let place = key.checked_sub(OF_PLACES).filter(|place| *place < PLACES).map(Self::Place);
        setting.or(place)
    }

    /// The key of its note.
    pub(super) fn note_key(self) -> u8 {
        match self {
            Self::Place(place) => OF_PLACES + place % PLACES,
            Self::Setting(setting) => OF_SETTINGS + setting,
        }
    }
}

/// Remains of a lost value; all zeros where none is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Loss {
    /// The newest value is missed.
    pub(super) is_lost: bool,
    /// The flash has a note about it.
    is_noted: bool,
    /// The end of the value that counted as the note was written.
    standing: u32,
    /// The first bytes of the image, as far as they are known.
    pub(super) head: [u8; NAMED_HEAD_BYTES],
}

impl Loss {
    /// Nothing is lost.
    pub(super) const NONE: Self = Self { is_lost: false, is_noted: false, standing: 0, head: [0; NAMED_HEAD_BYTES] };

    /// A damaged value was found that begins in this way.
    pub(super) fn find(&mut self, head: &[u8]) {
        self.is_lost = true;
        self.head.iter_mut().zip(head).for_each(|(place, byte)| *place = *byte);
    }

    /// A note was found; an empty one deletes it.
    pub(super) fn read(&mut self, note: &[u8]) {
        let Some((standing, head)) = note.split_first_chunk::<4>() else { return *self = Self::NONE };
        (self.is_noted, self.standing) = (true, u32::from_le_bytes(*standing));
        self.head.iter_mut().zip(head).for_each(|(place, byte)| *place = *byte);
    }

    /// Everything was read, and this value counts.
    pub(super) fn judge(&mut self, standing: u32) {
        self.is_lost |= self.is_noted && self.standing == standing;
    }

    /// Another value stands there now.
    pub(super) fn make_good(&mut self) {
        self.is_lost = false;
    }

    /// True if the flash does not say the same.
    pub(super) fn wants_note(&self) -> bool {
        self.is_lost != self.is_noted
    }

    /// The note to write, or `None` where one is to be deleted.
    pub(super) fn note(&self, standing: u32) -> Option<[u8; NOTE_BYTES]> {
        let mut note = [0; NOTE_BYTES];
        let bytes = standing.to_le_bytes().into_iter().chain(self.head);
        note.iter_mut().zip(bytes).for_each(|(place, byte)| *place = byte);
        self.is_lost.then_some(note)
    }

    /// The flash has a note, or has none any more.
    pub(super) fn set_noted(&mut self, is_noted: bool) {
        self.is_noted = is_noted;
    }
}

/// The end of a value, by which it is told from others; 0 for none.
pub(super) fn end_of(value: &[u8]) -> u32 {
    value.last_chunk().map_or(0, |end| u32::from_le_bytes(*end))
}
