//! Time since start-up: timer 5, free-running at 200 MHz, extended to 64 bits.

use core::cell::Cell;

use critical_section::Mutex;
use embassy_stm32::pac::{RCC, TIM5};

use super::super::constants::clocks::HSI_HZ;
use super::super::constants::timers::CLOCK_HZ;

/// Last extended reading. The counter wraps after 21 s; every slot reads the clock, so no wrap is missed.
static LAST: Mutex<Cell<u64>> = Mutex::new(Cell::new(0));

/// Ticks of a microsecond; whole, so that no fraction is lost.
pub(super) const TICKS_PER_US: u64 = CLOCK_HZ as u64 / 1_000_000;

/// Time since start-up in ticks of 5 ns.
#[derive(Clone, Copy)]
pub struct Clock;

impl crate::board::Clock for Clock {
    const HZ: u32 = CLOCK_HZ;

    fn ticks(self) -> u64 {
        now()
    }

    fn short_ticks(self) -> u32 {
        TIM5.cnt().read()
    }

    fn now_us(self) -> u64 {
        now() / TICKS_PER_US
    }
}

/// Lets the counter count every tick of the timer clock, from 0. Called once before the clock tree is set up, so that
/// there is a time to wait by, and once afterwards.
pub(super) fn start() {
    RCC.apb1lenr().modify(|w| w.set_tim5en(true));
    // A clock that was just enabled reaches the peripheral two bus cycles later; reading back waits for that.
    RCC.apb1lenr().read();
    TIM5.psc().write_value(0);
    TIM5.arr().write_value(u32::MAX);
    // Takes the divider over now instead of at the first wrap.
    TIM5.egr().write(|w| w.set_ug(true));
    TIM5.cr1().modify(|w| w.set_cen(true));
}

/// Ticks since start-up.
pub(super) fn now() -> u64 {
    critical_section::with(|section| {
        let last = LAST.borrow(section);
        let step = TIM5.cnt().read().wrapping_sub(last.get() as u32);
        let now = last.get() + u64::from(step);
        last.set(now);
        now
    })
}

/// Asks until it is so, for at most this long; tells whether it was. Works with interrupts masked, once [`start`] has
/// run. It ends as well where the counter stands still: a question takes longer than a tick, so there are no more
/// questions than ticks.
pub(super) fn within(us: u32, is_so: impl FnMut() -> bool) -> bool {
    within_ticks(us * (TICKS_PER_US as u32), is_so)
}

/// The same before the clock tree is set up, when the counter runs from the chip's own oscillator.
pub(super) fn within_early(us: u32, is_so: impl FnMut() -> bool) -> bool {
    within_ticks(us * (HSI_HZ / 1_000_000), is_so)
}

fn within_ticks(limit: u32, mut is_so: impl FnMut() -> bool) -> bool {
    let begin = TIM5.cnt().read();
    for _ in 0..=limit {
        if is_so() {
            return true;
        }
        if TIM5.cnt().read().wrapping_sub(begin) >= limit {
            break;
        }
    }
    false
}
