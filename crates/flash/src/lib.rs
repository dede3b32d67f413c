//! A simulated NOR flash: bank 2 of the STM32H743, with its times, its rules, and a power supply that can fail.
//!
//! Bits are written from 1 to 0, a word of 32 bytes at a time and each word once, and set back to 1 by erasing a whole
//! sector. An operation takes virtual time. [`Flash::cut_power_at`] chooses one operation (a word or a sector) in the
//! middle of which power fails: what it leaves behind is drawn from a seed, and afterwards nothing answers.

#![forbid(unsafe_code)]

mod port;

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use oorandom::Rand64;

pub use port::{FlashPort, VirtualClock};

/// A point in virtual time or a duration, in ticks of 40 ns (25 MHz).
pub type Ticks = u64;

/// Ticks in one second; `sim` holds its clock against it.
pub const TICKS_PER_SECOND: Ticks = 25_000_000;

/// Bytes of a word, the least that can be written (STM32H743: 256 bits and their check bits).
pub const WORD_BYTES: usize = 32;

/// Bytes of a sector, the least that can be erased.
pub const SECTOR_BYTES: usize = 128 * 1024;

/// Sectors of a bank.
pub const SECTORS: usize = 8;

/// Bytes of the flash.
pub const FLASH_BYTES: usize = SECTORS * SECTOR_BYTES;

/// A blank byte.
const BLANK: u8 = 0xFF;

/// Durations of the operations, ticks of the virtual clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlashTimes {
    /// Writing one word.
    pub word: Ticks,
    /// Erasing one sector.
    pub sector: Ticks,
}

impl FlashTimes {
    /// An old STM32H743 on a bad day: 0.2 ms a word and 4 s a sector, the longest its data sheet allows for a sector
    /// (8-bit parallelism); typical are half of both and less.
    pub const SLOW: Self = Self { word: TICKS_PER_SECOND / 5000, sector: 4 * TICKS_PER_SECOND };

    /// Typical of the data sheet at 64-bit parallelism: 0.1 ms a word and 1 s a sector.
    pub const TYPICAL: Self = Self { word: TICKS_PER_SECOND / 10_000, sector: TICKS_PER_SECOND };

    /// No time at all, for tests of content.
    pub const NONE: Self = Self { word: 0, sector: 0 };
}

/// Why the flash did not do it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FlashError {
    /// The address is outside the flash or not at a word or sector.
    #[error("outside the flash, or not at the beginning of a word or sector")]
    Place,
    /// The word has been written since its sector was erased.
    #[error("the word is not blank")]
    NotBlank,
    /// Power has failed.
    #[error("power has failed")]
    NoPower,
}

impl FlashError {
    /// Number in the lock step's reply (`docs/lockstep.md`); a flash without power does not reply.
    #[must_use]
    pub const fn code(self) -> u8 {
        match self {
            Self::Place => 1,
            Self::NotBlank => 2,
            Self::NoPower => 3,
        }
    }
}

/// The chip.
#[derive(Debug)]
pub struct Flash {
    bytes: Vec<u8>,
    times: FlashTimes,
    busy_until: Ticks,
    operations: u64,
    erases: [u32; SECTORS],
    cut: Option<(u64, u64)>,
    powered: bool,
    file: Option<File>,
    /// The file did not take everything, and that has been said.
    lost: bool,
}

impl Flash {
    /// A new chip, all of it blank.
    #[must_use]
    pub fn blank(times: FlashTimes) -> Self {
        Self::with_content(vec![BLANK; FLASH_BYTES], times)
    }

    /// A chip with this content; what is missing is blank, what is too much is left out.
    #[must_use]
    pub fn with_content(mut bytes: Vec<u8>, times: FlashTimes) -> Self {
        bytes.resize(FLASH_BYTES, BLANK);
        let erases = [0; SECTORS];
        Self { bytes, times, busy_until: 0, operations: 0, erases, cut: None, powered: true, file: None, lost: false }
    }

