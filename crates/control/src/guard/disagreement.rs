//! `Disagreement`: torque and motion that do not fit together, without the help of the force sensor.
//!
//! Two things are seen in the torque that the joint feedback asks for. It swings by more than friction can hold back
//! while an encoder does not change by a count: that encoder stands still (A8). And it is several times the friction:
//! somebody or something pushes, which nobody else sees while the force sensor is silent (G8).

use puck::Transmission;

use crate::model::wam7;
use crate::real::{Real, at_least};
use crate::time::few_periods;
use crate::units::{JOINTS, Vector7};

/// Swing of a motor's feedback torque without a count, in parts of the model's friction. Friction that is 30 % more
/// holds 2.6 of it, from one direction to the other.
const SWING: f64 = 3.0;

/// Desired speed of a motor from which on it has to turn (rad/s): 0.02 to 0.06 rad/s of the joint. A motor that is to
/// stand may be held by contact, whatever its torque does: closing fingers and a table swing it by more than friction.
const MOVING: f64 = 1.0;

/// Force (N) that explains why a motor does not turn.
const CONTACT: f64 = 10.0;

/// Time without a count, before a swing means anything: 50 ms, in control periods.
const STILL: u8 = few_periods(0.05);

/// Feedback torque of a joint that means a push, in parts of the model's friction: nominal motions stay below 2.5.
const PUSH: f64 = 3.5;

/// Time for which it has to push: 10 ms, in control periods.
const PUSHING: u8 = few_periods(0.01);

/// Compares the feedback torque with the motion.
#[derive(Clone, Debug)]
pub(crate) struct Disagreement<R: Real> {
    transmission: Transmission<R>,
    /// Largest swing of each motor (N m at the motor).
    swing: [R; JOINTS],
    /// Feedback torque of each motor at its last count (N m).
    anchor: [R; JOINTS],
    /// Control periods since.
    still: [u8; JOINTS],
    pushing: u8,
}

impl<R: Real> Disagreement<R> {
    /// Nothing seen yet, on an arm with this transmission.
    pub(crate) fn new(transmission: Transmission<R>) -> Self {
        let zero = R::of(0.0);
        let mut swing = [zero; JOINTS];
        for (joint, friction) in wam7::FRICTION_COULOMB.into_iter().enumerate() {
            let torque = core::array::from_fn(|of| if of == joint { R::of(SWING * friction) } else { zero });
            for (swing, part) in swing.iter_mut().zip(transmission.motor_torques_from_joint(&torque)) {
                *swing += at_least(part, -part);
            }
        }
        Disagreement { transmission, swing, anchor: [zero; JOINTS], still: [0; JOINTS], pushing: 0 }
    }

    /// Forgets what was seen: no feedback acts.
    pub(crate) fn reset(&mut self) {
        self.still = [0; JOINTS];
        self.pushing = 0;
    }

    /// Every motor has turned.
    pub(crate) fn all_turn(&mut self) {
        self.still = [0; JOINTS];
    }

    /// Takes the feedback torque (N m), the desired velocities (rad/s), the measured force (N) and the motors whose
    /// counts have not changed, one bit each; true if an encoder stands still while its motor cannot.
    ///
    /// Not inlined: it is asked where a motor stands.
    #[inline(never)]
    pub(crate) fn encoder_stands_still(
        &mut self,
        (feedback, desired): (&Vector7<R>, &Vector7<R>),
        force: R,
        unchanged: u8,
    ) -> bool {
        if force > R::of(CONTACT) {
            self.still = [0; JOINTS];
            return false;
        }
        let torques = self.transmission.motor_torques_from_joint(&(*feedback).into());
        let speeds = self.transmission.motor_from_joint(&(*desired).into());
        let mut stuck = false;
        let motors = self.still.iter_mut().zip(&mut self.anchor).zip(&self.swing).zip(torques).zip(speeds).enumerate();
        for (motor, ((((still, anchor), limit), torque), speed)) in motors {
            if unchanged >> motor & 1 == 0 || at_least(speed, -speed) < R::of(MOVING) {
                *still = 0;
                continue;
            }
            if *still == 0 {
                *anchor = torque;
            }
            *still = still.saturating_add(1);
            let swing = torque - *anchor;
            stuck |= *still > STILL && at_least(swing, -swing) > *limit;
        }
        stuck
    }

    /// True if the feedback torque (N m) has been that of a push for 10 ms. Not inlined: it is asked while the sensor
    /// is silent.
    #[inline(never)]
    pub(crate) fn is_pushed(&mut self, feedback: &Vector7<R>) -> bool {
        let beyond = feedback.iter().zip(wam7::FRICTION_COULOMB).any(|(torque, friction)| {
            let bar = R::of(PUSH * friction);
            *torque > bar || *torque < -bar
        });
        self.pushing = if beyond { self.pushing.saturating_add(1) } else { 0 };
        self.pushing >= PUSHING
    }
}
