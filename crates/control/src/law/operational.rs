//! `OperationalController`: the plan of the tool becomes a plan of the joints.
//!
//! Eq (11): `dq_d = J^+ (dx_d + K_x (x_d - x)) + K_post (I - J^+ J)(q_post - q)`, `J^+` damped. `q_d` is its integral,
//! kept within a clamp of the measured `q`: blocked by contact, the integral would grow without bound, and an arm that
//! was pushed away would be thrown back. `x` and `q` are measured, or both those of `q_d`.
//! `ddq_d` is
//! `J^+ (ddx_d + K_x (dx_d - dx) - dJ dq) + (I - J^+ J) K_post (dq_post - dq)`, or the low-passed derivative of `dq_d`.
//! Where the measured pose is fed back it is the plan's own, `J^+ (ddx_d - dJ dq)`: measured speeds would add a damping
//! of their own to that of Eq (10), with the swing of the cables in it.
//! The orientation error is `2 vec(q_d (x) conj(q))`, sign-aligned, in world axes, as the Jacobian's angular rows are.

use nalgebra::Vector3;

use crate::command::AccelerationSource;
use crate::law::gains::{HELD_BY_FRICTION, Tracking};
use crate::law::soft_limits::SoftLimits;
use crate::law::spring::{self, LET_GO};
use crate::model::arm::ArmModel;
use crate::model::kinematics::Frames;
use crate::plan::reference::{JointReference, TaskReference};
use crate::real::{Real, at_least, at_most, sqrt};
use crate::sense::filter::{Butterworth, LowPass};
use crate::sense::joints::JointState;
use crate::time::{PERIOD, RATE};
use crate::units::{JOINTS, JointAccelerations, JointPositions, JointVelocities, Vector6, Vector7};

/// Cut-off of the differentiated acceleration (Hz).
const ACCELERATION_CUT_OFF: f64 = 15.0;

/// Fastest return to the plan, added to the speed of the plan itself (m/s, rad/s): an arm that was pushed far off does
/// not snap back.
const CORRECTION_SPEED: (f64, f64) = (0.2, 1.0);

/// Distance of `q_d` from which on a spring is drawn (rad), which nothing but a push or an obstacle does, and below
/// which it no longer is.
const DRAWN: f64 = 0.1;
const RELAXED: f64 = 0.03;

/// The tool pose in the position feedback `K_x (x_d - x)` of Eq (11).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PoseFeedback {
    /// The measured pose: integral action through `q_d`, removes the steady-state error of friction and model.
    Measured,
    /// `FK(q_d)`: no integral action, so that a contact is not wound up; the joint gains alone set the stiffness.
    Planned,
}

impl PoseFeedback {
    /// That of a run.
    pub fn of_run(compliant: bool) -> Self {
        if compliant { PoseFeedback::Planned } else { PoseFeedback::Measured }
    }
}

/// Eq (11), with `q_d` as its state.
#[derive(Clone, Debug)]
pub struct OperationalController<R: Real> {
    q_d: JointPositions<R>,
    dq_d: JointVelocities<R>,
    derivative: LowPass<R, JOINTS>,
    clamped: bool,
    /// Joints whose springs something has drawn, one bit each, J1 lowest.
    drawn: u8,
    /// The joint whose turn it is to be looked at.
    turn: u8,
    lag: R,
    /// The planned posture goes nowhere by itself.
    keeps: bool,
}

impl<R: Real> OperationalController<R> {
    /// Starts where the arm is: `q_d = q`, `dq_d = 0`.
    pub fn new(q: JointPositions<R>) -> Self {
        OperationalController {
            q_d: q,
            dq_d: JointVelocities::zero(),
            derivative: LowPass::new(Butterworth::new(ACCELERATION_CUT_OFF, RATE)),
            clamped: false,
            drawn: 0,
            turn: 0,
            lag: R::constant(0.0),
            keeps: false,
        }
    }

    /// The desired joint positions of the last tick (rad).
    pub fn q_d(&self) -> &JointPositions<R> {
        &self.q_d
    }

    /// True if the anti-windup clamp acted in the last tick.
    pub fn is_clamped(&self) -> bool {
        self.clamped
    }

    /// True while a spring that something has drawn is let go of.
    pub fn is_drawn(&self) -> bool {
        self.drawn != 0
    }

    /// Leaves the planned posture where the plan of the tool keeps it, from the next tick on, or lets it go on towards
    /// the one that is preferred: friction holds some of its joints, and the others push the hand aside.
    pub fn keep(&mut self, keeps: bool) {
        self.keeps = keeps;
    }

    /// Speed of the tool against that of the plan in the last tick (m/s).
    pub fn lag(&self) -> R {
        self.lag
    }

