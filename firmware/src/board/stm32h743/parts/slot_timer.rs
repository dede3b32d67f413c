//! Timer 2: the slots of the control cycle, and with it the watchdog: in service it is fed where a slot begins, and
//! nowhere else.

use embassy_stm32::pac::timer::regs::SrGp16;
use embassy_stm32::pac::{RCC, TIM2};

use super::super::constants::clocks::TIMER_HZ;
use super::super::constants::timers::{CLOCK_HZ, SLOT_PRESCALER, SLOT_TICKS};
use super::reset::{self, Phase};
use super::watchdog;

// Latency is told in ticks of the clock: both timers count the same ones.
const _: () = assert!(CLOCK_HZ == TIMER_HZ && SLOT_PRESCALER == 1);

/// The timer that makes slots.
pub struct SlotTimer;

impl crate::board::SlotTimer for SlotTimer {
    fn start(&mut self) {
        // First: it takes most of a millisecond, for which no slot may wait.
        watchdog::narrow();
        reset::enter(Phase::Service);
        RCC.apb1lenr().modify(|w| w.set_tim2en(true));
        RCC.apb1lenr().read();
        TIM2.psc().write_value((SLOT_PRESCALER - 1) as u16);
        TIM2.arr().write_value(SLOT_TICKS - 1);
        TIM2.egr().write(|w| w.set_ug(true));
        // The update that took the values over is not a slot.
        take_back();
        TIM2.dier().modify(|w| w.set_uie(true));
        TIM2.cr1().modify(|w| w.set_cen(true));
    }

    fn acknowledge(&mut self) -> u32 {
        take_back();
        // The slot task is entered again only after it has returned, so a task that hangs starves the watchdog.
        watchdog::feed();
        // The counter started again from 0 when the slot began.
        TIM2.cnt().read()
    }

    fn is_due(&self) -> bool {
        TIM2.sr().read().uif()
    }
}

/// Clears the flag behind the interrupt.
fn take_back() {
    // A zero clears, ones leave the other flags alone.
    let mut flags = SrGp16(u32::MAX);
    flags.set_uif(false);
    TIM2.sr().write_value(flags);
}
