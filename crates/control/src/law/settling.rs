//! `Settling`: the integral of a compliant run, which keeps an arm that touches nothing on its plan.
//!
//! The soft spring of a compliant run rests up to 0.04 rad beside its plan for friction, and as far for what the model
//! lacks in gravity: 1 to 3 cm at the hand. While nothing is touched a torque per joint is therefore moved towards the
//! error:
//!
//! * in proportion to what the error exceeds half of `TOLERANCE` by, at most all of `CLAMP` in `RISE`. Slower
//!   than the spring and its damping, so that an arm without friction does not swing about its plan;
//! * not where a joint closes its error at that rate already: more torque would only carry it past;
//! * within 1.5 times the friction of the model: an obstacle that no sensor feels is pressed with that much more, and
//!   no more with time.
//!
//! While something is touched it grows no more: there the feedback decides how hard. From a touch on, the torque of a
//! joint that presses against what the sensor measures is given up, because friction that was made up for along a plan
//! is not there once the plan is stopped. Once the hand grips, it fades: with what it holds the arm turns round, and
//! friction with it. What is raised and weighs what was expected (`plan::lift`) is no touch any more.
//!
//! A run waits for a joint that is still beyond the accuracy of a held posture.

use crate::law::integral::TOLERANCE;
use crate::model::wam7;
use crate::plan::reference::JointReference;
use crate::real::{Real, at_least, at_most, within};
use crate::sense::joints::JointState;
use crate::time::PERIOD;
use crate::units::{JOINTS, Vector7};

/// Largest torque (N m): enough for friction that is 30 % more than the model's, with 20 % to spare.
pub(crate) const CLAMP: [f64; JOINTS] = {
    let mut clamp = wam7::FRICTION_COULOMB;
    let mut joint = 0;
    while joint < JOINTS {
        clamp[joint] *= 1.5;
        joint += 1;
    }
    clamp
};

/// Time from zero to the clamp at the full rate (s).
const RISE: f64 = 2.0;

/// Error beyond the tolerance from which on the rate is the full one (rad). At J2 the time constant is 0.7 s, three
/// times that of the spring against its damping.
const FULL: f64 = 0.02;

/// Time constant with which it fades in a grip (s): gone before the hand lifts what it has closed on.
const FADING: f64 = 0.5;

/// Torque that is given up for each N m s of force control against it (1/s): 0.75 N m against J1 take all that it can
/// have within a tenth of a second.
const YIELDING: f64 = 30.0;

/// Control periods between two turns of a joint: in a run there is no time for all joints in one.
const TURNS: f64 = JOINTS as f64;

/// Torque of a compliant run against friction and the error of the model.
#[derive(Clone, Debug)]
pub struct Settling<R: Real> {
    torque: Vector7<R>,
    /// The joint whose turn it is.
    turn: u8,
    /// A bit for each joint that was beyond its tolerance in its last turn, and that more torque is still to come to.
    seeking: u8,
}

impl<R: Real> Settling<R> {
    /// No torque.
    pub fn new() -> Self {
        Settling { torque: Vector7::zeros(), turn: 0, seeking: 0 }
    }

    /// True if a joint is farther from its plan than the accuracy of a held posture, and more torque can still bring it
    /// there.
    pub fn is_seeking(&self) -> bool {
        self.seeking != 0
    }

    /// The torque (N m).
    pub fn torque(&self) -> &Vector7<R> {
        &self.torque
    }

    /// One control period in a grip, in turns as well.
    #[inline(never)]
    pub fn fade(&mut self) {
        let joint = self.take_turn();
        self.seeking = 0;
        self.torque[joint] *= R::constant(1.0 - TURNS * PERIOD / FADING);
    }

    /// One control period in touch with something, in turns as well, `pressing` the torque of Eq (12) (N m). A joint
    /// whose torque is against it gives way, at most all of what it has.
    #[inline(never)]
    pub fn give_way(&mut self, pressing: &Vector7<R>) {
        let joint = self.take_turn();
        self.seeking = 0;
        let (torque, zero) = (self.torque[joint], R::constant(0.0));
        let left = torque + pressing[joint] * R::constant(YIELDING * TURNS * PERIOD);
        if torque > zero {
            self.torque[joint] = at_most(at_least(left, zero), torque);
        } else {
            self.torque[joint] = at_least(at_most(left, zero), torque);
        }
    }

