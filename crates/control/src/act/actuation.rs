//! The frames of one cycle to the motors: two packed-torque frames for the arm and one for the hand, or nothing.
//!
//! The only place where torques become frames, and it takes nothing but [`LimitedTorques`] and [`LimitedHandTorques`].
//! Rounding to counts is the manufacturer's, downwards.

use puck::hand::{INNER_LINK_RATIO, SPREAD_RATIO};
use puck::{CanFrame, Group, PropertyId, PuckTorque, packed_torques};

use crate::act::hand::LimitedHandTorques;
use crate::act::limit::LimitedTorques;
use crate::model::calibration::Calibration;
use crate::model::hand::{DIGITS, EFFICIENCY, to_pucks};
use crate::real::Real;

/// Motor revolutions per revolution of each digit, in the order of the pucks.
const RATIOS: [f64; DIGITS] = [INNER_LINK_RATIO, INNER_LINK_RATIO, INNER_LINK_RATIO, SPREAD_RATIO];

/// The frames of one cycle. Only this module makes one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Actuation {
    frames: Option<[CanFrame; 2]>,
    hand_frame: Option<CanFrame>,
    requests_idle: bool,
}

impl Actuation {
    /// Sends nothing.
    pub(crate) const fn silent() -> Actuation {
        Actuation { frames: None, hand_frame: None, requests_idle: false }
    }

    /// Sends zero torque: a puck keeps its last torque until another one comes.
    pub(crate) fn zero() -> Actuation {
        Actuation { frames: Some(frames([PuckTorque::ZERO; 7])), hand_frame: None, requests_idle: false }
    }

    /// Sends these torques.
    pub(crate) fn torque<R: Real>(torques: &LimitedTorques<R>, calibration: &Calibration<R>) -> Actuation {
        let joints = torques.torques().0.into();
        let motors = calibration.transmission.motor_torques_from_joint(&joints);
        // The limiter lets nothing through that is not finite; should it ever, zero torque is what remains.
        let counts = calibration.drives.torques(&motors).unwrap_or([PuckTorque::ZERO; 7]);
        Actuation { frames: Some(frames(counts)), hand_frame: None, requests_idle: false }
    }

    /// The same, with torques for the hand: through worms that give [`EFFICIENCY`] of what their gears would.
    pub(crate) fn with_hand<R: Real>(self, torques: &LimitedHandTorques<R>, calibration: &Calibration<R>) -> Actuation {
        let scales = to_pucks(EFFICIENCY).into_iter().zip(RATIOS).zip(&calibration.hand_units_per_newton_metre);
        let mut units = [PuckTorque::ZERO; DIGITS];
        for ((units, torque), ((efficiency, ratio), ipnm)) in
            units.iter_mut().zip(to_pucks(*torques.torques())).zip(scales)
        {
            let scale = R::constant(1.0 / (efficiency * ratio)) * R::from_counts(*ipnm);
            // As for the arm: zero, should a torque ever not be finite.
            *units = PuckTorque::from_units(torque * scale).unwrap_or(PuckTorque::ZERO);
        }
        Actuation { hand_frame: Some(packed_torques(Group::HAND, PropertyId::TORQUE, units)), ..self }
    }

    /// The same, with the wish that the safety module goes to IDLE.
    pub(crate) const fn requesting_idle(self) -> Actuation {
        Actuation { frames: self.frames, hand_frame: self.hand_frame, requests_idle: true }
    }

    /// The torque frames of M1..M4 and M5..M7, to be sent in this order in the same cycle; `None` sends nothing.
    pub fn frames(&self) -> Option<[CanFrame; 2]> {
        self.frames
    }

    /// The packed torque frame of the hand (0x405), to be sent after the arm's; `None` where the hand is not driven and
    /// its worm drives hold.
    pub fn hand_frame(&self) -> Option<CanFrame> {
        self.hand_frame
    }

    /// True if the safety module should be asked to go to IDLE (after a fault).
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
