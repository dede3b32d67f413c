//! `Disagreement`: torque and motion that do not fit together, without the help of the force sensor.
//!
//! Two things are seen in the torque that the joint feedback asks for. It swings by more than friction can hold back
//! while an encoder does not change by a count: that encoder stands still (A8). And it is several times the friction:
//! somebody or something pushes, which nobody else sees while the force sensor is silent (G8).

use puck::Transmission;

use crate::model::friction::{self, SWING};
use crate::model::kinematics::Frames;
use crate::model::wam7;
use crate::real::{Real, at_least};
use crate::sense::observer::MotionObserver;
use crate::time::few_periods;
use crate::units::{JOINTS, Vector6, Vector7, Wrench};

/// Desired speed of a motor from which on it has to turn (rad/s): 0.02 to 0.06 rad/s of the joint. A motor that is to
/// stand may be held by contact, whatever its torque does: closing fingers and a table swing it by more than friction.
const MOVING: f64 = 1.0;

/// Time for which the swing of a motor that breaks away has to be too large: friction lets go of it a moment before it
/// has turned by a count. 25 ms, in control periods.
const LETTING_GO: u8 = few_periods(0.025);

/// Largest swing of a motor that a plan moves, in parts of [`SWING`]: all joints move at once, up to half of their
/// limits, and what the model does not know of the dynamics swings with them.
const IN_MOTION: f64 = 3.5 / SWING;

/// Torque that friction does not take, in parts of [`SWING`]: other joints that speed up or slow down turn one as well,
/// those of a stretched arm by more than its friction.
const RESISTED: f64 = 1.2 / SWING;

/// Swing of the torque that measured motion asks for in an approach, beyond which the one that was sent is not looked
/// at, in parts of [`SWING`]: a motor that runs away unseen is damped by what the observer believes, and time presses.
const UNDENIABLE: f64 = 4.0 / SWING;

/// Swing of the torque of the environment from which on a motor meets something, in parts of the largest swing.
const TOUCHED: f64 = 0.25;

/// Largest swing of a motor that meets something, in parts of [`SWING`]: the arm is slowed down within some cycles, and
/// the wrench is filtered.
const IN_CONTACT: f64 = 1.5;

/// Force (N) that explains why a motor does not turn, whatever its torque does.
const CONTACT: f64 = 10.0;

/// Time behind such a force for which the arm swings back, and no swing means anything: 0.15 s, in control periods.
const SWINGS_BACK: u8 = few_periods(0.15);

/// Time without a count, before a swing means anything: 50 ms, in control periods.
const STILL: u8 = few_periods(0.05);

/// Feedback torque of a joint that means a push where no sensor tells of one, in parts of the model's friction: nominal
/// motions stay below 2.5.
const PUSH: f64 = 3.5;

/// The same of J1 to J4 beside a sensor (N m), once what it measures is taken off: elbow and forearm meet something.
/// Friction, a kilogram at the hand that the tare took away, and masses that differ by a tenth stay below.
const UNSEEN: [f64; 4] = [7.5, 14.0, 11.0, 7.0];

/// Part of that torque which turns no joint where one meets something.
const MET: f64 = 0.5;

/// Measured force (N) of which the joints have to know.
const TOLD: f64 = 5.0;

/// Time for which they may not: a push first sets the arm in motion. 0.2 s, in control periods.
const CONTRADICTING: u8 = few_periods(0.2);

/// Time for which the feedback has to push: 10 ms, in control periods.
const PUSHING: u8 = few_periods(0.01);

/// Control periods for which one with such a feedback counts.
const OBVIOUS: u8 = CONTRADICTING / PUSHING;

/// Source of the motion that is asked of the joints.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Plan<'a, R: Real> {
    /// A posture that is held, or approached.
    Approach,
    /// A primitive.
    Run {
        /// Knows what the motion of all joints leaves of the torque that was sent.
        observer: &'a MotionObserver<R>,
        /// Friction that was fed forward (N m).
        friction: &'a Vector7<R>,
    },
}

