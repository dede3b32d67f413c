//! Bank 2 of the internal flash: where the device keeps its library.
//!
//! The image runs from bank 1 and ITCM, so an operation in bank 2 stops nobody; whoever awaits it is asked again and
//! again whether it has ended, and interrupts are never masked for it. (The chip's usual driver erases inside a
//! critical section, for up to four seconds.) While an operation runs nothing reads bank 2: this type is the only way
//! to it, and the memory protection unit keeps the processor from reading ahead in it.
//!
//! A flash word of 32 bytes carries check bits. One that was being written when power went may be damaged beyond
//! repair: reading it is then a bus fault, which [`read_word`] turns into 32 zero bytes. The storage above tells from
//! its own check sums that this is nothing it wrote.
//!
//! The status tells an operation that went wrong, not one that was never begun: a control register that stays locked
//! takes no order, and an order that is lost raises no flag. So it is asked whether the register has opened, and what
//! was written or erased is read back before it counts as done.
//!
//! An operation that does not end is an error after a while. A bank that is busy is not touched any more: whoever reads
//! it waits in the middle of an instruction, the control slot behind it, until the watchdog ends that.

use core::arch::asm;
use core::future::poll_fn;
use core::task::Poll;

use embassy_stm32::pac::FLASH;
use embassy_stm32::pac::flash::Bank;
use embassy_stm32::pac::flash::regs::{Ccr, Sr};
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};

use super::super::constants::memory::{ERASE_US, FLASH_WORD_BYTES, SECTOR_BYTES, STORE, WRITE_US};
use super::clock;

/// Number of the bank, counted from 0.
const BANK: usize = 1;

/// Keys that open the bank's control register, in order.
const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

/// Bytes of a flash word.
const WORD_BYTES: usize = FLASH_WORD_BYTES as usize;

/// Processor words of a flash word.
const PARTS: usize = WORD_BYTES / 4;

/// Widest writes the supply allows at 3.3 V (PSIZE: 64 bits).
const PARALLELISM: u8 = 3;

/// Configurable fault status register: what a read of the flash ran into.
const FAULT_STATUS: *mut u32 = 0xE000_ED28 as *mut u32;
/// Its bits of bus faults.
const BUS_FAULTS: u32 = 0xFF00;

/// Looks at the status before the task lets the core sleep until the next interrupt: about 0.2 ms, which a flash word
/// takes to be written; an erasure takes seconds and is slept through. Everything else interrupts this anyway.
const LOOKS: u32 = 4000;

/// Words of an erased sector looked at in one go: 0.3 ms.
const WORDS_AT_ONCE: usize = 256;

/// Why the flash did not do what it should.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// Outside the region, or not on a boundary.
    Address(NorFlashErrorKind),
    /// The sector is protected against writing.
    Protected,
    /// The chip refused the order of operations: a flaw of this driver, or a disturbance.
    Sequence,
    /// The chip could not write or erase: worn out, or its supply is too low.
    Operation,
    /// The bank's control register does not open.
    Locked,
    /// The bank holds something else than was written or erased.
    Unchanged,
    /// An operation has not ended in many times the time it may take. Until a restart nothing in the bank is touched:
    /// the processor would wait for it.
    Hangs,
}

impl NorFlashError for Error {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Address(kind) => *kind,
            _ => NorFlashErrorKind::Other,
        }
    }
}

/// The bank.
pub struct Bank2(());

impl Bank2 {
    /// The one there is; called once.
    pub(super) const fn take() -> Self {
        Self(())
    }
}

fn bank() -> Bank {
    FLASH.bank(BANK)
}

/// Opens the bank's registers for as long as it lives.
struct Open;

impl Open {
    fn new() -> Result<Self, Error> {
        if bank().cr().read().lock() {
            for key in KEYS {
                bank().keyr().write_value(key);
            }
        }
        bank().ccr().write_value(every_flag());
        if bank().cr().read().lock() { Err(Error::Locked) } else { Ok(Self) }
    }
}

