//! The 8 MHz from the ST-LINK, which every rate follows: waited for before the clock tree is set up, watched
//! afterwards.
//!
//! The chip's own oscillator is not exact enough for the bus, so without the 8 MHz there is nothing this board may do:
//! it blinks, keeps the reason and starts again (`docs/decisions/0027-without-a-clock-no-bus.md`). One thing is done
//! before: motors that may hold a torque of the image before are told to let go
//! (`docs/decisions/0029-four-frames-without-a-clock.md`).

use cortex_m_rt::exception;
use embassy_stm32::pac::RCC;
use puck::stop_frames;

use super::super::constants::clocks::{HSE_BLINK_US, HSE_BLINKS, HSE_LATE_US, HSE_SOON_US};
use super::SelectedBoard;
use super::reset::{self, Phase};
use super::{clock, light, own_oscillator};
use crate::board::panic_stop;

/// Switches the input on and waits for it; does not return without it. The clock counts already. `from_service` tells
/// that a motor may hold a torque.
pub(super) fn wait(from_service: bool) {
    RCC.cr().modify(|w| w.set_hsebyp(true));
    RCC.cr().modify(|w| w.set_hseon(true));
    let ready = || RCC.cr().read().hserdy();
    if clock::within_early(HSE_SOON_US, ready) {
        return;
    }
    if from_service && clock::within_early(HSE_LATE_US, ready) {
        return;
    }
    if from_service {
        own_oscillator::send(&stop_frames());
    }
    // Not before: after a reset while they leave they are sent again.
    reset::enter(Phase::Waiting);
    if from_service {
        reset::restart();
    }
    light::before_all(true);
    for turn in 0..HSE_BLINKS {
        if clock::within_early(HSE_BLINK_US, ready) {
            light::before_all(false);
            reset::enter(Phase::Clocks);
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
