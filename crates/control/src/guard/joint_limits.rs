//! `JointBounds`: soft joint limits that push back, and the bounds beyond which a movement is stopped.
//!
//! The arm rests outside its soft limits when it is switched on (its home posture touches two stops). A bound therefore
//! starts at the posture the arm is armed in, if that lies outside, and tightens as the arm comes in; it never widens.

use crate::model::arm::ArmModel;
use crate::real::{Real, at_least, at_most};
use crate::units::{JOINTS, JointPositions, JointTorques, Vector7};

/// Slack beyond the posture the arm was armed in (rad).
const SLACK: f64 = 0.01;

/// Distance beyond a bound at which a movement is stopped (rad); the stops lie 0.05 rad beyond the soft limits.
const STOP_DISTANCE: f64 = 0.02;

/// Stiffness with which a joint is held beyond a bound (N m/rad): some N m before the stop, so that a person feels it
/// coming. J6 at 40 N m/rad swung at 55 Hz with its cable in every state, where it has no friction; with 12 N m/rad a
/// compliant run has a gain margin of 2.
const STIFFNESS: [f64; JOINTS] = [100.0, 150.0, 80.0, 60.0, 25.0, 12.0, 8.0];

/// Speed of a return at which nothing pushes any more (rad/s). Without it the push gives back as speed what the way out
/// cost.
const RETURN_SPEED: f64 = 0.5;

/// Damping while moving further out (N m s/rad).
const DAMPING: [f64; JOINTS] = [15.0, 25.0, 4.5, 4.0, 0.22, 0.4, 0.06];

/// Distance beyond a bound at which nothing presses a joint further out (rad).
const UNPRESSED: f64 = 0.005;

/// The bounds of the joints.
#[derive(Clone, Copy, Debug)]
pub struct JointBounds<R: Real> {
    min: [R; JOINTS],
    max: [R; JOINTS],
}

impl<R: Real> JointBounds<R> {
    /// The soft limits, widened to the posture `q` the arm is armed in.
    pub fn around(model: &ArmModel<R>, q: &JointPositions<R>) -> Self {
        let mut bounds = JointBounds { min: model.soft_min, max: model.soft_max };
        for joint in 0..JOINTS {
            bounds.min[joint] = at_most(q.0[joint] - R::constant(SLACK), bounds.min[joint]);
            bounds.max[joint] = at_least(q.0[joint] + R::constant(SLACK), bounds.max[joint]);
        }
        bounds
    }

    /// Follows the arm in: never beyond the widest of soft limit and present posture, never wider than before.
    pub fn tighten(&mut self, model: &ArmModel<R>, q: &JointPositions<R>) {
        let now = JointBounds::around(model, q);
        for joint in 0..JOINTS {
            self.min[joint] = at_least(now.min[joint], self.min[joint]);
            self.max[joint] = at_most(now.max[joint], self.max[joint]);
        }
    }

    /// True if a joint is beyond its bound by more than `STOP_DISTANCE`.
    pub fn violated(&self, q: &JointPositions<R>) -> bool {
        let distance = R::constant(STOP_DISTANCE);
        (0..JOINTS).any(|joint| q.0[joint] > self.max[joint] + distance || q.0[joint] < self.min[joint] - distance)
    }

    /// True if no joint is beyond its bound.
    pub fn contain(&self, q: &JointPositions<R>) -> bool {
        (0..JOINTS).all(|joint| q.0[joint] <= self.max[joint] && q.0[joint] >= self.min[joint])
    }

