//! The reason of the last stop, kept in memory that a restart does not clear, and told after it.
//!
//! The record lies in tightly coupled memory: no cache holds any of it back when the chip restarts. It counts only if
//! its mark is right but for a bit or two, which memory holds by chance once in ten million times after power came.
//! Words whose check sum is wrong are told as such: what is still readable of a reason is worth more than nothing.

use core::cell::UnsafeCell;
use core::fmt::{self, Write};
use core::mem::MaybeUninit;

use link::frame::CRC;

/// Bytes of words that are kept; the rest of a longer reason is lost.
const WORDS_BYTES: usize = 500;

// `write` goes over them by words of the memory.
const _: () = assert!(WORDS_BYTES.is_multiple_of(size_of::<u32>()));

/// First word of a record, so that random memory is refused before its length is believed.
const MAGIC: u32 = 0x5441_4354;

/// Bits of it that may have fallen over.
const FALLEN_BITS: u32 = 2;

#[repr(C)]
struct Record {
    magic: u32,
    length: u32,
    crc: u32,
    words: [u8; WORDS_BYTES],
}

struct Place(UnsafeCell<MaybeUninit<Record>>);

// SAFETY: read and cleared at start-up with interrupts masked, written by `write` with interrupts masked.
unsafe impl Sync for Place {}

#[unsafe(link_section = ".uninit.panic_reason")]
static PLACE: Place = Place(UnsafeCell::new(MaybeUninit::uninit()));

/// Writes text to the record, dropping what does not fit. In place: there may be little stack left.
struct Pen {
    length: usize,
}

impl Write for Pen {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        // SAFETY: see `Place`; only the bytes are touched, and every bit pattern is bytes.
        let words = unsafe { &mut (*PLACE.0.get().cast::<Record>()).words };
        for byte in text.bytes() {
            if let Some(place) = words.get_mut(self.length) {
                *place = byte;
                self.length += 1;
            }
        }
        Ok(())
    }
}

/// Keeps a reason for after the restart. Called once, with interrupts masked.
pub(super) fn write(reason: fmt::Arguments<'_>) {
    let record = PLACE.0.get().cast::<Record>();
    let mut pen = Pen { length: 0 };
    // What cannot be formatted is cut; the restart must come anyway.
    let _ = pen.write_fmt(reason);
    // SAFETY: see `Place`; the mark comes last, when the rest is true.
    unsafe {
        // Written by the byte, the last word would wait beside the memory for more, and a reset forgets it (RM0433
        // 2.4). Writing other words whole does not drive it in.
        let text = (&raw mut (*record).words).cast::<u32>();
        for index in 0..pen.length.div_ceil(size_of::<u32>()) {
            let word = text.add(index);
            word.write_volatile(word.read_volatile());
        }
        let crc = CRC.checksum((*record).words.get(..pen.length).unwrap_or(&[]));
        (&raw mut (*record).length).write_volatile(pen.length as u32);
        (&raw mut (*record).crc).write_volatile(crc);
        (&raw mut (*record).magic).write_volatile(MAGIC);
    }
    cortex_m::asm::dsb();
}

/// Tells what was kept, if anything, and forgets it. Called once, at start-up.
pub(super) fn tell() {
    let record = PLACE.0.get().cast::<Record>();
    // SAFETY: see `Place`; every bit pattern is a record, and all of its memory exists.
    let mut found = unsafe { record.read_volatile() };
    // SAFETY: as above.
    unsafe { (&raw mut (*record).magic).write_volatile(0) };
    if (found.magic ^ MAGIC).count_ones() > FALLEN_BITS {
        return;
    }
    let Some(words) = found.words.get(..found.length as usize).filter(|words| CRC.checksum(words) == found.crc) else {
        return tell_damaged(&mut found);
    };
    match core::str::from_utf8(words) {
        Ok(words) => defmt::error!("before this start: {=str}", words),
        // A reason that was cut inside a letter.
        Err(error) => {
            let whole = words.get(..error.valid_up_to()).and_then(|part| core::str::from_utf8(part).ok());
            defmt::error!("before this start: {=str}...", whole.unwrap_or(""));
        }
    }
}

/// Tells the words of a record in which bits have fallen over, as far as they are letters.
#[cold]
#[inline(never)]
fn tell_damaged(found: &mut Record) {
    let length = (found.length as usize).min(WORDS_BYTES);
    let words = found.words.get_mut(..length).unwrap_or_default();
    for byte in words.iter_mut().filter(|byte| !(b' '..=b'~').contains(*byte)) {
        *byte = b'?';
    }
    let words = core::str::from_utf8(words).unwrap_or("");
    defmt::error!("before this start, not as it was written: {=str}", words);
}
