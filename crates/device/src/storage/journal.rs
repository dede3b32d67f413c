//! The journal of erases: two sectors in which every erase is announced before it begins and ticked off when it is
//! over.
//!
//! An erase that power fails in leaves a sector in any state, also one that looks whole. Only a note elsewhere can
//! tell. The notes carry a running number and a check sum; the one with the highest number counts. When one sector is
//! full the other is erased and written on: should power fail in *that* erase, what it leaves has lower numbers and
//! does no harm.

use embedded_storage_async::nor_flash::NorFlash;
use link::frame::CRC;

/// Bytes of a note: one word of the flash with the largest words.
pub(super) const NOTE_BYTES: usize = 32;

/// Notes read at a time.
const CHUNK_NOTES: usize = 8;

/// Begins every note: "TacJ", and the version of the layout of the whole region.
const MAGIC: [u8; 6] = *b"TacJ\x01\x00";

/// Sound notes that a journal has at least, but while it is begun. Without one the whole region counts as foreign and
/// is erased: bits that fall over, one after the other in years, must not cost the library.
const LEAST_NOTES: u32 = 4;

/// Sectors of the journal, the last two of the region.
pub(super) const SECTORS: u32 = 2;

/// Content of a note.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Matter {
    /// The region is ours.
    Formatted,
    /// This sector is going to be erased.
    Erasing(u16),
    /// It has been.
    Erased,
}

/// Where the next note goes.
#[derive(Debug)]
pub(super) struct Journal {
    /// Address of the first of the two sectors.
    base: u32,
    half: u32,
    next: u32,
    number: u32,
    /// Sound notes.
    sound: u32,
}

/// Content of the journal at start-up.
pub(super) struct JournalState {
    pub(super) journal: Journal,
    /// The sector whose erase was not ticked off.
    pub(super) unfinished: Option<u16>,
}

impl Journal {
    /// Reads the journal at `base`. `None`: there is none, the region is not ours.
    pub(super) async fn read<F: NorFlash>(flash: &mut F, base: u32) -> Result<Option<JournalState>, F::Error> {
        let mut newest: Option<(u32, Matter, u32)> = None;
        let (mut ends, mut sound) = ([0; SECTORS as usize], 0);
        for (half, end) in (0..SECTORS).zip(&mut ends) {
            let start = base + half * sector_bytes::<F>();
            'half: while *end < notes::<F>() {
                let mut chunk = [0; NOTE_BYTES * CHUNK_NOTES];
                flash.read(start + *end * NOTE_BYTES as u32, &mut chunk).await?;
                for note in chunk.as_chunks::<NOTE_BYTES>().0 {
                    if note.iter().all(|byte| *byte == 0xFF) {
                        break 'half;
                    }
                    *end += 1;
                    let Some((number, matter)) = decode(note) else { continue };
                    sound += 1;
                    if newest.is_none_or(|(newest, ..)| number > newest) {
                        newest = Some((number, matter, half));
                    }
                }
            }
        }
        Ok(newest.map(|(number, matter, half)| {
            let next = ends.get(half as usize).copied().unwrap_or(u32::MAX);
            let unfinished = if let Matter::Erasing(sector) = matter { Some(sector) } else { None };
            JournalState { journal: Self { base, half, next, number, sound }, unfinished }
        }))
    }

    /// Begins a journal, on sectors that are blank, and says that the region is ours.
    pub(super) async fn create<F: NorFlash>(flash: &mut F, base: u32) -> Result<Self, F::Error> {
        let mut journal = Self { base, half: 0, next: 0, number: 0, sound: 0 };
        journal.strengthen(flash).await?;
        Ok(journal)
    }

    /// Says as often that the region is ours that some notes may be damaged before the next start. Only where no erase
    /// is announced: the newest note counts.
    pub(super) async fn strengthen<F: NorFlash>(&mut self, flash: &mut F) -> Result<(), F::Error> {
        while self.sound < LEAST_NOTES {
            self.append(flash, Matter::Formatted).await?;
        }
        Ok(())
    }

    /// Number of the sector that notes go to.
    pub(super) fn sector<F: NorFlash>(&self) -> u8 {
        u8::try_from(self.base / sector_bytes::<F>().max(1) + self.half).unwrap_or(u8::MAX)
    }

    /// This sector is going to be erased.
    pub(super) async fn erasing<F: NorFlash>(&mut self, flash: &mut F, sector: u16) -> Result<(), F::Error> {
        self.append(flash, Matter::Erasing(sector)).await
    }

    /// The sector announced last has been erased.
    pub(super) async fn erased<F: NorFlash>(&mut self, flash: &mut F) -> Result<(), F::Error> {
        self.append(flash, Matter::Erased).await
    }

    async fn append<F: NorFlash>(&mut self, flash: &mut F, matter: Matter) -> Result<(), F::Error> {
        let number = self.number.saturating_add(1);
        let at = self.next_blank(flash).await?;
        flash.write(at, &encode(number, matter)).await?;
        self.next += 1;
        self.number = number;
        self.sound = self.sound.saturating_add(1);
        Ok(())
    }
}

