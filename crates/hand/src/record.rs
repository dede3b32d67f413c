//! `Record`: what one control cycle measured and decided, in fixed point. The session makes telemetry of it.

use control::{Fault, State};

use crate::number::{Number, ZERO};
use crate::{DIGITS, FINGERS};

/// One cycle. Digits: spread, F1, F2, F3.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record {
    /// Number of the cycle.
    pub cycle: u32,
    /// State after it.
    pub state: State,
    /// Latched fault.
    pub fault: Fault,
    /// Bits of [`control::flags`].
    pub flags: u32,
    /// Phase of the movement; 0 outside a run.
    pub phase: Number,
    /// Measured angles (rad).
    pub q: [Number; DIGITS],
    /// Desired angles (rad); the measured ones where nothing is desired.
    pub q_d: [Number; DIGITS],
    /// Torques sent (N m at inner links and spread).
    pub torque: [Number; DIGITS],
    /// Torque of the environment on the fingers (N m).
    pub gauges: [Number; FINGERS],
    /// Digits whose reply did not come.
    pub lost: u8,
}

impl Record {
    /// A record of nothing.
    pub const EMPTY: Record = Record {
        cycle: 0,
        state: State::Idle,
        fault: Fault::None,
        flags: 0,
        phase: ZERO,
        q: [ZERO; DIGITS],
        q_d: [ZERO; DIGITS],
        torque: [ZERO; DIGITS],
        gauges: [ZERO; FINGERS],
        lost: 0,
    };
}

/// A record with what only its caller can measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimedRecord {
    /// The record.
    pub record: Record,
    /// How long the cycle took, ticks of the board's clock.
    pub cost_ticks: u32,
}