    /// A chip whose content is kept in a file, so that it outlives this program. The file is made if there is none.
    ///
    /// # Errors
    /// The file cannot be opened or read, another device uses it, or it has another size than the flash.
    pub fn in_file(path: &Path, times: FlashTimes) -> io::Result<Self> {
        // A node such as /dev/zero has no end, and one such as /dev/null keeps nothing.
        if std::fs::metadata(path).is_ok_and(|found| !found.is_file() && !found.is_dir()) {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "it is no regular file"));
        }
        let mut file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path)?;
        // Two devices on one flash would each write what the other does not know.
        file.try_lock().map_err(|cause| match cause {
            TryLockError::WouldBlock => io::Error::new(io::ErrorKind::ResourceBusy, "another simulated device uses it"),
            TryLockError::Error(cause) => cause,
        })?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        if bytes.is_empty() {
            bytes = vec![BLANK; FLASH_BYTES];
            if let Err(cause) = file.write_all(&bytes) {
                // Half a flash would be refused for its size once there is room again; an empty file is a new one.
                let _ = file.set_len(0);
                return Err(cause);
            }
        } else if bytes.len() != FLASH_BYTES {
            let message = format!("it has {} bytes where a flash has {FLASH_BYTES}", bytes.len());
            return Err(io::Error::new(io::ErrorKind::InvalidData, message));
        }
        Ok(Self { file: Some(file), ..Self::with_content(bytes, times) })
    }

    /// Lets power fail in the middle of the operation of this number, counted from now: 0 is the next one. `seed`
    /// decides what that operation leaves behind.
    pub fn cut_power_at(&mut self, operation: u64, seed: u64) {
        self.cut = Some((self.operations + operation, seed));
    }

    /// Power again: what is in the flash stays as it was left.
    pub fn restart(&mut self) {
        self.powered = true;
        self.cut = None;
        self.busy_until = 0;
    }

    /// True while there is power.
    #[must_use]
    pub fn is_powered(&self) -> bool {
        self.powered
    }

    /// Words written and sectors erased so far.
    #[must_use]
    pub fn operations(&self) -> u64 {
        self.operations
    }

    /// Erases of each sector so far.
    #[must_use]
    pub fn erases(&self) -> &[u32; SECTORS] {
        &self.erases
    }

    /// The content.
    #[must_use]
    pub fn content(&self) -> &[u8] {
        &self.bytes
    }

    /// Reads from an address.
    ///
    /// # Errors
    /// [`FlashError::Place`], [`FlashError::NoPower`]
    pub fn read(&self, address: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        self.live()?;
        let from = place(address)?;
        let end = from.checked_add(bytes.len()).ok_or(FlashError::Place)?;
        bytes.copy_from_slice(self.bytes.get(from..end).ok_or(FlashError::Place)?);
        Ok(())
    }

    /// Writes one word at time `t`; returns the time at which that is over.
    ///
    /// # Errors
    /// [`FlashError`]
    pub fn write_word(&mut self, t: Ticks, address: u32, word: &[u8]) -> Result<Ticks, FlashError> {
        self.live()?;
        let from = place(address)?;
        if word.len() != WORD_BYTES || !from.is_multiple_of(WORD_BYTES) {
            return Err(FlashError::Place);
        }
        let target = self.bytes.get_mut(from..from + WORD_BYTES).ok_or(FlashError::Place)?;
        if target.iter().any(|byte| *byte != BLANK) {
            return Err(FlashError::NotBlank);
        }
        let torn = self.cut.filter(|(operation, _)| *operation == self.operations);
        match torn {
            None => target.copy_from_slice(word),
            Some((_, seed)) => tear_write(seed, target, word),
        }
        self.after(from..from + WORD_BYTES, torn.is_some(), t, self.times.word)
    }

    /// Erases the sector that begins at `address` at time `t`; returns the time at which that is over.
    ///
    /// # Errors
    /// [`FlashError::Place`], [`FlashError::NoPower`]
    pub fn erase_sector(&mut self, t: Ticks, address: u32) -> Result<Ticks, FlashError> {
        self.live()?;
        let from = place(address)?;
        if !from.is_multiple_of(SECTOR_BYTES) {
            return Err(FlashError::Place);
        }
        let target = self.bytes.get_mut(from..from + SECTOR_BYTES).ok_or(FlashError::Place)?;
        let torn = self.cut.filter(|(operation, _)| *operation == self.operations);
        match torn {
            None => target.fill(BLANK),
            Some((_, seed)) => tear_erase(seed, target),
        }
        if let Some(count) = self.erases.get_mut(from / SECTOR_BYTES) {
            *count += 1;
        }
        self.after(from..from + SECTOR_BYTES, torn.is_some(), t, self.times.sector)
    }

    fn live(&self) -> Result<(), FlashError> {
        if self.powered { Ok(()) } else { Err(FlashError::NoPower) }
    }

    /// Ends every operation: keeps the bytes in the file, moves the clock, and loses power if it was torn.
    fn after(
        &mut self,
        range: std::ops::Range<usize>,
        torn: bool,
        t: Ticks,
        duration: Ticks,
    ) -> Result<Ticks, FlashError> {
        self.operations += 1;
        if let (Some(file), Some(bytes)) = (&mut self.file, self.bytes.get(range.clone())) {
            let kept = file.seek(SeekFrom::Start(range.start as u64)).and_then(|_| file.write_all(bytes));
            if let Err(error) = kept
                && !std::mem::replace(&mut self.lost, true)
            {
                // Nobody waits for the file; a flash that is not kept must not go unnoticed. It is said once.
                eprintln!("warning: the content of the simulated flash is not kept: {error}");
            }
        }
        if torn {
            self.powered = false;
            return Err(FlashError::NoPower);
        }
        self.busy_until = self.busy_until.max(t) + duration;
        Ok(self.busy_until)
    }
}

