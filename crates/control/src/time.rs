//! The control rate, the one source of time: durations are written in seconds and converted to control periods here,
//! when the code is compiled.

/// Control rate (Hz). Everything that counts control periods, here and in the other crates, follows from it. A higher
/// rate has to leave room on the bus for requests, replies and torques within each period.
pub const RATE_HZ: u32 = 300;

/// Control rate (Hz), for arithmetic.
pub const RATE: f64 = RATE_HZ as f64;

/// Control period (s).
pub const PERIOD: f64 = 1.0 / RATE;

/// Returns the control periods of a duration (s), to the nearest; at most 65 535.
pub const fn periods(seconds: f64) -> u16 {
    (seconds * RATE + 0.5) as u16
}

/// Returns the control periods of a short duration (s), to the nearest; at most 255.
pub const fn few_periods(seconds: f64) -> u8 {
    (seconds * RATE + 0.5) as u8
}
