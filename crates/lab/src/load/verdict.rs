//! The verdict on two measurements of one load: whether they contradict each other, and what hangs there.
//!
//! Sensor and joints know nothing of each other's errors, so what both tell is believed, and what only one tells is
//! not. They agree where they are no farther apart than [`DEVIATIONS`] standard errors and what neither knows of
//! itself, such as the sensor's gain.

use control::model::{HAND_CENTRE, HAND_MASS};

use super::{Body, Extra, Load};

/// Standard errors up to which two figures are the same.
const DEVIATIONS: f64 = 3.0;

/// Mass up to which two figures are the same, kg: gain of the sensor, scale of the torques, of a hand.
const LEAST_MASS: f64 = 0.02;

/// First moment up to which two figures are the same, kg m: the same at the grasp point.
const LEAST_MOMENT: f64 = 0.003;

/// Largest residual of the sensor's fit: force, N RMS, and torque, N m RMS. More is no body that keeps its place: it
/// slips, it touches something, or the sensor drifts.
const SENSOR_BOUND: [f64; 2] = [0.5, 0.03];

/// Largest residual of the joints' fit, N m RMS, J1 first: as for [`crate::weigh::RESIDUAL_BOUND`], less at the wrist.
const JOINT_BOUND: [f64; 7] = [0.5, 0.5, 0.5, 0.5, 0.2, 0.2, 0.2];

/// Mass by which a hand may differ from the model's and still be it, kg.
pub const HAND_MASS_TOLERANCE: f64 = 0.06;

/// Distance by which its centre may differ, m: open fingers, or closed ones, move it by 10 mm.
pub const HAND_CENTRE_TOLERANCE: f64 = 0.015;

/// Why what was measured is not believed.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Contradiction {
    /// The readings of the sensor are not those of a body that keeps its place.
    #[error(
        "the wrist sensor's readings are not those of one body: {force:.2} N and {torque:.3} N m RMS are left; what \
         hangs there moves or touches something, or the sensor drifts"
    )]
    Sensor {
        /// Force that is left, N RMS.
        force: f64,
        /// Torque that is left, N m RMS.
        torque: f64,
    },
    /// The torques of a joint are not those of a body on the wrist.
    #[error(
        "the torques of J{} are not those of a weight on the wrist: {left:.2} N m RMS are left; something else holds or \
         pulls the arm, or that drive's torque is not what it is told", .joint + 1
    )]
    Joints {
        /// The joint, 0 for J1.
        joint: usize,
        /// Torque that is left, N m RMS.
        left: f64,
    },
    /// They tell different masses.
    #[error(
        "the wrist sensor tells {sensor:+.3} kg and the joints {joints:+.3} kg beyond what was subtracted, where they may be \
         {allowed:.3} kg apart: one of them is wrong, or something hangs on the arm before the sensor"
    )]
    Mass {
        /// Mass as the sensor tells it, kg.
        sensor: f64,
        /// As the joints tell it, kg.
        joints: f64,
        /// Difference that is no contradiction, kg.
        allowed: f64,
    },
    /// They tell different first moments.
    #[error(
        "the first moments that the wrist sensor and the joints tell are {apart:.4} kg m apart along sensor axis {axis}, \
         where they may be {allowed:.4}: one of them is wrong, or something hangs on the arm before the sensor"
    )]
    Moment {
        /// Axis of the sensor: x, y or z.
        axis: char,
        /// Difference, kg m.
        apart: f64,
        /// Difference that is no contradiction, kg m.
        allowed: f64,
    },
}

/// The thing that hangs on the sensor, beside the model's hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Finding {
    /// The model's hand and nothing else.
    Hand,
    /// More than it: something is held or mounted.
    More(Body),
    /// Less than it by so much, kg: a part is missing, or it is another hand.
    Less(f64),
    /// As much, elsewhere: by this distance, m.
    Elsewhere(f64),
}

/// False beyond the bound, and for what is not a number: that agrees with nothing.
fn is_within(number: f64, bound: f64) -> bool {
    number <= bound
}

impl Extra {
    /// Tells in what the joints contradict this, which the sensor tells of the same.
    ///
    /// # Errors
    /// [`Contradiction::Mass`], [`Contradiction::Moment`]
    pub fn agree(&self, joints: &Self) -> Result<(), Contradiction> {
        let allowed = |a: f64, b: f64, least: f64| DEVIATIONS * a.hypot(b) + least;
        let apart = (self.mass - joints.mass).abs();
        let most = allowed(self.mass_error, joints.mass_error, LEAST_MASS);
        if !is_within(apart, most) {
            return Err(Contradiction::Mass { sensor: self.mass, joints: joints.mass, allowed: most });
        }
        for (axis, name) in ['x', 'y', 'z'].into_iter().enumerate() {
            let apart = (self.moment[axis] - joints.moment[axis]).abs();
            let most = allowed(self.moment_error[axis], joints.moment_error[axis], LEAST_MOMENT);
            if !is_within(apart, most) {
                return Err(Contradiction::Moment { axis: name, apart, allowed: most });
            }
        }
        Ok(())
    }
}

impl Load {
    /// Tells in what the measurement contradicts itself.
    ///
    /// # Errors
    /// [`Contradiction`], the first there is.
    pub fn judge(&self) -> Result<(), Contradiction> {
        let [force, torque] = self.sensor_left;
        if !(is_within(force, SENSOR_BOUND[0]) && is_within(torque, SENSOR_BOUND[1])) {
            return Err(Contradiction::Sensor { force, torque });
        }
        for (joint, (left, bound)) in self.joints_left.into_iter().zip(JOINT_BOUND).enumerate() {
            if !is_within(left, bound) {
                return Err(Contradiction::Joints { joint, left });
            }
        }
        self.sensor.agree(&self.joints)
    }

    /// True if the weight in use was measured with what hangs there: beyond it the joints carry nothing.
    #[must_use]
    pub fn is_carried(&self) -> bool {
        self.since_weighed.is_some_and(|since| {
            let moment = since.moment.into_iter().fold(0.0, |sum: f64, part| sum.hypot(part));
            since.mass.abs() <= HAND_MASS_TOLERANCE && moment <= HAND_MASS * HAND_CENTRE_TOLERANCE
        })
    }

    /// The thing that hangs there, as the sensor tells it.
    #[must_use]
    pub fn finding(&self) -> Finding {
        let (hanging, extra) = (self.sensor.hanging(), self.sensor.mass);
        let (_, apart) = hanging.beside(&Body { mass: HAND_MASS, centre: HAND_CENTRE });
        match self.sensor.held() {
            Some(held) => Finding::More(held),
            None if extra > HAND_MASS_TOLERANCE => {
                Finding::More(Body { mass: extra, centre: self.sensor.moment.map(|moment| moment / extra) })
            }
            None if extra < -HAND_MASS_TOLERANCE => Finding::Less(-extra),
            None if apart > HAND_CENTRE_TOLERANCE => Finding::Elsewhere(apart),
            None => Finding::Hand,
        }
    }
}
