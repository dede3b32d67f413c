//! A flash whose erases are done or not done: what the log above needs and no flash gives.
//!
//! `sequential-storage` trusts two things that a power failure can break. That a sector whose erase was interrupted
//! shows it: here the [`Journal`] knows, and the erase is repeated before anybody reads. And that a marker word at the
//! edge of a sector is read the same every time: here a marker counts as written as soon as one bit of it is, because
//! half a marker can be neither trusted nor written again.
//!
//! It also trusts that a blank sector is blank. A bit that falls over there would make a sector of nothing the newest
//! one, and the older ones would be given up: such a sector is erased when the region is opened. Where a word behind
//! the newest value is not blank, the sector is closed and the next one is used.

use embedded_storage_async::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};

use super::header::{WORD_LIMIT, length_of};
use super::journal::{Journal, JournalState, SECTORS, sector_bytes};

/// Sectors the log needs: one is always blank, and while one is emptied its content must fit elsewhere.
const LOG_SECTORS: u32 = 2;

/// Bytes looked at in one go when a sector is tested for being blank.
const BLANK_CHUNK: usize = 256;

/// Times that an erase is tried: what fails once may do better the next time, and costs nothing but time.
const ERASE_TRIES: u8 = 3;

/// Bytes looked at before others have their turn.
const PART_BYTES: u32 = 4096;

/// The first word of a sector.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Marker {
    /// The sector is free.
    Blank,
    /// The sector is in use, or is going to be.
    Whole,
    /// Neither.
    Damaged,
}

/// Why something was not done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum JournaledError<E> {
    /// The flash does not work.
    Flash(E),
    /// A sector cannot be erased or written.
    Sector(u8),
    /// A word that was to be written is not blank.
    NotBlank,
}

impl<E: NorFlashError> NorFlashError for JournaledError<E> {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Flash(error) => error.kind(),
            Self::Sector(_) | Self::NotBlank => NorFlashErrorKind::Other,
        }
    }
}

/// The region without its journal.
#[derive(Debug)]
pub(super) struct JournaledFlash<F> {
    flash: F,
    journal: Journal,
    /// Bytes of the log: all but the journal.
    capacity: u32,
    /// Where a word was not blank that was to be written.
    blocked_at: Option<u32>,
    /// A sector whose erase was begun and does not succeed: what it holds is nobody's, and it is read as blank.
    blind: Option<u32>,
}

/// State of the region at start-up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Found {
    /// In order.
    Sound,
    /// One erase had been interrupted and has been repeated.
    Resumed,
    /// Blank or foreign: it is ours now, and blank.
    Formatted,
}

impl<F: NorFlash> JournaledFlash<F> {
    /// Bytes of the log in a region of this flash; `None`: the flash is of a kind this storage cannot use.
    pub(super) fn log_bytes(flash: &F) -> Option<u32> {
        let usable = F::WRITE_SIZE <= WORD_LIMIT
            && F::READ_SIZE <= WORD_LIMIT
            && WORD_LIMIT.is_multiple_of(F::WRITE_SIZE.max(F::READ_SIZE))
            && F::ERASE_SIZE.is_multiple_of(BLANK_CHUNK);
        let sectors = u32::try_from(flash.capacity() / F::ERASE_SIZE).ok()?;
        let log = sectors.checked_sub(SECTORS).filter(|log| usable && *log >= LOG_SECTORS)?;
        u32::try_from(F::ERASE_SIZE).ok()?.checked_mul(sectors)?;
        Some(log * sector_bytes::<F>())
    }

