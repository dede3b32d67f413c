//! `JointController`: inverse dynamics with joint feedback.
//!
//! Eq (10): `tau = M ddq_d + h + K_p (q_d - q) + K_d (dq_d - dq)`, with `M` including the rotors and `h` Coriolis,
//! centrifugal and gravity torque at the measured state. Friction is fed forward along the *planned* velocity: along
//! the measured one, or one that contains a measured error, it would be feedback of a large gain. External forces are
//! deliberately absent, Eq (12) deals with them.

use crate::law::gains::Tracking;
use crate::model::arm::ArmModel;
use crate::model::kinematics::Frames;
use crate::plan::reference::JointReference;
use crate::real::Real;
use crate::sense::joints::JointState;
use crate::units::{JointTorques, JointVelocities, Vector7};

/// Eq (10).
#[derive(Clone, Debug)]
pub struct JointController<R: Real> {
    /// Feedback torque of the last good cycle (N m).
    feedback: Vector7<R>,
    /// Desired velocity of the same cycle (rad/s).
    desired: Vector7<R>,
    /// Feedback torque as measured motion alone asks for it, of the same cycle (N m).
    measured: Vector7<R>,
    /// Friction fed forward in the same cycle (N m).
    friction: Vector7<R>,
    friction_speed: R,
}

impl<R: Real> JointController<R> {
    /// A controller without history. `friction_speed` is the planned speed at which half of the Coulomb friction is fed
    /// forward (rad/s): it smooths the sign, so that a plan at rest does not chatter.
    pub fn new(friction_speed: R) -> Self {
        JointController {
            feedback: Vector7::zeros(),
            desired: Vector7::zeros(),
            measured: Vector7::zeros(),
            friction: Vector7::zeros(),
            friction_speed,
        }
    }

    /// The feedback torque of the last good cycle (N m).
    pub fn feedback(&self) -> &Vector7<R> {
        &self.feedback
    }

    /// The desired velocity of the last good cycle (rad/s).
    pub fn desired(&self) -> &Vector7<R> {
        &self.desired
    }

    /// The feedback torque of the last good cycle as measured motion alone asks for it (N m), whatever was fed back.
    pub fn measured_feedback(&self) -> &Vector7<R> {
        &self.measured
    }

    /// The friction that was fed forward in the last good cycle (N m).
    pub fn friction(&self) -> &Vector7<R> {
        &self.friction
    }

    /// Forgets the feedback of the last cycle.
    pub fn reset(&mut self) {
        *self = JointController::new(self.friction_speed);
    }

    /// The torque of one tick. `velocity` is fed back (rad/s), measured or observed. A joint that `state` extrapolates,
    /// because a reply is missing, keeps the feedback torque of its last good tick, while the feed-forward follows the
    /// extrapolated posture.
    pub fn torque(
        &mut self,
        model: &ArmModel<R>,
        gains: &Tracking<R>,
        frames: &Frames<R>,
        state: &JointState<R>,
        velocity: &Vector7<R>,
        reference: &JointReference<R>,
    ) -> JointTorques<R> {
        let friction = friction(gains, self.friction_speed, &reference.planned);
        let spring = gains.stiffness.component_mul(&(reference.q.0 - state.q.0));
        let before = self.feedback;
        self.desired = reference.dq.0;
        self.feedback = spring + gains.damping.component_mul(&(reference.dq.0 - velocity));
        self.measured = spring + gains.damping.component_mul(&(reference.dq.0 - state.dq.0));
        self.friction = friction;
        if state.extrapolated != 0 {
            self.keep(&before, state.extrapolated);
        }
        let inertial = model.inverse_dynamics(frames, &state.dq, &reference.ddq).0;
        let rotors = model.rotor_torque(&reference.ddq).0;
        JointTorques(inertial + rotors + friction + self.feedback)
    }

    /// Puts the feedback torque back to what it was (N m) for these joints, one bit each, J1 lowest.
    #[cold]
    #[inline(never)]
    fn keep(&mut self, before: &Vector7<R>, joints: u8) {
        for (joint, (feedback, before)) in self.feedback.iter_mut().zip(before.iter()).enumerate() {
            if joints >> joint & 1 != 0 {
                *feedback = *before;
            }
        }
    }
}

/// Friction expected at the planned velocity (N m).
fn friction<R: Real>(gains: &Tracking<R>, half_at: R, planned: &JointVelocities<R>) -> Vector7<R> {
    let mut torque = gains.viscous.component_mul(&planned.0);
    for ((torque, coulomb), rate) in torque.iter_mut().zip(gains.coulomb.iter()).zip(planned.0.iter()) {
        let magnitude = if *rate < R::constant(0.0) { -*rate } else { *rate };
        *torque += *coulomb * *rate / (magnitude + half_at);
    }
    torque
}
