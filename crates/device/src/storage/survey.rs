//! `Survey`: the newest value of every key as its header tells, sound or not.
//!
//! The log passes over a damaged value without a word, and the one before it counts. Here its way is gone once more,
//! by the headers alone. Whoever compares the newest value of a key with what the log gave knows what is lost.
//!
//! ```text
//! word            words ...
//! crc, length, length'   key, value ...        of one value of the log
//! ```
//! A header with a damaged length is passed over word by word, as the log does; the value behind it is known by its
//! first bytes. Behind a blank word the log looks no further in a sector, so what is there is lost, too. A value whose
//! last word is blank was never written to its end: power failed, and nobody was told that it is kept.

use embedded_storage_async::nor_flash::{NorFlash, ReadNorFlash};
use link::image::MAGIC;

use super::header::{HEADER_BYTES, WORD_LIMIT, length_of};
use super::journaled::{JournaledError, JournaledFlash};
use super::pause::pause;
use super::{HOME_KEY, SECRET_KEY, WEIGHT_KEY};

/// Most places of a library that are looked after, as many as a session does.
pub(super) const PLACES: u8 = 16;

/// Keys that are followed, besides those of the places.
pub(super) const SETTINGS: [u8; 3] = [HOME_KEY, WEIGHT_KEY, SECRET_KEY];

const KEYS: usize = PLACES as usize + SETTINGS.len();

/// The first bytes of every value but an empty one, behind its key: an image, then the settings in their order.
const BEGINNINGS: [[u8; 4]; 4] = [MAGIC, *b"TacH", *b"TacW", *b"TacS"];

/// The values that the headers tell of.
pub(super) struct Survey {
    /// Addresses of the keys of the newest values; 0, where every flash has a marker, for none. No more than that is
    /// kept: it lies on a stack that has little room.
    newest: [u32; KEYS],
    /// Headers that are damaged, with values behind them that do not tell whose they are.
    pub(super) unread: u8,
}

impl Survey {
    /// Before anything was looked at.
    pub(super) const EMPTY: Self = Self { newest: [0; KEYS], unread: 0 };

    /// Looks at every sector of the log, the oldest first.
    ///
    /// # Errors
    /// Those of the flash.
    pub(super) async fn look<F: NorFlash>(
        &mut self,
        flash: &mut JournaledFlash<F>,
    ) -> Result<(), JournaledError<F::Error>> {
        let sectors = flash.sectors();
        let newest = flash.newest_sector().await?;
        for step in 1..=sectors {
            let sector = (newest + step) % sectors.max(1) * F::ERASE_SIZE as u32;
            if !flash.is_free(sector).await? {
                self.sector(flash, sector).await?;
            }
            // Others have work to do.
            pause().await;
        }
        Ok(())
    }

    async fn sector<F: NorFlash>(
        &mut self,
        flash: &mut JournaledFlash<F>,
        sector: u32,
    ) -> Result<(), JournaledError<F::Error>> {
        let word = JournaledFlash::<F>::word_size();
        let (mut at, end) = (sector + word, sector + F::ERASE_SIZE as u32 - word);
        let (mut is_behind, mut in_damage) = (false, false);
        while at < end {
            let header = read_word(flash, at).await?;
            let data = at + word;
            if is_blank(&header) {
                (at, is_behind) = (data, true);
                continue;
            }
            let bytes = length_of(&header).and_then(|length| u32::from(length).checked_next_multiple_of(word));
            let next = bytes.map(|bytes| data + bytes).filter(|next| *next <= end && !is_behind);
            let first = if data < end { read_word(flash, data).await? } else { [0xFF; WORD_LIMIT] };
            if let Some(next) = next {
                // Without its last word it was never said to be kept.
                if !is_blank(&read_word(flash, next - word).await?) {
                    self.note(&first, data);
                }
                (at, in_damage) = (next, false);
                continue;
            }
            if begins_a_value(&first) {
                self.note(&first, data);
                in_damage = true;
            } else if !is_behind && !in_damage {
                (self.unread, in_damage) = (self.unread.saturating_add(1), true);
            }
            at = data;
        }
        Ok(())
    }

    /// Notes a value that begins with this word. Its key may be damaged: the beginning of a setting tells it, too.
    fn note(&mut self, first: &[u8; WORD_LIMIT], at: u32) {
        let [key, beginning @ .., _, _, _] = first.first_chunk::<HEADER_BYTES>().copied().unwrap_or_default();
        let setting = BEGINNINGS.iter().position(|known| *known == beginning).and_then(|at| at.checked_sub(1));
        let key = setting.and_then(|at| SETTINGS.get(at)).copied().unwrap_or(key);
        if let Some(newest) = index(key).and_then(|index| self.newest.get_mut(index)) {
            *newest = at;
        } else if index(key).is_none() && key < HOME_KEY {
            self.unread = self.unread.saturating_add(1);
        }
    }

    /// Reads the newest value of a key without the key, as far as `room` goes, and tells whether its header is sound;
    /// `None`: there is no such value.
    ///
    /// # Errors
    /// Those of the flash.
    pub(super) async fn newest<'a, F: NorFlash>(
        &self,
        key: u8,
        flash: &mut JournaledFlash<F>,
        room: &'a mut [u8],
    ) -> Result<Option<(&'a [u8], bool)>, JournaledError<F::Error>> {
        let word = JournaledFlash::<F>::word_size().max(1);
        let Some(at) = index(key).and_then(|index| self.newest.get(index)).copied().filter(|at| *at > 0) else {
            return Ok(None);
        };
        let length = length_of(&read_word(flash, at.saturating_sub(word)).await?).map(usize::from);
        // Of a value whose length nobody knows the beginning is enough: it has the name of an image.
        let wanted = length.unwrap_or(2 * WORD_LIMIT);
        let rest = (flash.capacity() as u32).saturating_sub(at) as usize;
        let bytes = wanted.checked_next_multiple_of(word as usize).unwrap_or(wanted).min(rest);
        let Some(room) = room.get_mut(..bytes) else { return Ok(Some((&[], false))) };
        flash.read(at, room).await?;
        Ok(Some((room.get(1..wanted.min(bytes)).unwrap_or_default(), length.is_some())))
    }
}

fn index(key: u8) -> Option<usize> {
    let setting = SETTINGS.iter().position(|setting| *setting == key).map(|place| usize::from(PLACES) + place);
    setting.or_else(|| (key < PLACES).then_some(usize::from(key)))
}

async fn read_word<F: NorFlash>(
    flash: &mut JournaledFlash<F>,
    at: u32,
) -> Result<[u8; WORD_LIMIT], JournaledError<F::Error>> {
    let mut bytes = [0xFF; WORD_LIMIT];
    let word = JournaledFlash::<F>::word_size() as usize;
    flash.read(at, bytes.get_mut(..word).unwrap_or_default()).await?;
    Ok(bytes)
}

fn is_blank(word: &[u8; WORD_LIMIT]) -> bool {
    word.iter().all(|byte| *byte == 0xFF)
}

fn begins_a_value(word: &[u8; WORD_LIMIT]) -> bool {
    let [key, beginning @ .., _, _, _] = word.first_chunk::<HEADER_BYTES>().copied().unwrap_or_default();
    index(key).is_some() && BEGINNINGS.contains(&beginning)
}
