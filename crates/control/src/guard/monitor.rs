//! `Monitor`: watches the measured state and says when torque authority has to go down.

use puck::Transmission;

use crate::guard::disagreement::{self, Disagreement, Effort};
use crate::guard::fault::Fault;
use crate::guard::joint_limits::JointBounds;
use crate::guard::supervisor::{State, Trigger};
use crate::model::kinematics::Frames;
use crate::model::wam7;
use crate::real::Real;
use crate::sense::joints::{COAST_CYCLES, JointState};
use crate::time::few_periods;
use crate::units::{JOINTS, Vector7, Wrench};

/// Largest speed of elbow and forearm in any state with torque (m/s); the safety module faults at 1.0.
pub const TIP_SPEED_LIMIT: f64 = 0.8;

/// Speed of elbow and forearm from which the pendant warns, as the safety module has it at power-up (m/s). While it
/// warns a run is held to [`HELD_BACK`](crate::plan::bounds::HELD_BACK).
pub const TIP_SPEED_WARNING: f64 = 0.5;

/// Largest speed of the hand in any state with torque (m/s). The safety module does not watch it; wrist and forearm can
/// make it thrice as fast as the elbow. Above what a change of goal may lead to (0.8 m/s), below the speed at which a
/// hand of this mass reaches the transient limits for a person (1.4 m/s).
pub const HAND_SPEED_LIMIT: f64 = 1.0;

/// Distance beyond the elbow at which the safety module watches the speed (m).
pub const TIP_REACH: f64 = 0.35;

/// A joint may exceed its speed limit by this factor before it is stopped: noise and overshoot.
const SPEED_MARGIN: f64 = 1.2;

/// Contact force that stops a movement (N): the lowest permissible quasi-static one (face) of the collaboration
/// standards.
pub(crate) const FORCE_LIMIT: f64 = 65.0;

/// Samples in a row above the force limit: one corrupt sample stops no movement.
const FORCE_CYCLES: u8 = 2;

/// Largest distance between plan and tool (m); a plan farther away has lost its arm.
pub(crate) const TRACKING_LIMIT: f64 = 0.30;

/// Largest speed of the tool against its plan (m/s). Somebody who pushes harder is not followed; a loop that swings is
/// stopped.
const LAG_LIMIT: f64 = 0.5;

/// Time without positions after which torque goes off: 200 ms, in control periods.
const SILENCE_CYCLES: u8 = few_periods(0.2);

/// Watches limits.
#[derive(Clone, Debug)]
pub(crate) struct Monitor<R: Real> {
    speed_limit: [R; JOINTS],
    pressed: u8,
    disagreement: Disagreement<R>,
}

/// Input of the monitor besides the joint state.
pub(crate) struct Observation<'a, R: Real> {
    pub(crate) frames: &'a Frames<R>,
    pub(crate) bounds: &'a JointBounds<R>,
    /// Magnitude of the unfiltered, tared force (N).
    pub(crate) force: R,
    /// Wrench of the environment on the robot at the grasp point.
    pub(crate) wrench: &'a Wrench<R>,
    /// Distance (m) and speed (m/s) of the tool against the plan in the last cycle.
    pub(crate) lag: (R, R),
    /// True if the wrench is gone for so long that nothing moves by itself any more: the feedback has faded by then.
    pub(crate) wrench_lost: bool,
    /// True if no fresh force tells of a contact: the sensor is silent, or there is none.
    pub(crate) blind: bool,
    /// True if the run bends or presses by what the sensor tells.
    pub(crate) depends: bool,
    /// True once gravity is carried in full: until then the feedback carries it.
    pub(crate) carried: bool,
    /// Torques and motion that the law asks of the joints, where it feeds anything back.
    pub(crate) effort: Option<Effort<'a, R>>,
    /// True if the sensor has been at full scale: in a force, or in a torque that the run depends on.
    pub(crate) full_scale: bool,
    /// True if a joint swings back and forth for longer than a blow rings.
    pub(crate) shakes: bool,
}

