//! Virtual time: one clock for the bus, the world and the co-controller.
//!
//! The unit is one period of the 25 MHz timer of QEMU's mps2 board, 40 ns, so that the firmware's
//! timer and the simulator count the same thing and no rounding stands between them. One CAN bit at
//! 1 Mbit/s is exactly 25 ticks. A `u64` of ticks lasts 23 000 years.

/// A point in virtual time or a duration, in ticks of 40 ns (25 MHz), since power-up of the arm's supply.
pub type Ticks = u64;

/// Ticks in one second.
pub const TICKS_PER_SECOND: Ticks = 25_000_000;

/// Ticks in one microsecond.
pub const TICKS_PER_MICROSECOND: Ticks = 25;

/// Ticks in one millisecond.
pub const TICKS_PER_MILLISECOND: Ticks = 25_000;

/// One bit on the wire at 1 Mbit/s (docs/barrett-can.md).
pub const TICKS_PER_BIT: Ticks = 25;

/// One slot of the 900 Hz schedule, rounded to ticks (25 MHz / 900 Hz = 27 777.8); three make a 300 Hz control cycle.
pub const SLOT_TICKS: Ticks = 27_778;

/// One control cycle: three slots.
pub const CYCLE_TICKS: Ticks = 3 * SLOT_TICKS;

/// One physics step: half a slot, so that six steps fit one control cycle exactly.
pub const STEP_TICKS: Ticks = SLOT_TICKS / 2;

/// One physics step in seconds (0.555 56 ms).
pub const STEP_SECONDS: f64 = STEP_TICKS as f64 / TICKS_PER_SECOND as f64;

/// A duration in seconds, from ticks.
#[must_use]
pub fn seconds(ticks: Ticks) -> f64 {
    ticks as f64 / TICKS_PER_SECOND as f64
}

/// Ticks from a duration in seconds, rounded to the nearest tick; negative or non-finite durations give 0.
#[must_use]
pub fn ticks(seconds: f64) -> Ticks {
    // A float-to-integer cast saturates and sends NaN to 0, which is what the sentence above promises.
    (seconds * TICKS_PER_SECOND as f64 + 0.5) as Ticks
}