    /// One tick. `frames` are those of the measured posture.
    pub fn step(
        &mut self,
        model: &ArmModel<R>,
        gains: &Tracking<R>,
        frames: &Frames<R>,
        state: &JointState<R>,
        task: &TaskReference<R>,
        (feedback, acceleration, limits): (PoseFeedback, AccelerationSource, &mut SoftLimits<R>),
    ) -> JointReference<R> {
        let planned;
        let frames = match feedback {
            PoseFeedback::Measured => frames,
            PoseFeedback::Planned => {
                planned = Frames::new(model, &self.q_d);
                &planned
            }
        };
        let jacobian = frames.jacobian();
        let inverse = jacobian.damped(gains.inverse_damping);
        let pose = frames.tool_pose();
        let gain = |linear: Vector3<R>, angular: Vector3<R>| {
            let (linear, angular) = (linear * gains.position, angular * gains.orientation);
            Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)
        };
        let (offset, turn) = (task.pose.position - pose.position, pose.orientation.error_to(&task.pose.orientation));
        let correction = gain(
            within_length(offset, R::constant(CORRECTION_SPEED.0) / gains.position),
            within_length(turn, R::constant(CORRECTION_SPEED.1) / gains.orientation),
        );
        // Of the plan where the pose is: against the measured posture of a joint that friction holds, q_d would be
        // led on and on along the null space, and the springs of its joints, which are not alike, push the hand aside.
        let posture = match feedback {
            PoseFeedback::Measured => &state.q.0,
            PoseFeedback::Planned => &self.q_d.0,
        };
        let preferred = (task.posture - posture) * if self.keeps { R::constant(0.0) } else { gains.posture };
        let mut dq_d = inverse.resolve(&(task.velocity + correction), &preferred);

        // Without what corrects the pose: feedback through the sign of the friction would have a large gain.
        let mut planned = inverse.resolve(&task.velocity, &task.posture_velocity);

        let dq = match feedback {
            PoseFeedback::Measured => &state.dq,
            PoseFeedback::Planned => &self.dq_d,
        };
        let rate = task.velocity - jacobian.twist(&dq.0);
        self.lag = sqrt(rate.fixed_rows::<3>(0).norm_squared());
        let damps = R::constant(if feedback == PoseFeedback::Measured { 0.0 } else { 1.0 });
        let mut ddq_d = match acceleration {
            AccelerationSource::Analytic => {
                let damping = gain(rate.fixed_rows::<3>(0).into(), rate.fixed_rows::<3>(3).into()) * damps;
                let wanted = task.acceleration + damping - frames.velocity_product(dq).to_vector();
                inverse.resolve(&wanted, &((task.posture_velocity - state.dq.0) * (gains.posture * damps)))
            }
            AccelerationSource::Differentiated => self.derivative.step(&((dq_d - self.dq_d.0) * R::constant(RATE))),
        };

        let mut q_d = self.q_d.0 + dq_d * R::constant(PERIOD);
        self.clamped = false;
        if limits.look(model, &q_d, &dq_d) {
            self.clamped = limits.come(model, &inverse, &self.q_d.0, (&mut dq_d, &mut planned), &mut ddq_d);
            q_d = self.q_d.0 + dq_d * R::constant(PERIOD);
        }
        self.dq_d = JointVelocities(dq_d);
        for ((desired, measured), clamp) in q_d.iter_mut().zip(state.q.0.iter()).zip(gains.clamp.iter()) {
            let kept = at_most(at_least(*desired, *measured - *clamp), *measured + *clamp);
            self.clamped |= kept != *desired;
            *desired = kept;
        }
        self.q_d = JointPositions(q_d);
        JointReference { q: self.q_d, dq: self.dq_d, ddq: JointAccelerations(ddq_d), planned: JointVelocities(planned) }
    }

    /// Lets go, from the next tick on, of the springs between joints and `q_d` that something has drawn and whose
    /// joints come back faster than `planned`; true if there is one that more than friction draws. One joint in a tick
    /// is looked at: nobody draws a spring faster.
    #[inline(never)]
    pub fn let_go(&mut self, state: &JointState<R>, planned: &JointVelocities<R>, clamp: &Vector7<R>) -> bool {
        let joint = usize::from(self.turn) % JOINTS;
        self.turn = joint as u8 + 1;
        let offset = self.q_d.0[joint] - state.q.0[joint];
        if offset * offset > R::constant(DRAWN * DRAWN) {
            self.drawn |= 1 << joint;
        }
        if self.drawn == 0 {
            return false;
        }
        self.release(state, &(state.dq.0 - planned.0), clamp)
    }

    /// The same for every spring that is drawn; `speeds` are those beyond the plan. True if more than friction draws
    /// one.
    #[inline(never)]
    fn release(&mut self, state: &JointState<R>, speeds: &Vector7<R>, clamp: &Vector7<R>) -> bool {
        let joints = self.q_d.0.iter_mut().zip(state.q.0.iter()).zip(speeds.iter());
        let (mut bit, mut is_drawn) = (1, false);
        for (((((desired, q), speed), clamp), let_go), held) in
            joints.zip(clamp.iter()).zip(LET_GO).zip(HELD_BY_FRICTION)
        {
            let (offset, near) = (*desired - *q, R::constant(RELAXED));
            is_drawn |= self.drawn & bit != 0 && offset * offset > R::constant(held * held);
            if offset < near && offset > -near {
                self.drawn &= !bit;
            } else if self.drawn & bit != 0
                && let Some(reach) = spring::reach(offset, *speed, *clamp, let_go)
            {
                *desired = at_most(at_least(*desired, *q - reach), *q + reach);
            }
            bit <<= 1;
        }
        is_drawn
    }
}