    /// Torque that pushes joints back inside; zero within the bounds. `held` is the stiffness (N m/rad) and damping
    /// (N m s/rad) with which the law of the state holds the joints already: only what is missing is added, because
    /// both together would shake. `dq` is the velocity to be damped (rad/s).
    #[inline(always)]
    pub fn repulsion(
        &self,
        q: &JointPositions<R>,
        dq: &Vector7<R>,
        held: &(Vector7<R>, Vector7<R>),
    ) -> JointTorques<R> {
        let zero = R::constant(0.0);
        let mut torque = Vector7::zeros();
        for joint in 0..JOINTS {
            let spring = at_least(R::constant(STIFFNESS[joint]) - held.0[joint], zero);
            let damper = at_least(R::constant(DAMPING[joint]) - held.1[joint], zero);
            let above = at_least(q.0[joint] - self.max[joint], zero);
            let below = at_least(self.min[joint] - q.0[joint], zero);
            if above > zero {
                torque[joint] = -push_back((spring, damper), above, dq[joint]);
            } else if below > zero {
                torque[joint] = push_back((spring, damper), below, -dq[joint]);
            }
        }
        JointTorques(torque)
    }

    /// The part of a torque (N m) that presses joints further out and that they are no longer to bear: all of it
    /// `UNPRESSED` beyond a bound, nothing within.
    pub fn outward(&self, q: &JointPositions<R>, torque: &Vector7<R>) -> Vector7<R> {
        let (zero, one) = (R::constant(0.0), R::constant(1.0));
        Vector7::from_fn(|joint, _| {
            let torque = torque[joint];
            let past = if torque > zero { q.0[joint] - self.max[joint] } else { self.min[joint] - q.0[joint] };
            torque * at_most(at_least(past * R::constant(1.0 / UNPRESSED), zero), one)
        })
    }
}

