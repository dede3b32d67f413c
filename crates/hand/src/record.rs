//! `Record`: what one control cycle measured and decided, in fixed point. The session makes telemetry of it.

use control::{Fault, State};
use device::CycleReport;
use link::Telemetry;

use crate::number::{Number, ZERO, real};
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

impl CycleReport for Record {
    fn number(&self) -> u32 {
        self.cycle
    }

    fn state(&self) -> State {
        self.state
    }

    fn flags(&self) -> u32 {
        self.flags
    }

    /// The hand's torques stand in the first four places of `tau`: spread, F1, F2, F3; the arm's fields are 0.
    fn telemetry(&self) -> Telemetry {
        let [spread, f1, f2, f3] = self.torque.map(real);
        Telemetry {
            cycle: self.cycle,
            state: self.state.code(),
            fault: self.fault.code(),
            flags: self.flags,
            phase: real(self.phase),
            tau: [spread, f1, f2, f3, 0.0, 0.0, 0.0],
            pose_d: [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
            lost_replies: self.lost,
            hand: self.q.map(real),
            hand_d: self.q_d.map(real),
            gauges: self.gauges.map(real),
            ..Telemetry::default()
        }
    }
}
