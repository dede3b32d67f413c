//! Virtual time: the free-running 25 MHz counter, extended to 64 bits.

use core::cell::Cell;

use critical_section::Mutex;

use super::device::{COUNTER, PERIPHERAL_HZ, PRESCALE};

/// Last extended reading. The counter wraps after 171 s; every slot reads the clock, so no wrap is missed.
static LAST: Mutex<Cell<u64>> = Mutex::new(Cell::new(0));

/// Time since start-up in ticks of 40 ns.
#[derive(Clone, Copy)]
pub struct Clock;

impl crate::board::Clock for Clock {
    const HZ: u32 = PERIPHERAL_HZ;
    // QEMU counts 8 ns per instruction (`-icount shift=3`), a tick has 40 ns.
    const INSTRUCTIONS_PER_TICK: u8 = 5;

    fn ticks(self) -> u64 {
        now()
    }

    fn short_ticks(self) -> u32 {
        COUNTER.read()
    }
}

/// Lets the counter count every tick of the peripheral clock.
pub(super) fn start() {
    PRESCALE.write(0);
}

/// Ticks since start-up.
pub(super) fn now() -> u64 {
    critical_section::with(|section| {
        let last = LAST.borrow(section);
        let step = COUNTER.read().wrapping_sub(last.get() as u32);
        let now = last.get() + u64::from(step);
        last.set(now);
        now
    })
}

/// Lets QEMU account for every instruction executed so far.
#[cfg(feature = "wfi")]
#[inline(always)]
pub(super) fn synchronise() {
    COUNTER.read();
}