/// Torques and motion that a law asks of the joints.
pub(crate) struct Effort<'a, R: Real> {
    /// Torque of the joint feedback as measured motion alone asks for it (N m).
    pub(crate) feedback: &'a Vector7<R>,
    /// Torque that was sent against friction (N m): fed back, and in an approach fed forward, and added for a motor to
    /// break away.
    pub(crate) sent: Vector7<R>,
    /// Torque of the force control (N m), if there is one: it presses on the environment.
    pub(crate) pressing: Option<&'a Vector7<R>>,
    /// Desired velocity (rad/s).
    pub(crate) desired: &'a Vector7<R>,
    /// Motors that are made to break away, one bit each, M1 lowest.
    pub(crate) breaking_away: u8,
    /// Where the motion comes from.
    pub(crate) plan: Plan<'a, R>,
}

/// Joint torques (N m) of the wrench of the environment at the grasp point. Not inlined, as what asks for them.
#[inline(never)]
pub(crate) fn torques_of<R: Real>(wrench: &Wrench<R>, frames: &Frames<R>) -> Vector7<R> {
    let (force, torque) = (wrench.force, frames.tool_to_world() * wrench.torque);
    frames.joint_torques(&Vector6::new(force.x, force.y, force.z, torque.x, torque.y, torque.z)).0
}

/// Compares the feedback torque with the motion.
#[derive(Clone, Debug)]
pub(crate) struct Disagreement<R: Real> {
    transmission: Transmission<R>,
    /// Largest swing of each motor (N m at the motor).
    swing: [R; JOINTS],
    /// Torques of each motor at its last count, as asked for, as sent, and of the environment as measured (N m).
    anchor: [(R, R, R); JOINTS],
    /// Control periods since.
    still: [u8; JOINTS],
    /// Control periods for which the swing of each motor has been too large.
    beyond: [u8; JOINTS],
    /// Control periods for which the arm still swings back from what has pushed it.
    swings_back: u8,
    /// Control periods for which something has pushed, one with its feedback being [`OBVIOUS`].
    pushing: u8,
}

impl<R: Real> Effort<'_, R> {
    /// The part of what was sent (N m) that turns no joint, as the measured motion of all of them tells it, but for
    /// what presses on the environment.
    #[cold]
    #[inline(never)]
    pub(crate) fn resisted(&self) -> Vector7<R> {
        let Plan::Run { observer, friction } = self.plan else { return self.sent };
        let resisted = friction - observer.unknown();
        self.pressing.map_or(resisted, |pressing| resisted - pressing)
    }

    /// True if the torque of a motor that turns no joint is more than friction takes; `limit` is the swing of friction
    /// (N m).
    #[cold]
    #[inline(never)]
    fn is_resisted(&self, transmission: &Transmission<R>, motor: usize, limit: R) -> bool {
        let torques = transmission.motor_torques_from_joint(&self.resisted().into());
        torques.get(motor).is_some_and(|torque| at_least(*torque, -*torque) > limit * R::constant(RESISTED))
    }
}

impl<R: Real> Disagreement<R> {
    /// Nothing seen yet, on an arm with this transmission.
    pub(crate) fn new(transmission: Transmission<R>) -> Self {
        let zero = R::constant(0.0);
        let swing = friction::at_motors(&transmission).map(|friction| friction * R::constant(SWING));
        Disagreement {
            transmission,
            swing,
            anchor: [(zero, zero, zero); JOINTS],
            still: [0; JOINTS],
            beyond: [0; JOINTS],
            swings_back: 0,
            pushing: 0,
        }
    }

    /// Forgets what was seen: no feedback acts.
    pub(crate) fn reset(&mut self) {
        self.still = [0; JOINTS];
        self.swings_back = 0;
        self.forget_pushes();
    }

    /// Forgets what has pushed until now.
    pub(crate) fn forget_pushes(&mut self) {
        self.pushing = 0;
    }

    /// Every motor has turned.
    pub(crate) fn all_turn(&mut self) {
        (self.still, self.beyond) = ([0; JOINTS], [0; JOINTS]);
    }