impl Drop for Open {
    fn drop(&mut self) {
        if is_busy(bank().sr().read()) {
            // It hangs: the register takes nothing before a restart.
            return;
        }
        bank().cr().modify(|w| {
            w.set_pg(false);
            w.set_ser(false);
            w.set_lock(true);
        });
    }
}

/// Clears whatever was noted.
fn every_flag() -> Ccr {
    let mut flags = Ccr(0);
    flags.set_clr_eop(true);
    flags.set_clr_wrperr(true);
    flags.set_clr_pgserr(true);
    flags.set_clr_strberr(true);
    flags.set_clr_incerr(true);
    flags.set_clr_operr(true);
    flags.set_clr_sneccerr(true);
    flags.set_clr_dbeccerr(true);
    flags
}

/// True while an operation runs, waits, or has begun to be written.
fn is_busy(status: Sr) -> bool {
    status.bsy() || status.qw() || status.wbne()
}

/// Whatever touches the bank asks this first.
fn need_idle() -> Result<(), Error> {
    if is_busy(bank().sr().read()) { Err(Error::Hangs) } else { Ok(()) }
}

/// Waits for the end of the operation, for at most this long: asked again whenever the task is polled.
async fn ended(limit_us: u32) -> Result<(), Error> {
    let begin = clock::now();
    let limit = u64::from(limit_us) * clock::TICKS_PER_US;
    poll_fn(|context| {
        // The time is taken before the flash is looked at: a task that was kept waiting blames nobody.
        let is_over = clock::now().wrapping_sub(begin) >= limit;
        for _ in 0..LOOKS {
            let status = bank().sr().read();
            if !is_busy(status) {
                return Poll::Ready(judge(status));
            }
        }
        if is_over {
            return Poll::Ready(Err(Error::Hangs));
        }
        context.waker().wake_by_ref();
        Poll::Pending
    })
    .await
}

fn judge(status: Sr) -> Result<(), Error> {
    if status.wrperr() {
        Err(Error::Protected)
    } else if status.pgserr() || status.strberr() || status.incerr() {
        Err(Error::Sequence)
    } else if status.operr() {
        Err(Error::Operation)
    } else {
        Ok(())
    }
}

/// Reads one flash word, or zeros where it is damaged.
///
/// Bus faults are ignored only by handlers above all others, so the eight reads run as one: half a microsecond in which
/// an interrupt waits. The protection unit stays on meanwhile, so they are reads of device memory: in order, each from
/// the flash, nothing ahead. `address` must be a flash word of bank 2.
fn read_word(address: u32) -> [u8; WORD_BYTES] {
    let mut parts = [0_u32; PARTS];
    // What was noted before this read must not be taken for it: `damaged` is judged by both below. Bus faults noted
    // earlier do not count any more, those that matter never return; flags of an operation were judged at its
    // end.
    bank().ccr().write_value(every_flag());
    // SAFETY: clears the bits of bus faults, see above.
    unsafe { FAULT_STATUS.write_volatile(BUS_FAULTS) };
    // SAFETY: faults of the reads below are ignored (`protection`) and noted in the status register. The mask was
    // clear: this runs in the task of lowest priority.
    unsafe { asm!("cpsid f", "dsb", "isb", options(nostack, preserves_flags)) };
    for (part, offset) in parts.iter_mut().zip((0_u32..).step_by(4)) {
        // SAFETY: inside bank 2, by the callers.
        *part = unsafe { ((address + offset) as *const u32).read_volatile() };
    }
    cortex_m::asm::dsb();
    // SAFETY: a register that only tells.
    let damaged = unsafe { FAULT_STATUS.read_volatile() } & BUS_FAULTS != 0;
    // SAFETY: undoes the mask set above.
    unsafe { asm!("cpsie f", "isb", options(nostack, preserves_flags)) };
    if damaged || bank().sr().read().dbeccerr() {
        // SAFETY: as above.
        unsafe { FAULT_STATUS.write_volatile(BUS_FAULTS) };
        bank().ccr().write_value(every_flag());
        return [0; WORD_BYTES];
    }
    let mut bytes = [0; WORD_BYTES];
    for (place, part) in bytes.chunks_exact_mut(4).zip(parts) {
        place.copy_from_slice(&part.to_le_bytes());
    }
    bytes
}