    /// Returns the joint whose turn it is.
    fn take_turn(&mut self) -> usize {
        let joint = usize::from(self.turn) % JOINTS;
        self.turn = joint as u8 + 1;
        joint
    }

    /// One control period. The joint whose turn it is moves for all periods since its last one, and takes over what
    /// another law gives away in each of them, `given` joint by joint (N m).
    ///
    /// Not inlined: it runs from flash on a board whose fast memory is full.
    #[inline(never)]
    pub fn step(
        &mut self,
        stiffness: &Vector7<R>,
        state: &JointState<R>,
        reference: &JointReference<R>,
        given: impl FnOnce(usize) -> R,
    ) {
        let joint = self.take_turn();
        let error = reference.q.0[joint] - state.q.0[joint];
        let closing = state.dq.0[joint] - reference.dq.0[joint];
        let [clamp, full] = [CLAMP[joint], CLAMP[joint] / RISE].map(R::constant);
        let beyond = error - within(error, R::constant(0.5 * TOLERANCE[joint]));
        let mut rate = within(beyond * R::constant(1.0 / FULL), R::constant(1.0)) * full;
        let zero = R::constant(0.0);
        let closes = closing * stiffness[joint];
        if (rate > zero && closes > full) || (rate < zero && closes < -full) {
            rate = zero;
        }
        let moved = self.torque[joint] + rate * R::constant(TURNS * PERIOD) + given(joint) * R::constant(TURNS);
        self.torque[joint] = within(moved, clamp);
        let rests = error == within(error, R::constant(TOLERANCE[joint])) || moved != self.torque[joint];
        self.seeking = self.seeking & !(1 << joint) | u8::from(!rests) << joint;
    }
}

