//! Timer 0: the slots of the control cycle.

use device::time::{CYCLE_SLOTS, SLOT_HZ};

use super::clock;
use super::device::{PERIPHERAL_HZ, TIMER0, Timer};

/// Ticks of one slot, rounded to the nearest: 27 778 at 900 Hz, so a control cycle takes 83 334 ticks = 3.333 36 ms
/// (299.998 Hz).
const PERIOD: u32 = (PERIPHERAL_HZ + SLOT_HZ / 2) / SLOT_HZ;

/// The first slot comes this many periods after reset, or whole cycles later: however long start-up takes, the slots of
/// two images lie on one grid, the same as those of the simulator's own device (`docs/lockstep.md`).
const FIRST_SLOT: u64 = 10;

/// The timer that makes slots.
pub struct SlotTimer;

impl crate::board::SlotTimer for SlotTimer {
    fn start(&mut self) {
        TIMER0.control.write(Timer::STOP);
        TIMER0.reload.write(PERIOD - 1);
        TIMER0.interrupt.write(1);
        let (period, now) = (u64::from(PERIOD), clock::now());
        let mut first = FIRST_SLOT * period;
        while first < now + period {
            first += u64::from(CYCLE_SLOTS) * period;
        }
        // Less than two cycles: it fits.
        TIMER0.value.write((first - now - 1) as u32);
        TIMER0.control.write(Timer::RUN);
    }

    fn acknowledge(&mut self) -> u32 {
        TIMER0.interrupt.write(1);
        // The counter started again from PERIOD - 1 when the slot began.
        (PERIOD - 1).saturating_sub(TIMER0.value.read())
    }

    fn is_due(&self) -> bool {
        TIMER0.interrupt.read() & 1 != 0
    }
}
