//! The independent watchdog: resets the chip when no slot has begun for 10 ms. It has an oscillator of its own, and
//! once started nothing but a reset stops it.
//!
//! It starts with the image, with the widest window it has, so that a start-up that hangs ends as well; [`narrow`]
//! takes the window of the service just before the first slot.
//!
//! It goes on while a debugger halts the core: the pucks would hold the last torque for as long as somebody looks at a
//! variable. A halt therefore ends in a reset, with the arm at rest. A debugger may have told the chip to let it
//! stand still in a halt. That outlives every reset but that of the supply, so it is taken back here, and watched
//! (`settings`).

use embassy_stm32::pac::iwdg::vals::{Key, Pr};
use embassy_stm32::pac::{DBGMCU, IWDG1};

use super::super::constants::chip_settings::STANDS_IN_A_HALT;
use super::super::constants::timers::{WATCHDOG_PRESCALER, WATCHDOG_START_TICKS, WATCHDOG_TICKS, WATCHDOG_UPDATE_US};
use super::SelectedBoard;
use super::clock;
use crate::board::panic_stop;

/// Key that opens the registers.
const OPEN: u16 = 0x5555;
/// Key that starts the counter again from its reload value.
const FEED: u16 = 0xAAAA;
/// Key that starts the watchdog.
const START: u16 = 0xCCCC;

// What the registers hold after a reset, and `start` therefore does not write.
const _: () = assert!(WATCHDOG_PRESCALER == 4 && WATCHDOG_START_TICKS == 0xFFF + 1);

/// Starts it with the window of the start-up.
pub(super) fn start() {
    DBGMCU.apb4fzr1().modify(|w| w.0 &= !STANDS_IN_A_HALT);
    key(START);
}

/// Takes the window of the service, and starts it.
pub(super) fn narrow() {
    key(OPEN);
    IWDG1.rlr().write(|w| w.set_rl((WATCHDOG_TICKS - 1) as u16));
    // The value has to pass to the oscillator's side. Whoever feeds before it has arrived gets the old window.
    let taken = clock::within(WATCHDOG_UPDATE_US, || {
        let pending = IWDG1.sr().read();
        !(pending.pvu() || pending.rvu())
    });
    // No flag rises either if the write was lost, and then the arm would have the window of the start-up.
    let window = (IWDG1.pr().read().pr(), IWDG1.rlr().read().rl());
    if !taken || window != (Pr::DIVIDE_BY4, (WATCHDOG_TICKS - 1) as u16) {
        panic_stop::stop::<SelectedBoard>(format_args!(
            "the watchdog does not take its window: no arm without a watchdog"
        ));
    }
    key(FEED);
}

/// A slot has begun.
pub(super) fn feed() {
    key(FEED);
}

fn key(value: u16) {
    IWDG1.kr().write(|w| w.set_key(Key::from_bits(value)));
}