    /// Opens a region whose log has this many bytes, and puts in order what a power failure left.
    ///
    /// # Errors
    /// Those of the flash. A sector whose erase is repeated in vain is none: it is told by [`Self::bad_sector`].
    pub(super) async fn open(mut flash: F, capacity: u32) -> Result<(Self, Found), JournaledError<F::Error>> {
        match Journal::read(&mut flash, capacity).await.map_err(JournaledError::Flash)? {
            Some(JournalState { journal, unfinished }) => {
                let mut sound = Self { flash, journal, capacity, blocked_at: None, blind: None };
                let sector = unfinished.filter(|sector| u32::from(*sector) * sector_bytes::<F>() < capacity);
                let Some(sector) = sector else {
                    // If it cannot be done, whoever stores something is told why.
                    let _ = sound.journal.strengthen(&mut sound.flash).await;
                    return Ok((sound, Found::Sound));
                };
                let from = u32::from(sector) * sector_bytes::<F>();
                if erase_sector(&mut sound.flash, from).await.is_err() {
                    sound.blind = Some(from);
                    return Ok((sound, Found::Sound));
                }
                sound.tick_off().await?;
                Ok((sound, Found::Resumed))
            }
            None => {
                let journal = make_ours(&mut flash, capacity).await?;
                Ok((Self { flash, journal, capacity, blocked_at: None, blind: None }, Found::Formatted))
            }
        }
    }

    /// The sector whose erase was begun and does not succeed.
    pub(super) fn bad_sector(&self) -> Option<u8> {
        self.blind.map(number_of::<F>)
    }

    /// Sectors of the log.
    pub(super) fn sectors(&self) -> u32 {
        self.capacity / sector_bytes::<F>().max(1)
    }

    /// Bytes of a word.
    pub(super) fn word_size() -> u32 {
        word_bytes::<F>()
    }

    /// True if the sector at this address is read as free.
    ///
    /// # Errors
    /// Those of the flash.
    pub(super) async fn is_free(&mut self, sector: u32) -> Result<bool, JournaledError<F::Error>> {
        Ok(self.marker(sector).await? == Marker::Blank)
    }

    /// Number of the sector that was written last: the first that is in use and not closed, else the one before the
    /// first that is free.
    ///
    /// # Errors
    /// Those of the flash.
    pub(super) async fn newest_sector(&mut self) -> Result<u32, JournaledError<F::Error>> {
        let (mut free, sectors) = (None, self.sectors());
        for number in 0..sectors {
            let start = number * sector_bytes::<F>();
            let end = start + sector_bytes::<F>() - word_bytes::<F>();
            if self.is_free(start).await? {
                free = free.or(Some(number));
            } else if self.marker(end).await? == Marker::Blank {
                return Ok(number);
            }
        }
        Ok(free.map_or(0, |free| (free + sectors - 1) % sectors.max(1)))
    }

    /// Erases every sector of the log whose first word is damaged and that has no value. Returns how many there were.
    /// In one that was blank other bits may have fallen over, too; in use it would have the older ones given up.
    ///
    /// # Errors
    /// Those of the flash.
    pub(super) async fn clean_markers(&mut self) -> Result<u8, JournaledError<F::Error>> {
        let mut cleaned: u8 = 0;
        for sector in (0..self.capacity).step_by(F::ERASE_SIZE) {
            let marker = self.marker(sector).await?;
            // A marker that power failed in, with values behind it, counts as a whole one.
            if marker == Marker::Damaged && !self.has_value(sector).await? {
                self.erase(sector, sector + sector_bytes::<F>()).await?;
                cleaned = cleaned.saturating_add(1);
            }
        }
        Ok(cleaned)
    }