    /// Takes what the law asks of the joints, the torque (N m) and the magnitude of the force (N) that the environment
    /// is measured to apply, and the motors whose counts have not changed, one bit each; true if an encoder stands
    /// still while its motor cannot.
    ///
    /// The torque of the environment swings with that of the law, and is no friction: an arm that runs into something
    /// stands still as well.
    ///
    /// Not inlined: it is asked where a motor stands.
    #[inline(never)]
    pub(crate) fn encoder_stands_still(
        &mut self,
        effort: &Effort<'_, R>,
        environment: &Vector7<R>,
        force: R,
        unchanged: u8,
    ) -> bool {
        let is_pushed = force > R::constant(CONTACT);
        self.swings_back = if is_pushed { SWINGS_BACK } else { self.swings_back.saturating_sub(1) };
        if self.swings_back > 0 {
            self.all_turn();
            return false;
        }
        let asked = self.transmission.motor_torques_from_joint(&(*effort.feedback).into());
        let sent = self.transmission.motor_torques_from_joint(&effort.sent.into());
        let outside = effort.pressing.map_or(*environment, |pressing| environment + pressing);
        let environment = self.transmission.motor_torques_from_joint(&outside.into());
        let speeds = self.transmission.motor_from_joint(&(*effort.desired).into());
        let mut stuck = false;
        let state = self.still.iter_mut().zip(&mut self.beyond).zip(&mut self.anchor);
        let torques = self.swing.iter().zip(asked.into_iter().zip(sent).zip(environment)).zip(speeds);
        for (motor, (((still, beyond), anchor), ((limit, ((asked, sent), outside)), speed))) in
            state.zip(torques).enumerate()
        {
            let breaks_away = effort.breaking_away >> motor & 1 != 0;
            let is_to_turn = breaks_away || at_least(speed, -speed) >= R::constant(MOVING);
            if unchanged >> motor & 1 == 0 || !is_to_turn {
                (*still, *beyond) = (0, 0);
                continue;
            }
            if *still == 0 {
                *anchor = (asked, sent, outside);
            }
            *still = still.saturating_add(1);
            // What the environment takes of a torque is no friction; the joints that it slows down swing as well.
            let outside = outside - anchor.2;
            let touched = at_least(outside, -outside) > *limit * R::constant(TOUCHED);
            let limit = if touched { *limit * R::constant(IN_CONTACT) } else { *limit };
            let swings = |now: R, then: R, share: f64| {
                let (swing, limit) = (now - then, limit * R::constant(share));
                let rest = swing + outside;
                at_least(swing, -swing) > limit && at_least(rest, -rest) > limit
            };
            let (asked, sent) = ((asked, anchor.0), (sent, anchor.1));
            // What the observer believes, and what was fed forward, may have made up for what was asked for.
            let both = || swings(asked.0, asked.1, IN_MOTION) && swings(sent.0, sent.1, IN_MOTION);
            let too_far = match effort.plan {
                _ if breaks_away => swings(sent.0, sent.1, 1.0),
                Plan::Run { .. } => {
                    swings(asked.0, asked.1, IN_MOTION) && effort.is_resisted(&self.transmission, motor, limit)
                }
                Plan::Approach => both() || swings(asked.0, asked.1, UNDENIABLE),
            };
            *beyond = if too_far { beyond.saturating_add(1) } else { 0 };
            stuck |= *still > STILL && *beyond > if breaks_away { LETTING_GO } else { 0 };
        }
        stuck
    }

    /// True if the feedback torque (N m) has been that of a push for 10 ms. Not inlined: it is asked while the sensor
    /// is silent.
    #[inline(never)]
    pub(crate) fn is_pushed(&mut self, feedback: &Vector7<R>) -> bool {
        let pushes = exceeds(feedback, wam7::FRICTION_COULOMB.map(|friction| PUSH * friction));
        self.goes_on(if pushes { OBVIOUS } else { 0 })
    }

    /// The same beside a sensor: `sent` is what was sent against friction, and `resisted` the part of it that turns no
    /// joint, both less what the sensor explains (N m). True as well if the sensor has told for 0.2 s of a push that
    /// the joints do not know of.
    ///
    /// Not inlined: it is asked where [`is_large`] says so.
    #[inline(never)]
    pub(crate) fn is_contradicted(&mut self, feedback: &Vector7<R>, [sent, resisted]: [Vector7<R>; 2]) -> bool {
        self.goes_on(match (exceeds(&sent, UNSEEN), exceeds(feedback, UNSEEN)) {
            // A joint that is turned round is no joint that is pushed.
            (true, true) if !exceeds(&resisted, UNSEEN.map(|torque| MET * torque)) => 0,
            (true, true) => OBVIOUS,
            (true, false) => 1,
            (false, _) => 0,
        })
    }