impl<R: Real> Monitor<R> {
    pub(crate) fn new(transmission: Transmission<R>) -> Self {
        Monitor {
            speed_limit: wam7::VELOCITY_MAX.map(|limit| R::constant(limit * SPEED_MARGIN)),
            pressed: 0,
            disagreement: Disagreement::new(transmission),
        }
    }

    /// The most severe finding of this cycle in a state with torque.
    pub(crate) fn check(
        &mut self,
        law: State,
        state: &JointState<R>,
        seen: &Observation<'_, R>,
    ) -> Option<(Trigger, Fault)> {
        if state.age > SILENCE_CYCLES {
            return Some((Trigger::HardFault, Fault::RepliesLostForLong));
        }
        // An encoder that stands still is told even where the zero is lost already: it wants the brakes.
        if state.age > COAST_CYCLES && state.stuck {
            return Some((Trigger::SoftFault, Fault::EncoderStuck));
        }
        if state.displaced && law != State::Lower {
            return Some((Trigger::SoftFault, Fault::ImplausiblePosition));
        }
        if state.age > COAST_CYCLES {
            let fault = if state.implausible { Fault::ImplausiblePosition } else { Fault::RepliesLost };
            return Some((Trigger::SoftFault, fault));
        }
        let follows_plan = matches!(law, State::Approach | State::Run);
        let (stuck, pushed) = self.disagrees(follows_plan, state, seen);
        // A value that was measured long ago says nothing of now.
        let pressed = !seen.blind && (seen.force > R::constant(FORCE_LIMIT) || seen.full_scale);
        self.pressed = if pressed { self.pressed.saturating_add(1) } else { 0 };
        let moving_by_itself = follows_plan || law == State::Hold;
        let finding = if moving_by_itself && self.pressed >= FORCE_CYCLES {
            Some(Fault::ContactForce)
        } else if stuck {
            Some(Fault::EncoderStuck)
        } else if pushed {
            Some(Fault::UnseenContact)
        } else if seen.shakes {
            Some(Fault::Shaking)
        } else if moving_by_itself && seen.bounds.violated(&state.q) {
            Some(Fault::JointLimit)
        } else if follows_plan && seen.wrench_lost {
            Some(Fault::WrenchLost)
        } else if law == State::Run && (seen.lag.0 > R::constant(TRACKING_LIMIT) || seen.lag.1 > R::constant(LAG_LIMIT))
        {
            Some(Fault::TrackingError)
        } else if state.dq.0.iter().zip(&self.speed_limit).any(|(dq, limit)| *dq > *limit || *dq < -*limit) {
            Some(Fault::JointSpeed)
        } else {
            let [elbow, tip, hand] = seen.frames.watched_speeds(&state.dq, R::constant(TIP_REACH));
            let limit = R::constant(TIP_SPEED_LIMIT);
            (elbow > limit || tip > limit || hand > R::constant(HAND_SPEED_LIMIT)).then_some(Fault::TipSpeed)
        };
        if let Some(fault) = finding {
            return Some((Trigger::SoftFault, fault));
        }
        let trigger = if state.missing > 0 { Trigger::RepliesMissing } else { Trigger::RepliesBack };
        Some((trigger, Fault::None))
    }

    /// True if an encoder stands still; true if something pushes that the sensor does not see.
    fn disagrees(&mut self, follows_plan: bool, state: &JointState<R>, seen: &Observation<'_, R>) -> (bool, bool) {
        match &seen.effort {
            Some(effort) if state.missing == 0 => {
                let stuck = if state.still == 0 {
                    self.disagreement.all_turn();
                    false
                } else {
                    let environment = disagreement::torques_of(seen.wrench, seen.frames);
                    self.disagreement.encoder_stands_still(effort, &environment, seen.force, state.still)
                };
                // What the sensor tells where nothing goes by it may be a load that a tare took in another posture.
                let told = if seen.depends { seen.force } else { R::constant(0.0) };
                let pushed = if seen.blind {
                    self.disagreement.is_pushed(effort.feedback)
                } else if follows_plan && seen.carried && disagreement::is_large(effort.feedback, told) {
                    self.disagreement.is_contradicted(effort.feedback, unexplained(effort, seen))
                } else {
                    self.disagreement.forget_pushes();
                    false
                };
                (stuck, pushed)
            }
            Some(_) => (false, false),
            None => {
                self.disagreement.reset();
                (false, false)
            }
        }
    }
}

