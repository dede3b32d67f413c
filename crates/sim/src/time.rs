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

/// One physics step. Six fit one control cycle of 300 Hz exactly; with another rate a response is seen up to one step
/// late.
pub const STEP_TICKS: Ticks = 13_889;

/// One physics step in seconds (0.555 56 ms).
pub const STEP_SECONDS: f64 = STEP_TICKS as f64 / TICKS_PER_SECOND as f64;

/// Returns the ticks of one period of a frequency (Hz), to the nearest.
#[must_use]
pub const fn period_ticks(hertz: u32) -> Ticks {
    (TICKS_PER_SECOND + hertz as Ticks / 2) / hertz as Ticks
}

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