    /// Takes for how many control periods this one counts; true if something has pushed for long enough.
    fn goes_on(&mut self, periods: u8) -> bool {
        self.pushing = if periods > 0 { self.pushing.saturating_add(periods) } else { 0 };
        self.pushing >= CONTRADICTING
    }
}

/// True if the feedback torque (N m) or the measured force (N) is that of a push.
pub(crate) fn is_large<R: Real>(feedback: &Vector7<R>, force: R) -> bool {
    force > R::constant(TOLD) || exceeds(feedback, UNSEEN)
}

/// True if the torque of a joint (N m) is beyond its bar.
fn exceeds<R: Real, const N: usize>(torques: &Vector7<R>, bars: [f64; N]) -> bool {
    torques.iter().zip(bars).any(|(torque, bar)| {
        let bar = R::constant(bar);
        *torque > bar || *torque < -bar
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::calibration::{Calibration, Payload};

    /// Everything here happens at J4, which M4 turns alone.
    const J4: usize = 3;
    const M4: u8 = 1 << J4;

    /// Torques of a law at J4, in parts of the model's friction, and the motion it asks for (rad/s).
    #[derive(Clone, Copy)]
    struct Asked {
        feedback: f64,
        sent: f64,
        speed: f64,
        breaking_away: u8,
        runs: bool,
    }

    const RUN: Asked = Asked { feedback: 0.0, sent: 0.0, speed: 0.3, breaking_away: 0, runs: true };
    const APPROACH: Asked = Asked { runs: false, ..RUN };
    const BREAKING_AWAY: Asked = Asked { speed: 0.0, breaking_away: M4, ..APPROACH };

    /// The torque swings by this much of the friction, in what is asked for and in what is sent.
    fn swung(by: f64, from: Asked) -> Asked {
        Asked { feedback: from.feedback + by, sent: from.sent + by, ..from }
    }

    fn new() -> Disagreement<f64> {
        Disagreement::new(Calibration::nominal(Payload::SensorAndHand).transmission)
    }

    fn at_j4(value: f64) -> Vector7<f64> {
        let mut joints = Vector7::zeros();
        joints[J4] = value;
        joints
    }

    /// One cycle in which nothing is touched; true if an encoder stands still.
    fn take(seen: &mut Disagreement<f64>, asked: &Asked, force: f64, unchanged: u8) -> bool {
        take_touching(seen, asked, (0.0, 0.0), force, unchanged)
    }

    /// The same with torques of the environment and of the force control at J4, in parts of its friction.
    fn take_touching(
        seen: &mut Disagreement<f64>,
        asked: &Asked,
        (environment, pressing): (f64, f64),
        force: f64,
        unchanged: u8,
    ) -> bool {
        let friction = wam7::FRICTION_COULOMB[J4];
        let (feedback, desired) = (at_j4(asked.feedback * friction), at_j4(asked.speed));
        let pressing = at_j4(pressing * friction);
        let observer = MotionObserver::new();
        let forward = at_j4(asked.sent * friction) + pressing;
        let effort = Effort {
            feedback: &feedback,
            sent: at_j4(asked.sent * friction),
            pressing: Some(&pressing),
            desired: &desired,
            breaking_away: asked.breaking_away,
            plan: if asked.runs { Plan::Run { observer: &observer, friction: &forward } } else { Plan::Approach },
        };
        seen.encoder_stands_still(&effort, &at_j4(environment * friction), force, unchanged)
    }

    /// Number of the cycle in which M4 is found after `first`, once `then` is asked for; `None` within a second.
    fn found(first: &Asked, then: &Asked) -> Option<u8> {
        let mut seen = new();
        assert!(!take(&mut seen, first, 0.0, M4));
        (2..=few_periods(0.5)).find(|_| take(&mut seen, then, 0.0, M4))
    }

    #[test]
    fn feedback_of_a_run_has_to_swing_by_three_and_a_half_times_the_friction_and_to_turn_nothing() {
        for sign in [1.0, -1.0] {
            let from = Asked { feedback: -sign, sent: -sign, ..RUN };
            for (feedback, sent, expected) in [
                (2.6, 1.3, Some(STILL + 1)),
                // It may be against what was fed forward, or other joints.
                (2.6, -1.3, Some(STILL + 1)),
                // Three times the friction of the model may hold it, with what other joints swing.
                (2.4, 9.0, None),
                // Friction takes it all, or other joints are turned by it.
                (9.0, 1.1, None),
                (9.0, -1.1, None),
            ] {
                let then = Asked { feedback: feedback * sign, sent: sent * sign, ..RUN };
                assert_eq!(found(&from, &then), expected, "{feedback} {sent} {sign}");
            }
            // A large torque that stays is no swing.
            let steady = Asked { feedback: 9.0 * sign, sent: 9.0 * sign, ..RUN };
            assert_eq!(found(&steady, &steady), None);
        }
    }

    #[test]
    fn in_an_approach_both_torques_have_to_swing_unless_one_is_undeniable() {
        for sign in [1.0, -1.0] {
            for (feedback, sent, is_found) in [
                (3.6, 3.6, true),
                (3.4, 3.4, false),
                (3.6, 3.4, false),
                (3.4, 3.6, false),
                (3.9, 0.0, false),
                (4.1, 0.0, true),
            ] {
                let then = Asked { feedback: feedback * sign, sent: sent * sign, ..APPROACH };
                assert_eq!(found(&APPROACH, &then).is_some(), is_found, "{feedback} {sent} {sign}");
            }
        }
    }

    #[test]
    fn a_motor_that_breaks_away_is_judged_by_what_was_sent_for_long_enough() {
        assert_eq!(found(&BREAKING_AWAY, &Asked { sent: 3.1, ..BREAKING_AWAY }), Some(STILL + 1));
        assert_eq!(found(&BREAKING_AWAY, &Asked { sent: 2.9, ..BREAKING_AWAY }), None);
        assert_eq!(found(&BREAKING_AWAY, &Asked { feedback: 9.0, ..BREAKING_AWAY }), None);
        let others = Asked { breaking_away: !M4, ..BREAKING_AWAY };
        assert_eq!(found(&others, &swung(9.0, others)), None, "another motor breaks away");
        // A swing that comes late has to last.
        let mut seen = new();
        for _ in 0..2 * STILL {
            assert!(!take(&mut seen, &BREAKING_AWAY, 0.0, M4));
        }
        for _ in 0..LETTING_GO {
            assert!(!take(&mut seen, &swung(3.1, BREAKING_AWAY), 0.0, M4));
        }
        assert!(take(&mut seen, &swung(3.1, BREAKING_AWAY), 0.0, M4));
    }

    #[test]
    fn a_motor_that_is_to_stand_or_has_turned_is_not_looked_at() {
        for (speed, is_found) in [(0.3, true), (-0.3, true), (0.0, false), (0.03, false), (-0.03, false)] {
            let from = Asked { speed, ..RUN };
            assert_eq!(found(&from, &swung(9.0, from)).is_some(), is_found, "{speed} rad/s");
        }
        let mut seen = new();
        take(&mut seen, &RUN, 0.0, M4);
        for cycle in 0..=2 * STILL {
            // Every other motor stands; M4 turns once in a while.
            let unchanged = if cycle % STILL == 0 { !M4 } else { M4 };
            assert!(!take(&mut seen, &swung(9.0, RUN), 0.0, unchanged), "{cycle}");
        }
    }

    #[test]
    fn a_contact_explains_a_motor_that_stands_and_the_time_begins_anew_once_the_arm_has_swung_back() {
        for (force, expected) in [(CONTACT, true), (1.001 * CONTACT, false)] {
            let mut seen = new();
            take(&mut seen, &RUN, force, M4);
            let found = (0..2 * STILL).any(|_| take(&mut seen, &swung(9.0, RUN), force, M4));
            assert_eq!(found, expected, "{force} N");
        }
        let mut seen = new();
        take(&mut seen, &RUN, 0.0, M4);
        take(&mut seen, &swung(9.0, RUN), 2.0 * CONTACT, M4);
        for _ in 1..SWINGS_BACK {
            assert!(!take(&mut seen, &swung(9.0, RUN), 0.0, M4));
        }
        take(&mut seen, &RUN, 0.0, M4);
        for _ in 1..STILL {
            assert!(!take(&mut seen, &swung(9.0, RUN), 0.0, M4));
        }
        assert!(take(&mut seen, &swung(9.0, RUN), 0.0, M4));
    }

    #[test]
    fn what_the_environment_takes_of_a_torque_and_what_presses_on_it_is_no_friction() {
        // Swing of the feedback, of the environment and of the force control, in parts of the friction.
        for (swing, environment, pressing, is_found) in [
            (3.6, 0.0, 0.0, true),
            (3.6, -0.7, 0.0, false),
            (3.6, 0.7, 0.0, true),
            // Something is met: half as much again, with it and without it.
            (5.2, 0.8, 0.0, false),
            (5.3, 0.8, 0.0, true),
            (6.0, -0.8, 0.0, false),
            (6.1, -0.8, 0.0, true),
            (9.0, -5.0, 0.0, false),
            (9.0, 0.0, -5.0, false),
            (9.0, -5.0, 5.0, true),
        ] {
            for sign in [1.0, -1.0] {
                let mut seen = new();
                take_touching(&mut seen, &RUN, (1.0, -2.0), 0.0, M4);
                let outside = (1.0 + sign * environment, -2.0 + sign * pressing);
                let then = swung(sign * swing, RUN);
                let found = (0..2 * STILL).any(|_| take_touching(&mut seen, &then, outside, 0.0, M4));
                assert_eq!(found, is_found, "{swing} {environment} {pressing} {sign}");
            }
        }
    }

    #[test]
    fn a_torque_of_three_and_a_half_times_the_friction_of_a_joint_for_10_ms_is_a_push() {
        for (joint, friction) in wam7::FRICTION_COULOMB.into_iter().enumerate() {
            let bar = PUSH * friction;
            for (torque, expected) in
                [(bar, None), (-bar, None), (1.001 * bar, Some(PUSHING)), (-1.001 * bar, Some(PUSHING))]
            {
                let mut feedback = Vector7::zeros();
                feedback[joint] = torque;
                let mut seen = new();
                let found = (1..=3 * PUSHING).find(|_| seen.is_pushed(&feedback));
                assert_eq!(found, expected, "J{}: {torque} N m", joint + 1);
            }
        }
    }

    #[test]
    fn beside_a_sensor_a_push_is_what_its_wrench_does_not_explain_of_j1_to_j4() {
        let at = |joint: usize, torque: f64| {
            let mut joints = Vector7::zeros();
            joints[joint] = torque;
            joints
        };
        let found = |feedback: Vector7<f64>, rest: Vector7<f64>| {
            let mut seen = new();
            (1..=2 * CONTRADICTING).find(|_| seen.is_contradicted(&feedback, [rest; 2]))
        };
        for (joint, bar) in UNSEEN.into_iter().enumerate() {
            for sign in [1.0, -1.0] {
                let (bar, more) = (at(joint, sign * bar), at(joint, 1.001 * sign * bar));
                assert_eq!(found(more, more), Some(PUSHING), "J{}", joint + 1);
                assert_eq!(found(bar, more), Some(CONTRADICTING), "J{}: the sensor tells of a push", joint + 1);
                assert_eq!(found(more, bar), None, "J{}: the sensor explains it", joint + 1);
                assert!(is_large(&more, 0.0) && !is_large(&bar, TOLD), "J{}", joint + 1);
            }
        }
        for joint in UNSEEN.len()..JOINTS {
            assert_eq!(found(at(joint, 1e3), at(joint, 1e3)), None, "J{}", joint + 1);
        }
        assert!(is_large(&Vector7::zeros(), 1.001 * TOLD));
    }

    #[test]
    fn what_was_seen_is_forgotten_where_no_feedback_acts_and_where_the_push_ends() {
        let large = Vector7::repeat(100.0);
        let ends: [fn(&mut Disagreement<f64>); 2] =
            [Disagreement::reset, |seen| assert!(!seen.is_pushed(&Vector7::zeros()))];
        for end in ends {
            let mut seen = new();
            for _ in 0..2 {
                for _ in 1..PUSHING {
                    assert!(!seen.is_pushed(&large));
                }
                end(&mut seen);
            }
        }
    }
}