impl Journal {
    /// Address of the next note: the next place that is blank, or the first of the other sector, which is erased.
    async fn next_blank<F: NorFlash>(&mut self, flash: &mut F) -> Result<u32, F::Error> {
        loop {
            if self.next >= notes::<F>() {
                let half = (self.half + 1) % SECTORS;
                let start = self.base + half * sector_bytes::<F>();
                flash.erase(start, start + sector_bytes::<F>()).await?;
                (self.half, self.next) = (half, 0);
                return Ok(start);
            }
            let at = self.base + self.half * sector_bytes::<F>() + self.next * NOTE_BYTES as u32;
            let mut note = [0; NOTE_BYTES];
            flash.read(at, &mut note).await?;
            if note.iter().all(|byte| *byte == 0xFF) {
                return Ok(at);
            }
            // A bit has fallen over in it.
            self.next += 1;
        }
    }
}

/// Bytes of a sector. It fits: that a flash has less than 4 GB is checked when the region is opened.
pub(super) const fn sector_bytes<F: NorFlash>() -> u32 {
    F::ERASE_SIZE as u32
}

/// Notes of one sector.
const fn notes<F: NorFlash>() -> u32 {
    sector_bytes::<F>() / NOTE_BYTES as u32
}

fn encode(number: u32, matter: Matter) -> [u8; NOTE_BYTES] {
    let (kind, sector) = match matter {
        Matter::Formatted => (0, 0),
        Matter::Erasing(sector) => (1, sector),
        Matter::Erased => (2, 0),
    };
    let mut note = [0; NOTE_BYTES];
    let parts =
        MAGIC.into_iter().chain([kind, 0]).chain(sector.to_le_bytes()).chain([0; 2]).chain(number.to_le_bytes());
    for (byte, part) in note.iter_mut().zip(parts) {
        *byte = part;
    }
    if let Some((body, sum)) = note.split_last_chunk_mut::<4>() {
        *sum = CRC.checksum(body).to_le_bytes();
    }
    note
}

fn decode(note: &[u8; NOTE_BYTES]) -> Option<(u32, Matter)> {
    let (body, sum) = note.split_last_chunk::<4>()?;
    if CRC.checksum(body).to_le_bytes() != *sum || !note.starts_with(&MAGIC) {
        return None;
    }
    let [_, _, _, _, _, _, kind, _, low, high, _, _, n0, n1, n2, n3, ..] = *note;
    let matter = match kind {
        0 => Matter::Formatted,
        1 => Matter::Erasing(u16::from_le_bytes([low, high])),
        2 => Matter::Erased,
        _ => return None,
    };
    Some((u32::from_le_bytes([n0, n1, n2, n3]), matter))
}
