//! The 8 MHz from the ST-LINK, which every rate follows: waited for before the clock tree is set up, watched
//! afterwards.
//!
//! The chip's own oscillator is not exact enough for the bus, so without the 8 MHz there is nothing this board may do:
//! it blinks, keeps the reason and starts again (`docs/decisions/0027-without-a-clock-no-bus.md`).

use cortex_m_rt::exception;
use embassy_stm32::pac::RCC;

use super::super::constants::clocks::{HSE_BLINK_US, HSE_BLINKS, HSE_SOON_US};
use super::SelectedBoard;
use super::{clock, light};
use crate::board::panic_stop;

/// Switches the input on and waits for it; does not return without it. The clock counts already.
pub(super) fn wait() {
    RCC.cr().modify(|w| w.set_hsebyp(true));
    RCC.cr().modify(|w| w.set_hseon(true));
    let ready = || RCC.cr().read().hserdy();
    if clock::within_early(HSE_SOON_US, ready) {
        return;
    }
    light::before_all(true);
    for turn in 0..HSE_BLINKS {
        if clock::within_early(HSE_BLINK_US, ready) {
            light::before_all(false);
            return;
        }
        light::before_all(turn % 2 == 1);
    }
    panic_stop::stop::<SelectedBoard>(format_args!("no 8 MHz from the ST-LINK: the bus was not touched"));
}

/// From here on its failure is a non-maskable interrupt. The clock tree runs.
pub(super) fn watch() {
    RCC.cr().modify(|w| w.set_hsecsson(true));
}

/// The 8 MHz have failed: the chip has gone over to its own oscillator, and the bus has no clock any more. Anything
/// else that ends here was asked for by a debug probe.
#[exception]
unsafe fn NonMaskableInt() -> ! {
    if RCC.cifr().read().hsecssf() {
        RCC.cicr().write(|w| w.set_hsecssc(true));
        panic_stop::stop::<SelectedBoard>(format_args!("the 8 MHz from the ST-LINK have stopped"));
    }
    panic_stop::stop::<SelectedBoard>(format_args!(
        "a non-maskable interrupt without a cause of the chip: asked for by a debug probe"
    ));
}
