//! The independent watchdog: resets the chip when no slot has begun for 10 ms. It has an oscillator of its own, and once
//! started nothing but a reset stops it.
//!
//! It goes on while a debugger halts the core: the pucks would hold the last torque for as long as somebody looks at a
//! variable. A halt therefore ends in a reset, with the arm at rest.

use embassy_stm32::pac::IWDG1;

use super::super::constants::timers::{WATCHDOG_PRESCALER, WATCHDOG_TICKS};

/// Key that opens the registers.
const OPEN: u16 = 0x5555;
/// Key that starts the counter again from its reload value.
const FEED: u16 = 0xAAAA;
/// Key that starts the watchdog.
const START: u16 = 0xCCCC;

// Register value 0 divides by 4.
const _: () = assert!(WATCHDOG_PRESCALER == 4);

/// Starts it. From here on it wants to be fed.
pub(super) fn start() {
    key(START);
    key(OPEN);
    IWDG1.pr().write(|w| w.set_pr(embassy_stm32::pac::iwdg::vals::Pr::DIVIDE_BY4));
    IWDG1.rlr().write(|w| w.set_rl((WATCHDOG_TICKS - 1) as u16));
    key(FEED);
}

/// A slot has begun.
pub(super) fn feed() {
    key(FEED);
}

fn key(value: u16) {
    IWDG1.kr().write(|w| w.set_key(embassy_stm32::pac::iwdg::vals::Key::from_bits(value)));
}