/// Torque towards the inside (N m) on a joint that is this far out (rad) and moves further out at this speed (rad/s).
fn push_back<R: Real>((spring, damper): (R, R), distance: R, outward: R) -> R {
    let zero = R::constant(0.0);
    let share = at_most(at_least(R::constant(1.0) + outward * R::constant(1.0 / RETURN_SPEED), zero), R::constant(1.0));
    distance * spring * share + at_least(outward, zero) * damper
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::calibration::Payload;

    fn model() -> ArmModel<f64> {
        ArmModel::new(Payload::SensorAndHand)
    }

    /// The middle of the soft limits, but for one joint.
    fn posture(model: &ArmModel<f64>, joint: usize, angle: f64) -> JointPositions<f64> {
        let mut q = Vector7::from_fn(|joint, _| 0.5 * (model.soft_min[joint] + model.soft_max[joint]));
        q[joint] = angle;
        JointPositions(q)
    }

    /// The middle of the soft limits.
    fn middle(model: &ArmModel<f64>) -> JointPositions<f64> {
        posture(model, 0, 0.5 * (model.soft_min[0] + model.soft_max[0]))
    }

    #[test]
    fn bounds_are_the_soft_limits_and_reach_a_little_beyond_the_posture_the_arm_is_armed_in() {
        let model = model();
        for joint in 0..JOINTS {
            let (min, max) = (model.soft_min[joint], model.soft_max[joint]);
            let around = |angle| {
                let bounds = JointBounds::around(&model, &posture(&model, joint, angle));
                (bounds.min[joint], bounds.max[joint])
            };
            assert_eq!(around(min + 0.1), (min, max));
            assert_eq!(around(min - 0.1), (min - 0.1 - SLACK, max));
            assert_eq!(around(max + 0.1), (min, max + 0.1 + SLACK));
        }
    }

    #[test]
    fn bounds_tighten_as_the_arm_comes_in_and_never_widen() {
        let model = model();
        for joint in 0..JOINTS {
            for (limit, outward) in [(model.soft_min[joint], -1.0), (model.soft_max[joint], 1.0)] {
                let mut bounds = JointBounds::around(&model, &posture(&model, joint, limit + 0.2 * outward));
                let mut bound = |out: f64| {
                    bounds.tighten(&model, &posture(&model, joint, limit + out * outward));
                    if outward < 0.0 { bounds.min[joint] } else { bounds.max[joint] }
                };
                assert_eq!(bound(0.1), limit + 0.1 * outward + SLACK * outward);
                assert_eq!(bound(0.15), limit + 0.1 * outward + SLACK * outward);
                assert_eq!(bound(-0.1), limit);
                assert_eq!(bound(0.1), limit);
            }
        }
    }

    #[test]
    fn a_bound_is_violated_beyond_the_stop_distance_and_not_at_it() {
        let model = model();
        let bounds = JointBounds::around(&model, &middle(&model));
        for joint in 0..JOINTS {
            let violated = |angle| bounds.violated(&posture(&model, joint, angle));
            assert!(!violated(bounds.max[joint] + STOP_DISTANCE) && violated(bounds.max[joint] + 1.1 * STOP_DISTANCE));
            assert!(!violated(bounds.min[joint] - STOP_DISTANCE) && violated(bounds.min[joint] - 1.1 * STOP_DISTANCE));
        }
    }

    #[test]
    fn a_joint_beyond_its_bound_is_not_pressed_further_out_and_may_be_pressed_in() {
        let model = model();
        let bounds = JointBounds::around(&model, &middle(&model));
        for joint in 0..JOINTS {
            for (bound, outward) in [(bounds.min[joint], -1.0), (bounds.max[joint], 1.0)] {
                for (out, share) in [(-0.1, 0.0), (0.5 * UNPRESSED, 0.5), (1.5 * UNPRESSED, 1.0)] {
                    let q = posture(&model, joint, bound + out * outward);
                    let borne = |torque: f64| bounds.outward(&q, &Vector7::repeat(torque * outward))[joint] * outward;
                    assert!((borne(3.0) - 3.0 * share).abs() < 1e-9, "J{}: {} at {out}", joint + 1, borne(3.0));
                    assert_eq!(borne(-3.0), 0.0, "J{} at {out}", joint + 1);
                }
            }
        }
    }

    #[test]
    fn a_joint_beyond_its_bound_is_pushed_back_and_damped_outwards_and_let_go_on_its_return() {
        let model = model();
        let bounds = JointBounds::around(&model, &middle(&model));
        let held = (Vector7::zeros(), Vector7::zeros());
        for joint in 0..JOINTS {
            for (bound, outward) in [(bounds.min[joint], -1.0), (bounds.max[joint], 1.0)] {
                let inwards = |out: f64, speed: f64| {
                    let mut dq = Vector7::zeros();
                    dq[joint] = speed * outward;
                    let torque = bounds.repulsion(&posture(&model, joint, bound + out * outward), &dq, &held).0;
                    for other in (0..JOINTS).filter(|other| *other != joint) {
                        assert_eq!(torque[other], 0.0, "J{}", other + 1);
                    }
                    -outward * torque[joint]
                };
                let spring = 0.04 * STIFFNESS[joint];
                for (out, speed, expected) in [
                    (0.04, 0.0, spring),
                    (0.04, 0.3, spring + 0.3 * DAMPING[joint]),
                    (0.04, -0.5 * RETURN_SPEED, 0.5 * spring),
                    (0.04, -RETURN_SPEED, 0.0),
                    (0.04, -2.0 * RETURN_SPEED, 0.0),
                    (-0.04, 0.3, 0.0),
                ] {
                    let torque = inwards(out, speed);
                    assert!((torque - expected).abs() < 1e-9, "J{}: {torque}, {expected}", joint + 1);
                }
            }
        }
    }

    #[test]
    fn what_holds_a_joint_already_is_not_added_again() {
        let model = model();
        let bounds = JointBounds::around(&model, &middle(&model));
        for joint in 0..JOINTS {
            let out = posture(&model, joint, bounds.max[joint] + 0.01);
            let with = |share: f64| {
                let held = (Vector7::from(STIFFNESS) * share, Vector7::from(DAMPING) * share);
                bounds.repulsion(&out, &Vector7::repeat(0.1), &held).0[joint]
            };
            let alone = 0.01 * STIFFNESS[joint] + 0.1 * DAMPING[joint];
            assert!((with(0.0) + alone).abs() < 1e-9 && (with(0.5) + 0.5 * alone).abs() < 1e-9, "J{}", joint + 1);
            assert_eq!(with(1.0), 0.0);
            assert_eq!(with(2.0), 0.0, "a stiff joint is not pushed outwards");
        }
    }
}