/// The vector, shortened to this length if it is longer.
fn within_length<R: Real>(vector: Vector3<R>, longest: R) -> Vector3<R> {
    let squared = vector.norm_squared();
    if squared <= longest * longest { vector } else { vector * (longest / sqrt(squared)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::gains::Gains;
    use crate::model::calibration::Payload;

    /// Farthest joint of `q_d` from the posture that a plan at rest prefers (rad), after ten seconds in which friction
    /// holds J5 a tenth of a radian beside it.
    fn led_away(feedback: PoseFeedback) -> f64 {
        let model = ArmModel::<f64>::new(Payload::SensorAndHand);
        let posture = JointPositions::from_array([-0.49, 1.56, 1.47, 1.85, -0.17, -0.58, 1.75]);
        let mut held = posture;
        held.0[4] -= 0.1;
        let task = TaskReference {
            pose: Frames::new(&model, &posture).tool_pose(),
            velocity: Vector6::zeros(),
            acceleration: Vector6::zeros(),
            posture: posture.0,
            posture_velocity: Vector7::zeros(),
        };
        let state = JointState::whole(held, JointVelocities::zero());
        let (frames, gains) = (Frames::new(&model, &held), Gains::tuned().compliant);
        let (mut controller, mut limits) = (OperationalController::new(posture), SoftLimits::new());
        for _ in 0..3000 {
            controller.step(
                &model,
                &gains,
                &frames,
                &state,
                &task,
                (feedback, AccelerationSource::Analytic, &mut limits),
            );
        }
        (controller.q_d().0 - posture.0).amax()
    }

    /// The change that makes it fail: the posture is the measured one in either case. 0.3 rad then, the clamp.
    #[test]
    fn a_joint_that_friction_holds_leads_the_planned_posture_nowhere() {
        let away = led_away(PoseFeedback::Planned);
        assert!(away < 1e-9, "{away} rad");
    }

    /// Measured, the sum takes away what friction leaves: a stiff run comes to its plan in all seven joints.
    #[test]
    fn against_a_joint_that_friction_holds_the_measured_posture_goes_on() {
        let away = led_away(PoseFeedback::Measured);
        assert!(away > 0.1, "{away} rad");
    }

    /// The change that makes it fail: a posture that is kept goes on towards the one that is preferred. 0.1 rad then.
    #[test]
    fn a_posture_that_is_kept_goes_nowhere_and_one_that_is_not_goes_where_it_is_preferred() {
        let model = ArmModel::<f64>::new(Payload::SensorAndHand);
        let posture = JointPositions::from_array([-0.49, 1.56, 1.47, 1.85, -0.17, -0.58, 1.75]);
        let frames = Frames::new(&model, &posture);
        let mut preferred = posture.0;
        preferred[4] += 0.3;
        let task = TaskReference {
            pose: frames.tool_pose(),
            velocity: Vector6::zeros(),
            acceleration: Vector6::zeros(),
            posture: preferred,
            posture_velocity: Vector7::zeros(),
        };
        let state = JointState::whole(posture, JointVelocities::zero());
        let gains = Gains::tuned().compliant;
        let moved = |keeps| {
            let (mut controller, mut limits) = (OperationalController::new(posture), SoftLimits::new());
            controller.keep(keeps);
            for _ in 0..900 {
                let how = (PoseFeedback::Planned, AccelerationSource::Analytic, &mut limits);
                controller.step(&model, &gains, &frames, &state, &task, how);
            }
            (controller.q_d().0 - posture.0).amax()
        };
        let (kept, led) = (moved(true), moved(false));
        assert!(kept < 1e-9 && led > 0.05, "{kept} rad, {led} rad");
    }
}
