//! What one cycle sends to the motors: the two packed-torque frames, or nothing.
//!
//! The only place where torques become frames, and it takes nothing but [`LimitedTorques`]. Rounding to counts is the
//! manufacturer's, downwards.

use puck::{CanFrame, Group, PropertyId, PuckTorque, packed_torques};

use crate::calibration::Calibration;
use crate::limit::LimitedTorques;
use crate::real::Real;

/// The frames of one cycle. Only this module makes one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Actuation {
    frames: Option<[CanFrame; 2]>,
    requests_idle: bool,
}

impl Actuation {
    /// Sends nothing.
    pub(crate) const fn silent() -> Actuation {
        Actuation { frames: None, requests_idle: false }
    }

    /// Sends zero torque: a puck keeps its last torque until another one comes.
    pub(crate) fn zero() -> Actuation {
        Actuation { frames: Some(frames([PuckTorque::ZERO; 7])), requests_idle: false }
    }

    /// Sends these torques.
    pub(crate) fn torque<R: Real>(torques: &LimitedTorques<R>, calibration: &Calibration<R>) -> Actuation {
        let joints = torques.torques().0.into();
        let motors = calibration.transmission.motor_torques_from_joint(&joints);
        // The limiter lets nothing through that is not finite; should it ever, zero torque is what remains.
        let counts = calibration.drives.torques(&motors).unwrap_or([PuckTorque::ZERO; 7]);
        Actuation { frames: Some(frames(counts)), requests_idle: false }
    }

    /// The same, with the wish that the safety module goes to IDLE.
    pub(crate) const fn requesting_idle(self) -> Actuation {
        Actuation { frames: self.frames, requests_idle: true }
    }

    /// The torque frames of M1..M4 and M5..M7, to be sent in this order in the same cycle; `None` sends nothing.
    pub fn frames(&self) -> Option<[CanFrame; 2]> {
        self.frames
    }

    /// Whether the safety module should be asked to go to IDLE (after a fault).
    pub fn requests_idle(&self) -> bool {
        self.requests_idle
    }
}

fn frames([m1, m2, m3, m4, m5, m6, m7]: [PuckTorque; 7]) -> [CanFrame; 2] {
    [
        packed_torques(Group::ARM_TORQUES, PropertyId::TORQUE, [m1, m2, m3, m4]),
        packed_torques(Group::WRIST_TORQUES, PropertyId::TORQUE, [m5, m6, m7, PuckTorque::ZERO]),
    ]
}