fn place(address: u32) -> Result<usize, FlashError> {
    usize::try_from(address).map_err(|_| FlashError::Place)
}

/// A word in which only some of the bits that should become 0 have become 0: none, all, a share of them, or those of
/// the first bytes.
fn tear_write(seed: u64, target: &mut [u8], word: &[u8]) {
    let mut random = Rand64::new(u128::from(seed));
    let kind = random.rand_range(0..4);
    let whole = usize::try_from(random.rand_range(0..WORD_BYTES as u64)).unwrap_or(0);
    for (index, (byte, wanted)) in target.iter_mut().zip(word).enumerate() {
        *byte = match kind {
            0 => BLANK,
            1 => *wanted,
            2 if index < whole => *wanted,
            2 => BLANK,
            _ => wanted | random.rand_u64().to_le_bytes()[0],
        };
    }
}

/// A sector in which some bits have become 1 again: none, all, a share of them everywhere, or all those of a part of
/// it; or in which the erase had first written zeros, as some flashes do.
fn tear_erase(seed: u64, target: &mut [u8]) {
    let mut random = Rand64::new(u128::from(seed));
    let kind = random.rand_range(0..6);
    let border = usize::try_from(random.rand_range(0..SECTOR_BYTES as u64)).unwrap_or(0);
    for (index, byte) in target.iter_mut().enumerate() {
        match kind {
            0 => {}
            1 => *byte = BLANK,
            2 => *byte |= random.rand_u64().to_le_bytes()[0],
            3 if index < border => *byte = BLANK,
            4 if index >= border => *byte = BLANK,
            5 => *byte &= random.rand_u64().to_le_bytes()[0],
            _ => {}
        }
    }
}

/// One chip, in the hands of all who need it: simulator, device, test.
#[derive(Clone, Debug)]
pub struct FlashChip(Arc<Mutex<Flash>>);

impl FlashChip {
    /// Shares a chip.
    #[must_use]
    pub fn new(flash: Flash) -> Self {
        Self(Arc::new(Mutex::new(flash)))
    }

    /// The chip itself.
    pub fn lock(&self) -> MutexGuard<'_, Flash> {
        // A panic elsewhere leaves the content of a flash as valid as a power failure does.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Default for FlashChip {
    fn default() -> Self {
        Self::new(Flash::blank(FlashTimes::TYPICAL))
    }
}