/// Torque that was sent against friction, and the part that turns no joint, each less what the sensor explains of it
/// (N m). A joint that is slowed down is no joint that is pushed: measured motion alone asks for more than is sent. Not
/// inlined: it is asked where the feedback is that of a push.
#[inline(never)]
fn unexplained<R: Real>(effort: &Effort<'_, R>, seen: &Observation<'_, R>) -> [Vector7<R>; 2] {
    let environment = disagreement::torques_of(seen.wrench, seen.frames);
    let explained = effort.pressing.map_or(environment, |pressing| environment + pressing);
    [effort.sent + explained, effort.resisted() + explained]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::guard::disagreement::Plan;
    use crate::model::arm::ArmModel;
    use crate::model::calibration::{Calibration, Payload};
    use crate::sense::observer::MotionObserver;
    use crate::units::{JointPositions, JointVelocities};

    const POSTURE: [f64; JOINTS] = [-0.49, 1.56, 1.47, 1.85, -0.17, -0.58, 1.75];

    const WITH_TORQUE: [State; 6] =
        [State::Gravity, State::Hold, State::Approach, State::Run, State::SoftStop, State::Lower];

    /// Laws in which the arm moves by itself.
    const MOVING: [State; 3] = [State::Hold, State::Approach, State::Run];

    /// An arm and what is seen of it.
    struct Scene {
        model: ArmModel<f64>,
        monitor: Monitor<f64>,
        bounds: JointBounds<f64>,
        state: JointState<f64>,
        force: f64,
        lag: (f64, f64),
        wrench_lost: bool,
        blind: bool,
        depends: bool,
        carried: bool,
        full_scale: bool,
        shakes: bool,
        /// Feedback torque and desired velocity.
        effort: Option<(Vector7<f64>, Vector7<f64>)>,
        /// Torque that was sent, unless it is the feedback.
        sent: Option<Vector7<f64>>,
        /// Torque of the force control.
        pressing: Vector7<f64>,
        wrench: Wrench<f64>,
    }

    impl Scene {
        /// An arm that rests in free air, its replies whole.
        fn calm() -> Self {
            let model = ArmModel::new(Payload::SensorAndHand);
            let q = JointPositions::from_array(POSTURE);
            let state = JointState::whole(q, JointVelocities::zero());
            let transmission = Calibration::nominal(Payload::SensorAndHand).transmission;
            Scene {
                bounds: JointBounds::around(&model, &q),
                monitor: Monitor::new(transmission),
                model,
                state,
                force: 0.0,
                lag: (0.0, 0.0),
                wrench_lost: false,
                blind: false,
                depends: true,
                carried: true,
                full_scale: false,
                shakes: false,
                effort: None,
                sent: None,
                pressing: Vector7::zeros(),
                wrench: Wrench::zero(),
            }
        }

        fn with(change: impl FnOnce(&mut Scene)) -> Self {
            let mut scene = Scene::calm();
            change(&mut scene);
            scene
        }

        /// The finding of one more cycle.
        fn check(&mut self, law: State) -> (Trigger, Fault) {
            let frames = Frames::new(&self.model, &self.state.q);
            let observer = MotionObserver::new();
            let effort = self.effort.as_ref().map(|(feedback, desired)| Effort {
                feedback,
                pressing: Some(&self.pressing),
                sent: self.sent.unwrap_or(*feedback),
                desired,
                breaking_away: 0,
                plan: Plan::Run { observer: &observer, friction: feedback },
            });
            let seen = Observation {
                frames: &frames,
                bounds: &self.bounds,
                force: self.force,
                wrench: &self.wrench,
                lag: self.lag,
                wrench_lost: self.wrench_lost,
                blind: self.blind,
                depends: self.depends,
                carried: self.carried,
                effort,
                full_scale: self.full_scale,
                shakes: self.shakes,
            };
            self.monitor.check(law, &self.state, &seen).expect("a finding in every state with torque")
        }
    }

    const NOTHING: (Trigger, Fault) = (Trigger::RepliesBack, Fault::None);

    fn stop(fault: Fault) -> (Trigger, Fault) {
        (Trigger::SoftFault, fault)
    }

    #[test]
    fn an_arm_that_rests_in_free_air_is_stopped_in_no_state() {
        for law in WITH_TORQUE {
            assert_eq!(Scene::calm().check(law), NOTHING, "{law}");
        }
    }

    #[test]
    fn g10_a_joint_that_shakes_stops_the_arm_in_every_state() {
        for law in WITH_TORQUE {
            assert_eq!(Scene::with(|scene| scene.shakes = true).check(law), stop(Fault::Shaking), "{law}");
        }
    }

    #[test]
    fn lost_replies_are_bridged_then_stop_the_arm_by_their_cause_and_then_take_torque_off() {
        let silent = |age, stuck, implausible| {
            Scene::with(|scene| {
                scene.state = JointState { age, missing: 1, stuck, implausible, ..scene.state };
            })
            .check(State::Run)
        };
        assert_eq!(silent(COAST_CYCLES, true, true), (Trigger::RepliesMissing, Fault::None));
        for age in [COAST_CYCLES + 1, COAST_CYCLES + 2, SILENCE_CYCLES] {
            assert_eq!(silent(age, false, false), stop(Fault::RepliesLost), "{age}");
            assert_eq!(silent(age, false, true), stop(Fault::ImplausiblePosition), "{age}");
            assert_eq!(silent(age, true, true), stop(Fault::EncoderStuck), "{age}");
        }
        for age in [SILENCE_CYCLES + 1, SILENCE_CYCLES + 2] {
            assert_eq!(silent(age, true, true), (Trigger::HardFault, Fault::RepliesLostForLong), "{age}");
        }
    }

    #[test]
    fn a_lost_zero_stops_every_state_but_lowering() {
        for law in WITH_TORQUE {
            let expected = if law == State::Lower { NOTHING } else { stop(Fault::ImplausiblePosition) };
            assert_eq!(Scene::with(|scene| scene.state.displaced = true).check(law), expected, "{law}");
        }
    }

    #[test]
    fn the_second_sample_beyond_the_force_limit_or_at_full_scale_stops_what_moves_by_itself() {
        for law in WITH_TORQUE {
            let expected = if MOVING.contains(&law) { stop(Fault::ContactForce) } else { NOTHING };
            for (force, full_scale) in [(1.001 * FORCE_LIMIT, false), (0.0, true)] {
                let mut scene = Scene::with(|scene| (scene.force, scene.full_scale) = (force, full_scale));
                assert_eq!(scene.check(law), NOTHING, "{law}: one sample may be corrupt");
                assert_eq!(scene.check(law), expected, "{law}");
                assert_eq!(scene.check(law), expected, "{law}");
                (scene.force, scene.full_scale) = (FORCE_LIMIT, false);
                assert_eq!(scene.check(law), NOTHING, "{law}: the limit itself is allowed");
            }
        }
    }

    #[test]
    fn a_force_measured_before_the_sensor_fell_silent_stops_nothing() {
        let mut scene = Scene::with(|scene| {
            (scene.blind, scene.force, scene.full_scale) = (true, 2.0 * FORCE_LIMIT, true);
        });
        for _ in 0..5 {
            assert_eq!(scene.check(State::Run), NOTHING);
        }
    }

    #[test]
    fn a_joint_beyond_its_bound_stops_what_moves_by_itself_and_nothing_else() {
        for law in WITH_TORQUE {
            let expected = if MOVING.contains(&law) { stop(Fault::JointLimit) } else { NOTHING };
            let mut beyond = Scene::with(|scene| scene.state.q.0[6] = scene.model.soft_max[6] + 0.03);
            assert_eq!(beyond.check(law), expected, "{law}");
        }
    }

    #[test]
    fn a_lost_wrench_stops_an_approach_and_a_run_alone() {
        for law in WITH_TORQUE {
            let moves = matches!(law, State::Approach | State::Run);
            let expected = if moves { stop(Fault::WrenchLost) } else { NOTHING };
            assert_eq!(Scene::with(|scene| scene.wrench_lost = true).check(law), expected, "{law}");
        }
    }

    #[test]
    fn a_run_ends_where_its_plan_is_too_far_or_too_fast_for_the_tool() {
        for law in WITH_TORQUE {
            let run = if law == State::Run { stop(Fault::TrackingError) } else { NOTHING };
            for (lag, expected) in [
                ((TRACKING_LIMIT, LAG_LIMIT), NOTHING),
                ((1.001 * TRACKING_LIMIT, 0.0), run),
                ((0.0, 1.001 * LAG_LIMIT), run),
            ] {
                assert_eq!(Scene::with(|scene| scene.lag = lag).check(law), expected, "{law} {lag:?}");
            }
        }
    }

    #[test]
    fn a_joint_of_the_wrist_may_turn_by_a_fifth_beyond_its_speed_limit_either_way_and_no_faster() {
        for joint in 4..JOINTS {
            let limit = wam7::VELOCITY_MAX[joint] * SPEED_MARGIN;
            for (speed, expected) in [
                (limit, NOTHING),
                (-limit, NOTHING),
                (1.001 * limit, stop(Fault::JointSpeed)),
                (-1.001 * limit, stop(Fault::JointSpeed)),
            ] {
                let mut scene = Scene::with(|scene| scene.state.dq.0[joint] = speed);
                assert_eq!(scene.check(State::Gravity), expected, "J{} at {speed}", joint + 1);
            }
        }
    }

    #[test]
    fn neither_the_elbow_nor_the_forearm_may_be_fast_whichever_is_the_faster() {
        // Folded, the elbow is farther from the shoulder than the forearm; stretched, the forearm is.
        for (elbow, is_elbow) in [(2.9, true), (0.0, false)] {
            let mut scene = Scene::with(|scene| scene.state.q.0[3] = elbow);
            scene.state.dq.0[1] = 1.0;
            let frames = Frames::new(&scene.model, &scene.state.q);
            let [of_elbow, of_forearm, _] = frames.watched_speeds(&scene.state.dq, TIP_REACH);
            assert_eq!(of_elbow > of_forearm, is_elbow, "{of_elbow} {of_forearm}");
            let allowed = TIP_SPEED_LIMIT / f64::max(of_elbow, of_forearm);
            for (share, expected) in [(0.999, NOTHING), (1.001, stop(Fault::TipSpeed))] {
                scene.state.dq.0[1] = share * allowed;
                assert!(scene.state.dq.0[1] < wam7::VELOCITY_MAX[1] * SPEED_MARGIN);
                assert_eq!(scene.check(State::Gravity), expected, "{share}");
            }
        }
    }

    #[test]
    fn g14_the_hand_may_not_be_fast_where_elbow_and_forearm_are_slow() {
        for law in WITH_TORQUE {
            // J4 and J6 turn the same way: neither is beyond its own limit, and the elbow stands still.
            let mut scene = Scene::with(|scene| (scene.state.dq.0[3], scene.state.dq.0[5]) = (1.0, 1.0));
            let frames = Frames::new(&scene.model, &scene.state.q);
            let [elbow, tip, hand] = frames.watched_speeds(&scene.state.dq, TIP_REACH);
            let allowed = HAND_SPEED_LIMIT / hand;
            assert!(allowed * elbow.max(tip) < TIP_SPEED_LIMIT, "{elbow} {tip} {hand}");
            for (share, expected) in [(0.999, NOTHING), (1.001, stop(Fault::TipSpeed))] {
                (scene.state.dq.0[3], scene.state.dq.0[5]) = (share * allowed, share * allowed);
                assert_eq!(scene.check(law), expected, "{law} {share}");
            }
        }
    }

    /// The finding after a while in which the encoder of M4 does not change: its feedback has swung by ten times the
    /// friction. `missing` replies in each cycle.
    fn standing(missing: u8, still: u8) -> (Trigger, Fault) {
        let mut desired = Vector7::zeros();
        desired[3] = 0.5;
        let mut scene = Scene::with(|scene| {
            (scene.state.missing, scene.state.still) = (missing, still);
            scene.effort = Some((Vector7::zeros(), desired));
        });
        assert_ne!(scene.check(State::Run).1, Fault::EncoderStuck);
        let mut swung = Vector7::zeros();
        swung[3] = 10.0 * wam7::FRICTION_COULOMB[3];
        scene.effort = Some((swung, desired));
        for _ in 0..few_periods(0.1) {
            scene.check(State::Run);
        }
        scene.check(State::Run)
    }

    #[test]
    fn a_motor_that_stands_against_its_torque_stops_the_arm_unless_a_reply_is_missing() {
        assert_eq!(standing(0, 0b1000), stop(Fault::EncoderStuck));
        assert_eq!(standing(0, 0), stop(Fault::UnseenContact), "it turns: something else holds it back");
        assert_eq!(standing(1, 0b1000), (Trigger::RepliesMissing, Fault::None));
    }

    /// The finding after a while in which J2 feeds back `torque` (N m), where nothing else is wrong.
    fn pressed_by(law: State, torque: f64, change: impl FnOnce(&mut Scene)) -> (Trigger, Fault) {
        let mut feedback = Vector7::zeros();
        feedback[1] = torque;
        let mut scene = Scene::with(|scene| scene.effort = Some((feedback, Vector7::zeros())));
        change(&mut scene);
        for _ in 0..few_periods(0.1) {
            scene.check(law);
        }
        scene.check(law)
    }

    #[test]
    fn a_push_is_looked_for_in_the_torque_while_the_sensor_is_silent_or_the_arm_follows_a_plan() {
        for law in MOVING {
            assert_eq!(pressed_by(law, 100.0, |scene| scene.blind = true), stop(Fault::UnseenContact), "{law}");
            let expected = if law == State::Hold { NOTHING } else { stop(Fault::UnseenContact) };
            assert_eq!(pressed_by(law, 100.0, |_| ()), expected, "{law}");
            assert_eq!(pressed_by(law, 100.0, |scene| scene.carried = false), NOTHING, "{law}");
        }
        // A joint that brakes itself is not pushed: what was sent is little.
        assert_eq!(pressed_by(State::Run, 100.0, |scene| scene.sent = Some(Vector7::zeros())), NOTHING);
    }

    #[test]
    fn what_the_sensor_measures_or_the_force_control_presses_is_no_unseen_push() {
        let scene = Scene::calm();
        let frames = Frames::new(&scene.model, &scene.state.q);
        let wrench = Wrench { force: nalgebra::Vector3::new(0.0, 0.0, -40.0), ..Wrench::zero() };
        let torques = -disagreement::torques_of(&wrench, &frames);
        assert!(torques[1] < -20.0, "{torques} N m");
        let found = |wrench, pressing| {
            pressed_by(State::Run, 0.0, |scene| {
                scene.effort = Some((torques, Vector7::zeros()));
                (scene.wrench, scene.pressing) = (wrench, pressing);
            })
        };
        assert_eq!(found(wrench, Vector7::zeros()), NOTHING, "carried, and measured");
        assert_eq!(found(Wrench::zero(), Vector7::zeros()), stop(Fault::UnseenContact), "carried, and not measured");
        assert_eq!(found(Wrench::zero(), -torques), NOTHING, "pressed against by the force control");
        let turned = Wrench { force: -wrench.force, ..wrench };
        assert_eq!(found(turned, Vector7::zeros()), stop(Fault::UnseenContact), "a sensor with the wrong sign");
        // A push of which the joints know nothing.
        let told = |force| {
            pressed_by(State::Run, 0.0, |scene| {
                (scene.wrench, scene.force) = (wrench, force);
            })
        };
        assert_eq!((told(40.0), told(5.0)), (NOTHING, NOTHING), "not for a tenth of a second");
        let mut scene = Scene::with(|scene| {
            (scene.wrench, scene.force) = (wrench, 40.0);
            scene.effort = Some((Vector7::zeros(), Vector7::zeros()));
        });
        let found = (1..=few_periods(0.5)).find(|_| scene.check(State::Run) == stop(Fault::UnseenContact));
        assert_eq!(found, Some(few_periods(0.2)));
        // A load that a tare took in another posture: nothing goes by what the sensor tells.
        scene.depends = false;
        assert!((1..=few_periods(0.5)).all(|_| scene.check(State::Run) == NOTHING));
    }
}
