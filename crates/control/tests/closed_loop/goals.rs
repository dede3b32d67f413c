//! Goals that are changed at any time (faults G9 and H4): no limit is broken, they are reached, flags tell the truth.

use control::command::{Command, RunOptions};
use control::guard::monitor::{TIP_REACH, TIP_SPEED_LIMIT};
use control::model::{ArmModel, Frames, VELOCITY_MAX};
use control::units::{JointPositions, JointVelocities};
use control::{Event, Fault, Goal, PERIOD, Payload, State, flags};
use nalgebra::Vector3;

use crate::primitives::{Design, GOAL, START, adapting, primitive};
use crate::rig::Rig;

/// Repeatable numbers from 0 to 1.
pub(crate) struct Dice(u64);

impl Dice {
    /// Those of a seed.
    pub(crate) fn new(seed: u64) -> Self {
        let mut dice = Dice(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
        // The first ones of neighbouring seeds are alike.
        for _ in 0..10 {
            dice.roll();
        }
        dice
    }

    pub(crate) fn roll(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A place in a ball.
    pub(crate) fn place(&mut self, radius: f64) -> Vector3<f64> {
        loop {
            let place = Vector3::from_fn(|_, _| 2.0 * self.roll() - 1.0);
            if place.norm() <= 1.0 {
                return place * radius;
            }
        }
    }
}

/// A rig at the start of the movement, that holds.
fn ready(duration: f64, feels: bool) -> Rig<f32> {
    let mut rig = Rig::<f32>::new(START, 1);
    rig.command(Command::Hold);
    rig.run_for(1.0);
    let expected = feels.then_some([0.0; 6]);
    rig.load(&primitive(&Design { duration, expected, ..Design::default() })).expect("loads");
    rig
}

/// The worst of a run.
#[derive(Default, Debug)]
struct Worst {
    /// Part of the speed limits of the joints.
    joint: f64,
    /// Speed of the hand (m/s).
    hand: f64,
    /// Angular speed of the hand (rad/s).
    turn: f64,
    /// Speeds of elbow and forearm (m/s).
    tip: f64,
    /// Acceleration of the plan (m/s^2).
    acceleration: f64,
}

impl Worst {
    fn see(&mut self, rig: &Rig<f32>) {
        let dq = rig.plant.dq;
        for (dq, limit) in dq.iter().zip(VELOCITY_MAX) {
            self.joint = self.joint.max(dq.abs() / limit);
        }
        let frames = rig.plant.frames();
        let twist = frames.jacobian().twist(&dq);
        self.hand = self.hand.max(twist.fixed_rows::<3>(0).norm());
        self.turn = self.turn.max(twist.fixed_rows::<3>(3).norm());
        let [elbow, tip, _] = frames.watched_speeds(&JointVelocities(dq), TIP_REACH);
        self.tip = self.tip.max(elbow).max(tip);
    }
}

pub(crate) fn model() -> ArmModel<f64> {
    ArmModel::new(Payload::SensorAndHand)
}

/// Where the stored goal is.
fn stored() -> Vector3<f64> {
    Frames::new(&model(), &JointPositions::from_array(GOAL)).tool_pose().position
}

pub(crate) fn goal(place: Vector3<f64>) -> Goal {
    Goal { position: Some([0, 1, 2].map(|axis| place[axis] as f32)), ..Goal::STORED }
}

/// Runs the movement; `change` gives a goal in a control period. Returns the worst, and the arm where it ended.
fn run((duration, speed, feels): (f64, f32, bool), mut change: impl FnMut(u64) -> Option<Goal>) -> (Worst, Rig<f32>) {
    let mut rig = ready(duration, feels);
    let mut worst = Worst::default();
    rig.command(Command::Run(RunOptions { speed, feedback: feels, ..RunOptions::default() }));
    let (mut places, mut over) = (Vec::new(), false);
    for cycle in 0..(60.0 / PERIOD) as u64 {
        let goal = change(cycle);
        let output = rig.tick(goal.map(Command::SetGoal));
        over |= output.record.state != State::Run;
        if over {
            break;
        }
        if goal.is_some() {
            assert_eq!(output.event, Some(Event::Accepted), "{goal:?}");
        }
        worst.see(&rig);
        places.push(Vector3::from_fn(|axis, _| f64::from(output.record.pose_d[axis])));
    }
    assert!(over, "the run ends");
    // Over five cycles: the record of the plan is in single precision.
    let step = 5.0 * PERIOD;
    let speeds: Vec<_> = places.windows(6).map(|some| (some[5] - some[0]) / step).collect();
    worst.acceleration =
        speeds.windows(6).map(|some| (some[5] - some[0]).norm() / step).fold(worst.acceleration, f64::max);
    (worst, rig)
}

/// Distance of the arm from its goal at most (m).
const NEAR: f64 = 8e-3;

/// Fails unless the run kept its limits, and ended in hold where it should.
fn judge(case: &str, (worst, rig): &(Worst, Rig<f32>), nominal: &Worst, place: &Vector3<f64>) {
    let away = (rig.plant.frames().tool_pose().position - place).norm();
    let record = rig.last.expect("ran").record;
    println!("{case}: {worst:.2?}, {:.1} mm from the goal", away * 1e3);
    assert_eq!((rig.cycle.state(), rig.cycle.fault()), (State::Hold, Fault::None), "{case}");
    assert!(worst.joint < 1.0 && worst.tip < TIP_SPEED_LIMIT, "{case}: {worst:?}");
    assert!(worst.turn < nominal.turn + 0.6, "{case}: {worst:?}");
    assert!(worst.hand < nominal.hand.max(0.5) + 0.05, "{case}: {worst:?}");
    assert!(worst.acceleration < nominal.acceleration + 1.0, "{case}: {worst:?}");
    // Where a joint is at its limit the arm goes as far as it can.
    let limited = record.flags & (flags::CLAMPED | flags::NEAR_LIMIT) != 0;
    assert!(limited || away < NEAR, "{case}: {away} m from the goal");
}

#[test]
fn g9_a_goal_that_is_changed_at_any_time_breaks_no_limit_and_is_reached() {
    let mut dice = Dice(1);
    let (mut cases, mut reached) = (0, 0);
    // The faster one uses nine tenths of the speed that the forearm may have.
    for (duration, feels, count) in [(3.0, false, 8), (3.0, true, 8), (2.0, false, 12), (2.0, true, 6)] {
        for _ in 0..count {
            let (speed, place) = (0.5 + 1.5 * dice.roll(), stored() + dice.place(0.3));
            let speed = if cases % 3 == 0 { 2.0 } else { speed };
            let (time, speed) = (dice.roll() * duration / speed * 1.1, speed as f32);
            if place.norm() > 0.95 {
                continue;
            }
            let (nominal, _) = run((duration, speed, feels), |_| None);
            let due = (time / PERIOD) as u64;
            let outcome = run((duration, speed, feels), |cycle| (cycle == due).then(|| goal(place)));
            let case = format!("{duration} s, speed {speed:.2}, feedback {feels}, at {time:.2} s to {place:.2?}");
            judge(&case, &outcome, &nominal, &place);
            cases += 1;
            let record = outcome.1.last.expect("ran").record;
            reached += usize::from(record.flags & flags::CLAMPED == 0);
        }
    }
    assert!(cases > 25 && reached * 3 > cases * 2, "{reached} of {cases} within reach of the joints");
}

#[test]
fn g9_a_goal_that_is_changed_in_every_cycle_breaks_no_limit_and_the_last_one_is_reached() {
    for (duration, speed, feels) in [(3.0, 2.0, false), (2.0, 2.0, true)] {
        let mut dice = Dice(7);
        let last = stored() + Vector3::new(-0.1, -0.1, 0.1);
        let (nominal, _) = run((duration, speed, feels), |_| None);
        let outcome = run((duration, speed, feels), |cycle| match cycle {
            0..300 => Some(goal(stored() + dice.place(0.2))),
            300 => Some(goal(last)),
            _ => None,
        });
        judge("every cycle", &outcome, &nominal, &last);
    }
}

#[test]
fn g9_a_goal_that_turns_the_hand_breaks_no_limit() {
    let q = JointPositions::from_array([GOAL[0], GOAL[1], GOAL[2], GOAL[3], GOAL[4], GOAL[5], GOAL[6] - 1.5]);
    let turned = Frames::new(&model(), &q).tool_pose();
    let wanted = Goal { orientation: Some(turned.orientation.0.map(|part| part as f32)), ..Goal::STORED };
    for due in [0, 200, 440] {
        let (nominal, _) = run((3.0, 2.0, false), |_| None);
        let outcome = run((3.0, 2.0, false), |cycle| (cycle == due).then_some(wanted));
        judge("turn", &outcome, &nominal, &stored());
        let rest = outcome.1.plant.frames().tool_pose().orientation.error_to(&turned.orientation).norm();
        assert!(rest < 0.03, "{rest} rad from the goal");
    }
}

#[test]
fn g9_a_goal_at_the_start_acts_as_softly_as_a_late_one() {
    let place = stored() + Vector3::new(-0.15, -0.15, 0.15);
    let mut rig = ready(2.0, false);
    rig.command(Command::Run(RunOptions { speed: 2.0, goal: goal(place), ..RunOptions::default() }));
    let mut worst = Worst::default();
    while rig.tick(None).record.state == State::Run {
        worst.see(&rig);
    }
    let (nominal, _) = run((2.0, 2.0, false), |_| None);
    judge("at the start", &(worst, rig), &nominal, &place);
}

/// A goal of the start of a run that is slow has nothing to move yet: it was there at once, and came with all the speed
/// of the run as that was made fast, which ended in `TipSpeed`.
///
/// The change that makes it fail: a goal is there for good once it has moved as far as the phase asks for.
#[test]
fn g9_a_goal_of_a_slow_run_that_is_made_fast_acts_as_softly_as_one_of_a_fast_run() {
    for duration in [2.0, 3.0] {
        for shift in [[0.0, -0.3, 0.0], [0.0, 0.3, 0.0], [-0.2, -0.2, 0.1]] {
            let place = stored() + Vector3::from(shift);
            let (fast, _) = run((duration, 2.0, false), |cycle| (cycle == 0).then(|| goal(place)));
            for (slow, wait) in [(0.1, 6), (0.1, 300), (0.2, 6), (0.5, 6)] {
                let mut rig = ready(duration, false);
                rig.command(Command::Run(RunOptions { speed: slow, goal: goal(place), ..RunOptions::default() }));
                let mut worst = Worst::default();
                for cycle in 0..(60.0 / PERIOD) as u32 {
                    let faster = (cycle == wait).then_some(Command::SetSpeed { factor: 2.0 });
                    rig.tick(faster);
                    if rig.cycle.state() != State::Run {
                        break;
                    }
                    worst.see(&rig);
                }
                judge(&format!("{duration} s, {shift:?}, {slow} for {wait} cycles"), &(worst, rig), &fast, &place);
            }
        }
    }
}

/// The change that makes it fail: a run waits for a goal until that is there for good.
#[test]
fn g9_a_goal_that_the_plan_keeps_up_with_makes_the_run_no_longer() {
    let near = stored() + Vector3::new(0.01, 0.0, 0.0);
    let [plain, led] =
        [None, Some(goal(near))].map(|goal| run((3.0, 1.0, false), |cycle| goal.filter(|_| cycle == 0)).1.number);
    println!("{plain} and {led} control periods");
    assert!(led <= plain + 3, "{led} in place of {plain}");
}

#[test]
fn g9_the_flag_of_the_feedback_tells_whether_it_bends_the_plan() {
    let mut rig = ready(3.0, true);
    rig.command(Command::Run(RunOptions { feedback: true, ..RunOptions::default() }));
    let (mut told, mut bent) = (Vec::new(), Vec::new());
    for (from, push) in [(1.0, 5.0), (3.2, 5.0)] {
        // A late change keeps the run going after its plan has settled.
        while rig.last.expect("ran").record.state == State::Run && (rig.number as f64) * PERIOD < 1.0 + from {
            rig.tick(None);
        }
        if from > 3.0 {
            rig.command(Command::SetGoal(goal(stored() + Vector3::new(0.0, 0.0, 0.05))));
        }
        let before = rig.last.expect("ran").record.pose_d[1];
        rig.plant.push[1] = push;
        rig.run_for(0.4);
        rig.plant.push[1] = 0.0;
        let record = rig.last.expect("ran").record;
        assert_eq!(record.state, State::Run);
        told.push(record.flags & flags::FEEDBACK != 0);
        bent.push((record.pose_d[1] - before).abs());
    }
    println!("{told:?} {bent:?}");
    assert_eq!(told, [true, false]);
    assert!(bent[0] > 5e-3 && bent[1] < 2e-3, "{bent:?}");
}

/// A joint that comes to its soft limit on the way to a new goal stops no run, and the others make up for it: the tool
/// stays on its plan as long as they can.
///
/// The change that makes it fail: nothing is added to the others (`TrackingError`); the limit is not part of the
/// acceleration, or friction is fed forward as if the joint went on (`JointLimit`); a motor that other joints hold is
/// one that friction holds (`EncoderStuck`, the last case: the arm is stretched, which nothing makes up for).
#[test]
fn g9_a_goal_that_leads_a_joint_to_its_limit_stops_no_run() {
    // Start, goal, seconds, moment of the change in them, the new goal (m), and friction in parts of the model's.
    let cases = [
        (
            [-0.57, 1.56, -0.46, 1.34, -0.01, 0.45, 0.46],
            [-0.95, 1.85, -0.21, 1.17, 0.24, 0.35, 0.54],
            (2.5, 1.1),
            [0.19, -0.41, -0.85],
            1.0,
        ),
        (
            [0.26, 1.49, 0.29, 1.28, -0.54, -0.05, -0.44],
            [-0.02, 1.81, 0.0, 1.38, -0.94, 0.03, -0.38],
            (3.1, 1.5),
            [0.66, 0.05, -0.81],
            1.0,
        ),
        (
            [0.52, 1.59, -0.28, 1.47, 0.60, -0.09, 0.19],
            [0.57, 1.85, -0.68, 1.51, 0.84, 0.21, 0.53],
            (2.5, 1.2),
            [0.62, 0.06, -0.75],
            1.0,
        ),
        (
            [0.55, 1.32, -0.28, 1.76, 0.06, 0.10, -0.35],
            [0.61, 1.45, 0.07, 1.53, 0.01, 0.20, -0.64],
            (3.8, 1.6),
            [0.636, 0.462, -0.649],
            1.3,
        ),
        (
            [0.20, 1.01, 0.13, 1.31, 0.52, -0.22, -0.12],
            [0.47, 0.93, -0.22, 1.56, 0.75, 0.11, 0.13],
            (2.0, 0.5),
            [1.0, 0.256, 0.069],
            1.3,
        ),
    ];
    for (number, (start, end, (duration, moment), place, friction)) in cases.into_iter().enumerate() {
        for compliant in [true, false] {
            let mut rig = Rig::<f32>::new(start, 1);
            rig.plant.coulomb *= friction;
            let expected = compliant.then_some([0.0; 6]);
            rig.load(&primitive(&Design { start, goal: end, duration, expected, ..Design::default() })).expect("loads");
            rig.command(Command::Hold);
            rig.run_for(1.5);
            rig.command(Command::Run(if compliant { adapting() } else { RunOptions::default() }));
            rig.run_for(moment);
            rig.command(Command::SetGoal(goal(Vector3::from(place))));
            let mut farthest = 0.0f64;
            while rig.cycle.state() == State::Run {
                let record = rig.tick(None).record;
                let away = (0..3).map(|axis| f64::from(record.pose_d[axis] - record.pose[axis]).powi(2)).sum::<f64>();
                farthest = farthest.max(away.sqrt());
            }
            let case = format!("case {number}, compliant {compliant}");
            assert_eq!((rig.cycle.state(), rig.cycle.fault()), (State::Hold, Fault::None), "{case}");
            assert!(farthest < 0.24, "{case}: {farthest} m off a goal that is out of reach");
        }
    }
}