impl<R: Real> Default for Settling<R> {
    fn default() -> Self {
        Settling::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::{JointPositions, JointVelocities};

    /// Every joint at 0.3 rad, with this speed (rad/s).
    fn moving(speed: f64) -> JointState<f64> {
        JointState::whole(JointPositions(Vector7::repeat(0.3)), JointVelocities(Vector7::repeat(speed)))
    }

    /// The torque after so many seconds of this error (rad), closing at this speed (rad/s), and of this torque that is
    /// given away in each control period (N m).
    fn after(seconds: f64, error: f64, speed: f64, given: f64) -> Vector7<f64> {
        let state = moving(speed);
        let reference = JointReference::at_rest(JointPositions(Vector7::repeat(0.3 + error)));
        let mut settling = Settling::new();
        for _ in 0..(seconds / PERIOD) as u32 {
            settling.step(&Vector7::repeat(50.0), &state, &reference, |_| given);
        }
        *settling.torque()
    }

    #[test]
    fn a_large_error_moves_the_torque_to_its_clamp_within_two_seconds_and_no_farther() {
        for sign in [1.0, -1.0] {
            for (joint, clamp) in CLAMP.into_iter().enumerate() {
                let (half, end) = (after(0.5 * RISE, 0.1 * sign, 0.0, 0.0), after(3.0 * RISE, 0.1 * sign, 0.0, 0.0));
                assert!((half[joint] * sign / clamp - 0.5).abs() < 0.02, "J{}: {}", joint + 1, half[joint]);
                assert!((end[joint] * sign - clamp).abs() < 1e-9, "J{}: {}", joint + 1, end[joint]);
            }
        }
    }

    #[test]
    fn a_small_error_is_closed_slowly_and_half_of_the_tolerance_is_none() {
        for (joint, (clamp, tolerance)) in CLAMP.into_iter().zip(TOLERANCE).enumerate() {
            assert_eq!(after(RISE, 0.49 * tolerance, 0.0, 0.0)[joint], 0.0, "J{}", joint + 1);
            let quarter = after(RISE, 0.5 * tolerance + 0.25 * FULL, 0.0, 0.0)[joint] / clamp;
            assert!((quarter - 0.25).abs() < 0.02, "J{}: {quarter}", joint + 1);
        }
    }

    #[test]
    fn a_joint_that_closes_its_error_is_left_alone_and_one_that_leaves_its_plan_is_not() {
        for sign in [1.0, -1.0] {
            let closing = after(1.0, 0.1 * sign, 0.5 * sign, 0.0);
            assert_eq!(closing, Vector7::zeros());
            let leaving = after(1.0, 0.1 * sign, -0.5 * sign, 0.0);
            assert!(leaving.iter().all(|torque| torque * sign > 0.0), "{leaving}");
        }
    }

    /// True if one turn of J1 moves the torque, whose error of this sign the joint at `speed` (rad/s) closes against a
    /// plan at `plan` (rad/s), with the stiffness 1 N m/rad.
    fn moves(sign: f64, speed: f64, plan: f64) -> bool {
        let mut reference = JointReference::at_rest(JointPositions(Vector7::repeat(0.3 + 0.1 * sign)));
        reference.dq = JointVelocities(Vector7::repeat(plan));
        let mut settling = Settling::new();
        settling.step(&Vector7::repeat(1.0), &moving(speed), &reference, |_| 0.0);
        assert!(settling.torque()[0] * sign >= 0.0);
        settling.torque()[0] != 0.0
    }

    #[test]
    fn a_joint_that_closes_its_error_at_the_full_rate_is_still_moved_and_one_bit_faster_it_is_not() {
        let full = CLAMP[0] / RISE;
        for sign in [1.0, -1.0] {
            assert!(moves(sign, full * sign, 0.0));
            assert!(!moves(sign, full.next_up() * sign, 0.0));
        }
    }

    #[test]
    fn a_joint_that_only_follows_its_plan_closes_nothing() {
        let fast = 2.0 * CLAMP[0];
        for sign in [1.0, -1.0] {
            assert!(moves(sign, fast * sign, fast * sign));
            assert!(!moves(sign, fast * sign, 0.0));
            assert!(!moves(sign, 0.0, -fast * sign));
        }
    }

    #[test]
    fn the_clamp_is_half_more_than_the_friction_of_the_model() {
        for (clamp, friction) in CLAMP.into_iter().zip(wam7::FRICTION_COULOMB) {
            assert!((clamp - 1.5 * friction).abs() < 1e-12 && clamp > 0.1);
        }
    }

    #[test]
    fn a_grip_takes_the_torque_of_every_joint_away() {
        let mut settling = Settling { torque: Vector7::from(CLAMP), turn: 0, seeking: 0 };
        for _ in 0..(3.0 * FADING / PERIOD) as u32 {
            settling.fade();
        }
        let left = settling.torque().component_div(&Vector7::from(CLAMP));
        assert!(left.iter().all(|share| (0.02..0.06).contains(share)), "{left}");
    }

    /// The torque once every joint has had its turn in touch with something.
    fn given_way(settling: &mut Settling<f64>, pressing: f64) -> Vector7<f64> {
        (0..JOINTS).for_each(|_| settling.give_way(&Vector7::repeat(pressing)));
        *settling.torque()
    }

    #[test]
    fn what_presses_against_force_control_is_given_up_and_nothing_else() {
        for sign in [1.0, -1.0] {
            let all = Vector7::from(CLAMP) * sign;
            let mut settling = Settling { torque: all, turn: 0, seeking: 0 };
            assert_eq!(given_way(&mut settling, 0.1 * sign), all, "it presses where the force goes");
            let left = (Vector7::from(CLAMP).add_scalar(-0.1 * YIELDING * TURNS * PERIOD)).map(|left| left.max(0.0));
            assert!((given_way(&mut settling, -0.1 * sign) - left * sign).amax() < 1e-12, "{}", settling.torque);
            assert_eq!(given_way(&mut settling, -1e6 * sign), Vector7::zeros(), "it never turns round");
            assert_eq!(given_way(&mut settling, -1e6 * sign), Vector7::zeros(), "it never begins");
        }
    }

    #[test]
    fn what_another_law_gives_away_is_taken_over_by_every_joint_within_its_clamp() {
        let taken = after(1.0, 0.0, 0.0, 0.1 * PERIOD);
        assert!(taken.iter().all(|torque| (torque - 0.1).abs() < 0.003), "{taken}");
        let bounded = after(1.0, 0.0, 0.0, 100.0 * PERIOD);
        assert_eq!(bounded, Vector7::from(CLAMP));
    }
}