/// Reads a sector that was erased, with a rest after every so many words: others have their turn.
async fn is_blank(sector: u32) -> Result<(), Error> {
    for part in (sector..sector + SECTOR_BYTES).step_by(WORD_BYTES * WORDS_AT_ONCE) {
        for word in (part..).step_by(WORD_BYTES).take(WORDS_AT_ONCE) {
            if read_word(word) != [u8::MAX; WORD_BYTES] {
                return Err(Error::Unchanged);
            }
        }
        let mut rested = false;
        poll_fn(|context| {
            context.waker().wake_by_ref();
            if core::mem::replace(&mut rested, true) { Poll::Ready(()) } else { Poll::Pending }
        })
        .await;
    }
    Ok(())
}

/// True if a stretch lies inside the bank and on boundaries of `unit`.
fn check(offset: u32, length: usize, unit: u32) -> Result<(), Error> {
    let length = u32::try_from(length).map_err(|_| Error::Address(NorFlashErrorKind::OutOfBounds))?;
    if offset.checked_add(length).is_none_or(|end| end > STORE.length) {
        return Err(Error::Address(NorFlashErrorKind::OutOfBounds));
    }
    if !offset.is_multiple_of(unit) || !length.is_multiple_of(unit) {
        return Err(Error::Address(NorFlashErrorKind::NotAligned));
    }
    Ok(())
}

impl ErrorType for Bank2 {
    type Error = Error;
}

impl ReadNorFlash for Bank2 {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Error> {
        check(offset, bytes.len(), 1)?;
        need_idle()?;
        let mut at = offset;
        let mut rest = bytes;
        while !rest.is_empty() {
            let inside = at as usize % WORD_BYTES;
            let word = read_word(STORE.start + at - inside as u32);
            let found = word.get(inside..).unwrap_or(&[]);
            let count = found.len().min(rest.len());
            let (now, later) = rest.split_at_mut(count);
            for (place, byte) in now.iter_mut().zip(found) {
                *place = *byte;
            }
            at += count as u32;
            rest = later;
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        STORE.length as usize
    }
}

impl NorFlash for Bank2 {
    const WRITE_SIZE: usize = WORD_BYTES;
    const ERASE_SIZE: usize = SECTOR_BYTES as usize;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        check(from, to.saturating_sub(from) as usize, SECTOR_BYTES)?;
        for sector in from / SECTOR_BYTES..to / SECTOR_BYTES {
            need_idle()?;
            let open = Open::new()?;
            bank().cr().modify(|w| {
                w.set_ser(true);
                w.set_psize(PARALLELISM);
                w.set_snb(sector as u8);
            });
            bank().cr().modify(|w| w.set_start(true));
            ended(ERASE_US).await?;
            drop(open);
            is_blank(STORE.start + sector * SECTOR_BYTES).await?;
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        check(offset, bytes.len(), FLASH_WORD_BYTES)?;
        let words = bytes.chunks_exact(WORD_BYTES);
        for (word, at) in words.zip((STORE.start + offset..).step_by(WORD_BYTES)) {
            need_idle()?;
            let open = Open::new()?;
            bank().cr().modify(|w| {
                w.set_psize(PARALLELISM);
                w.set_pg(true);
            });
            cortex_m::asm::dsb();
            for (part, offset) in word.chunks_exact(4).zip((0_u32..).step_by(4)) {
                let [a, b, c, d] = part else { continue };
                let value = u32::from_le_bytes([*a, *b, *c, *d]);
                // SAFETY: inside bank 2, by the check above; the eighth part starts the write. An interrupt between two
                // parts does no harm: nobody else writes to this bank.
                unsafe { ((at + offset) as *mut u32).write_volatile(value) };
            }
            cortex_m::asm::dsb();
            ended(WRITE_US).await?;
            drop(open);
            if read_word(at).as_slice() != word {
                return Err(Error::Unchanged);
            }
        }
        Ok(())
    }
}
