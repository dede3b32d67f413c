//! The chip's unique number in hexadecimal.

use core::cell::UnsafeCell;

/// The 96 bits the maker wrote into every chip.
const UNIQUE: *const u32 = 0x1FF1_E800 as *const u32;

/// Digits of the number.
const DIGITS: usize = 24;

struct Text(UnsafeCell<[u8; DIGITS]>);

// SAFETY: written once, by `read` at start-up with interrupts masked; only read afterwards.
unsafe impl Sync for Text {}

static TEXT: Text = Text(UnsafeCell::new([b'0'; DIGITS]));

/// The number as text. Called once, at start-up.
pub(super) fn read() -> &'static str {
    // SAFETY: see `Text`; nobody holds a reference yet.
    let text = unsafe { &mut *TEXT.0.get() };
    for (index, places) in text.chunks_exact_mut(8).enumerate() {
        // SAFETY: three words of system memory, readable on every chip of this kind.
        let mut word = unsafe { UNIQUE.add(index).read_volatile() };
        for place in places.iter_mut().rev() {
            let digit = (word & 0xF) as u8;
            *place = if digit < 10 { b'0' + digit } else { b'a' + digit - 10 };
            word >>= 4;
        }
    }
    core::str::from_utf8(text).unwrap_or("unknown")
}