    /// True if a word of the sector is the header of a value.
    async fn has_value(&mut self, sector: u32) -> Result<bool, JournaledError<F::Error>> {
        let word = word_bytes::<F>();
        let end = sector + sector_bytes::<F>() - word;
        for at in (sector + word..end).step_by(word.max(1) as usize) {
            let mut header = [0xFF; WORD_LIMIT];
            let part = header.get_mut(..word as usize).unwrap_or_default();
            self.flash.read(at, part).await.map_err(JournaledError::Flash)?;
            if length_of(&header).is_some_and(|length| at + word + u32::from(length) <= end) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Looks at the part of the log from `at` on, and erases its sector if that is one of nothing but damage: its first
    /// word is blank, and another one is not. Returns where to look next; `None`: that was all.
    ///
    /// # Errors
    /// Those of the flash.
    pub(super) async fn clean_part(&mut self, at: u32) -> Result<Option<u32>, JournaledError<F::Error>> {
        let sector = at - at % sector_bytes::<F>();
        let next = sector + sector_bytes::<F>();
        let part = (at + PART_BYTES).min(next);
        let after = if self.marker(sector).await? != Marker::Blank || self.is_blind(sector) {
            next
        } else if is_blank(&mut self.flash, (at, part)).await.map_err(JournaledError::Flash)? {
            part
        } else {
            self.erase(sector, next).await?;
            next
        };
        Ok((after < self.capacity).then_some(after))
    }

    async fn marker(&mut self, sector: u32) -> Result<Marker, JournaledError<F::Error>> {
        let mut marker = [0xFF; WORD_LIMIT];
        let marker = marker.get_mut(..word_bytes::<F>() as usize).unwrap_or_default();
        if self.is_blind(sector) {
            return Ok(Marker::Blank);
        }
        self.flash.read(sector, marker).await.map_err(JournaledError::Flash)?;
        Ok(if marker.iter().all(|byte| *byte == 0xFF) {
            Marker::Blank
        } else if marker.iter().all(|byte| *byte == 0) {
            Marker::Whole
        } else {
            Marker::Damaged
        })
    }

    /// Closes the sector in which a word was not blank that was to be written, if the next one is blank; true if it
    /// did. The log then goes on in that one.
    ///
    /// # Errors
    /// Those of the flash.
    pub(super) async fn close_blocked(&mut self) -> Result<bool, JournaledError<F::Error>> {
        let Some(at) = self.blocked_at.take() else { return Ok(false) };
        let sector = at - at % sector_bytes::<F>();
        let next = (sector + sector_bytes::<F>()) % self.capacity.max(1);
        let word = word_bytes::<F>();
        // Where the next one is in use its values are being copied here: closed, they would be taken for complete.
        if !is_blank(&mut self.flash, (next, next + word)).await.map_err(JournaledError::Flash)? {
            return Ok(false);
        }
        let marker = [0; WORD_LIMIT];
        let end = sector + sector_bytes::<F>() - word;
        let written = self.flash.write(end, marker.get(..word as usize).unwrap_or_default()).await;
        written.map_err(|_| JournaledError::Sector(number_of::<F>(end)))?;
        Ok(true)
    }

    /// Gives everything up: the region is blank afterwards.
    ///
    /// # Errors
    /// Those of the flash.
    pub(super) async fn format(&mut self) -> Result<(), JournaledError<F::Error>> {
        self.blocked_at = None;
        self.journal = make_ours(&mut self.flash, self.capacity).await?;
        Ok(())
    }

    async fn erase_one(&mut self, sector: u16, start: u32) -> Result<(), JournaledError<F::Error>> {
        let noted = self.journal.erasing(&mut self.flash, sector).await;
        noted.map_err(|_| JournaledError::Sector(self.journal.sector::<F>()))?;
        if erase_sector(&mut self.flash, start).await.is_err() {
            self.blind = Some(start);
            return Err(JournaledError::Sector(number_of::<F>(start)));
        }
        self.tick_off().await
    }

    async fn tick_off(&mut self) -> Result<(), JournaledError<F::Error>> {
        let noted = self.journal.erased(&mut self.flash).await;
        noted.map_err(|_| JournaledError::Sector(self.journal.sector::<F>()))
    }

    fn is_blind(&self, at: u32) -> bool {
        self.blind == Some(at - at % sector_bytes::<F>().max(1))
    }

    /// True if these bytes are at a marker word, the first or last of a sector.
    fn is_marker(offset: u32, length: usize) -> bool {
        let word = F::WRITE_SIZE.max(F::READ_SIZE);
        let (start, end) = (offset as usize % F::ERASE_SIZE, offset as usize % F::ERASE_SIZE + length);
        end <= word || start >= F::ERASE_SIZE - word
    }
}

/// Bytes of a word, which the markers take.
fn word_bytes<F: NorFlash>() -> u32 {
    u32::try_from(F::WRITE_SIZE.max(F::READ_SIZE)).unwrap_or(0)
}

/// Erases what is not blank, the log first: a journal says that the region is ours only when all of it is.
async fn make_ours<F: NorFlash>(flash: &mut F, log: u32) -> Result<Journal, JournaledError<F::Error>> {
    for sector in (0..log + SECTORS * sector_bytes::<F>()).step_by(F::ERASE_SIZE) {
        let is_blank = is_blank(flash, (sector, sector + sector_bytes::<F>())).await.map_err(JournaledError::Flash)?;
        if !is_blank && erase_sector(flash, sector).await.is_err() {
            return Err(JournaledError::Sector(number_of::<F>(sector)));
        }
    }
    Journal::create(flash, log).await.map_err(|_| JournaledError::Sector(number_of::<F>(log)))
}

async fn erase_sector<F: NorFlash>(flash: &mut F, start: u32) -> Result<(), F::Error> {
    let mut outcome = Ok(());
    for _ in 0..ERASE_TRIES {
        outcome = flash.erase(start, start + sector_bytes::<F>()).await;
        if outcome.is_ok() {
            break;
        }
    }
    outcome
}

/// Number of the sector at an address.
fn number_of<F: NorFlash>(at: u32) -> u8 {
    u8::try_from(at / sector_bytes::<F>().max(1)).unwrap_or(u8::MAX)
}

async fn is_blank<F: NorFlash>(flash: &mut F, (from, to): (u32, u32)) -> Result<bool, F::Error> {
    let mut chunk = [0; BLANK_CHUNK];
    let mut at = from;
    while at < to {
        let length = BLANK_CHUNK.min((to - at) as usize);
        let part = chunk.get_mut(..length).unwrap_or_default();
        flash.read(at, part).await?;
        // Without an early end, so that many bytes are compared at once.
        if part.iter().fold(0xFF, |all, byte| all & byte) != 0xFF {
            return Ok(false);
        }
        at += length as u32;
    }
    Ok(true)
}

impl<F: NorFlash> ErrorType for JournaledFlash<F> {
    type Error = JournaledError<F::Error>;
}

impl<F: NorFlash> ReadNorFlash for JournaledFlash<F> {
    const READ_SIZE: usize = F::READ_SIZE;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        if self.is_blind(offset) {
            bytes.fill(0xFF);
            return Ok(());
        }
        if !Self::is_marker(offset, bytes.len()) {
            return self.flash.read(offset, bytes).await.map_err(JournaledError::Flash);
        }
        // A marker is all zeros; one bit of it is enough.
        let word = F::WRITE_SIZE.max(F::READ_SIZE);
        let mut whole = [0xFF; WORD_LIMIT];
        let whole = whole.get_mut(..word).unwrap_or_default();
        let start = offset - offset % u32::try_from(word).unwrap_or(1);
        self.flash.read(start, whole).await.map_err(JournaledError::Flash)?;
        bytes.fill(if whole.iter().all(|byte| *byte == 0xFF) { 0xFF } else { 0 });
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.capacity as usize
    }
}

impl<F: NorFlash> NorFlash for JournaledFlash<F> {
    const WRITE_SIZE: usize = F::WRITE_SIZE;
    const ERASE_SIZE: usize = F::ERASE_SIZE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        for start in (from..to).step_by(F::ERASE_SIZE) {
            let sector = u16::try_from(start / sector_bytes::<F>()).unwrap_or(u16::MAX);
            self.erase_one(sector, start).await?;
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        let end = offset.saturating_add(u32::try_from(bytes.len()).unwrap_or(u32::MAX));
        if !is_blank(&mut self.flash, (offset, end)).await.map_err(JournaledError::Flash)? {
            self.blocked_at = Some(offset);
            return Err(JournaledError::NotBlank);
        }
        self.flash.write(offset, bytes).await.map_err(|_| JournaledError::Sector(number_of::<F>(offset)))
    }
}
