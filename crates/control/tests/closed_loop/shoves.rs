//! A person shoves the arm, harder and faster than any limit of its own movements.

use std::collections::VecDeque;

use control::command::{Command, Refusal, RunOptions};
use control::guard::monitor::TIP_REACH;
use control::time::periods;
use control::units::JointVelocities;
use control::{Event, Fault, PERIOD, State};
use nalgebra::Vector3;

use crate::primitives::{Design, GOAL, OUT, START, adapting, primitive};
use crate::rig::Rig;

/// Speed of the hand that counts as braked (m/s): the reduced speed of the standards for work beside a person.
const BRAKED: f64 = 0.25;

/// Length of what the velocity filter still remembers (control periods).
const FILTER_CYCLES: usize = periods(0.03) as usize;

/// Outcome of one shove.
#[derive(Debug)]
struct Outcome {
    /// Fastest hand while it was pushed, and afterwards (m/s).
    pushed: f64,
    after: f64,
    /// Work of the push, and the largest kinetic energy afterwards (J).
    work: f64,
    energy: f64,
    /// Speed of the hand 0.3 s after the push beyond that of its plan, if it still runs (m/s).
    braked: f64,
    /// Largest distance of a reported joint speed from those that the joint had in the last 30 ms, in parts of the
    /// fastest (1 rad/s at least).
    unseen: f64,
    /// Fastest elbow, or point of the forearm that the safety module watches (m/s).
    forearm: f64,
    state: State,
    fault: Fault,
}

fn hand_speed(rig: &Rig<f32>) -> f64 {
    let twist = rig.plant.frames().jacobian().twist(&rig.plant.dq);
    twist.fixed_rows::<3>(0).norm()
}

/// Pushes the hand of an arm in this state with `force` (N) along `direction` for `seconds`.
fn shove(rig: &mut Rig<f32>, direction: [f64; 3], force: f64, seconds: f64) -> Outcome {
    let length = direction.iter().map(|x| x * x).sum::<f64>().sqrt();
    let mut outcome = Outcome {
        pushed: 0.0,
        after: 0.0,
        work: 0.0,
        energy: 0.0,
        braked: 0.0,
        unseen: 0.0,
        forearm: 0.0,
        state: State::Idle,
        fault: Fault::None,
    };
    let mut recent = VecDeque::from([rig.plant.dq]);
    let mut planned = rig.last.expect("ran").record.pose_d;
    let push = usize::from(periods(seconds));
    for cycle in 0..push + usize::from(periods(0.8)) {
        let pushing = cycle < push;
        let share = if pushing { force / length } else { 0.0 };
        rig.plant.push = [direction[0] * share, direction[1] * share, direction[2] * share, 0.0, 0.0, 0.0];
        let before = rig.plant.frames().tool_pose().position;
        let output = rig.tick(None);
        let way = rig.plant.frames().tool_pose().position - before;
        outcome.work += (0..3).map(|axis| rig.plant.push[axis] * way[axis]).sum::<f64>();
        if !pushing {
            let mass = rig.plant.model.mass_matrix(&rig.plant.frames());
            outcome.energy = outcome.energy.max(0.5 * rig.plant.dq.dot(&(mass * rig.plant.dq)));
        }
        assert!(output.record.state.has_torque(), "cycle {cycle} at {:.2} m/s: {:?}", hand_speed(rig), output.record);
        let speed = hand_speed(rig);
        let [elbow, tip, _] = rig.plant.frames().watched_speeds(&JointVelocities(rig.plant.dq), TIP_REACH);
        outcome.forearm = outcome.forearm.max(elbow).max(tip);
        let part = if pushing { &mut outcome.pushed } else { &mut outcome.after };
        *part = part.max(speed);
        let now = output.record.pose_d;
        let way = |axis: usize| f64::from(now[axis] - planned[axis]);
        let plan = (0..3).map(|axis| way(axis).powi(2)).sum::<f64>().sqrt() / PERIOD;
        planned = now;
        if cycle == push + usize::from(periods(0.3)) {
            outcome.braked = if output.record.state == State::Run { (speed - plan).max(0.0) } else { speed };
        }
        recent.push_back(rig.plant.dq);
        if recent.len() > FILTER_CYCLES {
            recent.pop_front();
        }
        let fastest = recent.iter().map(|dq| dq.amax()).fold(1.0, f64::max);
        for (joint, seen) in output.record.dq.into_iter().enumerate() {
            let had = recent.iter().map(|dq| dq[joint]);
            let (low, high) = had.fold((f64::MAX, f64::MIN), |(low, high), dq| (low.min(dq), high.max(dq)));
            outcome.unseen = outcome.unseen.max((low - f64::from(seen)).max(f64::from(seen) - high) / fastest);
        }
    }
    outcome.state = rig.cycle.state();
    outcome.fault = rig.cycle.fault();
    outcome
}

/// A run of this movement and kind that begins, on an arm whose sensor feels the hand's inertia.
fn in_run(design: &Design, options: RunOptions) -> Rig<f32> {
    let mut rig = Rig::<f32>::new(START, 1);
    rig.plant.inertia = 1.0;
    rig.load(&primitive(design)).expect("loads");
    rig.command(Command::Hold);
    rig.run_for(1.0);
    rig.command(Command::Tare);
    rig.command(Command::Run(options));
    rig
}

fn in_state(state: State, seconds: f64, options: RunOptions) -> Rig<f32> {
    let mut rig = Rig::<f32>::new(if state == State::Run { START } else { GOAL }, 1);
    rig.plant.inertia = 1.0;
    rig.load(&primitive(&Design { duration: 3.0, ..Design::default() })).expect("loads");
    match state {
        State::Gravity => rig.command(Command::Gravity),
        _ => rig.command(Command::Hold),
    };
    rig.run_for(1.0);
    if state == State::Run {
        rig.command(Command::Run(options));
    }
    rig.run_for(seconds);
    rig
}

/// Numbers in 0..1 that look random: the fractional parts of multiples of an irrational number.
fn fraction(index: usize, of: f64) -> f64 {
    ((index + 1) as f64 * of).fract()
}

/// The arm can be used again after a stop: a person clears it and asks it to hold. True if its zero was lost, which
/// takes a new start and a new zero in between.
fn recovers(rig: &mut Rig<f32>) -> bool {
    let zero_lost = rig.tick(Some(Command::ClearFault)).event == Some(Event::Refused(Refusal::ZeroLost));
    if zero_lost {
        rig.cycle.reset();
        rig.tick(None);
        rig.command(Command::ClearFault);
        // The brakes hold the arm meanwhile.
        rig.plant.dq *= 0.0;
    }
    rig.command(Command::Hold);
    rig.run_for(0.3);
    assert_eq!((rig.cycle.state(), rig.cycle.fault()), (State::Hold, Fault::None));
    zero_lost
}

/// An arm that holds `from` while a person leads a joint aside by `way` (rad) within two seconds and keeps it there
/// until `command` has begun; then the fastest speed of the hand within a second (m/s).
fn led_aside(from: [f64; 7], (joint, way): (usize, f64), command: Command) -> (Rig<f32>, f64) {
    let mut rig = Rig::<f32>::new(from, 1);
    rig.load(&primitive(&Design { duration: 3.0, start: GOAL, goal: START, ..Design::default() })).expect("loads");
    rig.command(Command::Hold);
    rig.run_for(2.0);
    let cycles = periods(2.0);
    let held = rig.plant.q;
    let lead = |rig: &mut Rig<f32>, share: f64, command: Option<Command>| {
        rig.plant.q = held;
        rig.plant.q[joint] += way * share;
        rig.plant.dq.fill(0.0);
        rig.tick(command)
    };
    for cycle in 0..cycles {
        lead(&mut rig, f64::from(cycle) / f64::from(cycles), None);
    }
    for _ in 0..periods(0.3) {
        lead(&mut rig, 1.0, None);
    }
    assert_eq!(lead(&mut rig, 1.0, Some(command)).event, Some(Event::Accepted));
    for _ in 0..periods(0.1) {
        lead(&mut rig, 1.0, None);
    }
    let fastest = (0..periods(1.0)).fold(0.0, |fastest: f64, _| {
        rig.tick(None);
        fastest.max(hand_speed(&rig))
    });
    println!("J{} by {way}: {fastest:.2} m/s", joint + 1);
    (rig, fastest)
}

/// Joints that are led aside, and how far (rad).
const ASIDE: [(usize, f64); 5] = [(0, 0.4), (0, -0.4), (1, 0.3), (1, -0.3), (3, 0.4)];

/// The change that makes it fail: an approach begins where the arm was asked to be and not where it is.
#[test]
fn g1_an_arm_that_was_led_aside_is_not_thrown_back_by_the_approach_that_follows() {
    for aside in ASIDE {
        let approach = Command::Approach { q: START.map(|q| q as f32), duration: 5.0 };
        let (mut rig, fastest) = led_aside(GOAL, aside, approach);
        assert!(fastest < BRAKED, "{aside:?}: {fastest} m/s");
        rig.until(State::Hold, 20.0);
        assert_eq!(rig.cycle.fault(), Fault::None);
    }
}

/// An approach that begins at START, and the seconds after which something holds it up.
const HELD_UP: [([f64; 7], f32, f64); 4] = [(GOAL, 3.0, 1.05), (GOAL, 10.0, 3.5), (OUT, 3.0, 1.05), (OUT, 10.0, 3.5)];

/// A rig with so much of the friction of the model, tared, on its way to `target`.
fn approaching(target: [f64; 7], duration: f32, friction: f64) -> Rig<f32> {
    let mut rig = Rig::<f32>::new(START, 1);
    (rig.plant.coulomb, rig.plant.viscous) = (rig.plant.coulomb * friction, rig.plant.viscous * friction);
    rig.command(Command::Hold);
    rig.run_for(2.0);
    rig.command(Command::Tare);
    rig.command(Command::Approach { q: target.map(|q| q as f32), duration });
    rig
}

/// A person holds the hand at `place` with 800 N/m and 40 N s/m.
fn grip(rig: &mut Rig<f32>, place: &Vector3<f64>) {
    let frames = rig.plant.frames();
    let away = Vector3::from(frames.tool_pose().position) - place;
    let force = -away * 800.0 - frames.jacobian().twist(&rig.plant.dq).fixed_rows::<3>(0) * 40.0;
    rig.plant.push = [force.x, force.y, force.z, 0.0, 0.0, 0.0];
}

/// A person holds the hand on the way, or it stands before a wall, and is let go of: up to 1.9 and 2.8 m/s, thrown by
/// the spring that the plan had drawn.
///
/// The change that makes it fail: the posture of an approach does not give way.
#[test]
fn g1_an_arm_that_is_held_up_in_an_approach_is_not_thrown_when_it_is_let_go_of() {
    let mut worst = (0.0f64, 0.0f64);
    for friction in [1.0, 0.3] {
        for (target, duration, moment) in HELD_UP {
            for (seconds, wall) in [0.3, 0.6, 1.0, 2.0].into_iter().flat_map(|s| [(s, None), (s, Some(1000.0))]) {
                let mut rig = approaching(target, duration, friction);
                rig.run_for(moment);
                let place = Vector3::from(rig.plant.frames().tool_pose().position);
                rig.plant.wall = wall.map(|stiffness| (place.x + 0.002, stiffness));
                for _ in 0..periods(seconds) {
                    if wall.is_none() {
                        grip(&mut rig, &place);
                    }
                    rig.tick(None);
                }
                let (state, fault) = (rig.cycle.state(), rig.cycle.fault());
                (rig.plant.push, rig.plant.wall) = ([0.0; 6], None);
                let speed = (0..periods(1.0)).fold(0.0f64, |speed, _| {
                    rig.tick(None);
                    speed.max(hand_speed(&rig))
                });
                println!("x{friction}, {duration} s, {seconds} s, wall {wall:?}: {state:?} {fault:?} {speed:.2} m/s");
                if wall.is_none() { worst.0 = worst.0.max(speed) } else { worst.1 = worst.1.max(speed) }
            }
        }
    }
    println!("{:.2} m/s held by a person, {:.2} before a wall", worst.0, worst.1);
    // The plan alone moves the hand at up to 0.6 m/s.
    assert!(worst.0 < 1.15 && worst.1 < 1.0, "{worst:?} m/s");
}

/// Who holds the hand of an approach and has the arm told to hold it there was taken along by 20 to 37 cm once it was
/// let go of, at up to 0.64 m/s: the posture to hold was that of the plan, which had gone on.
///
/// The change that makes it fail: a hold takes the posture of the plan.
#[test]
fn an_arm_that_is_held_up_in_an_approach_and_told_to_hold_stays_where_it_is() {
    for friction in [1.0, 0.3] {
        for (target, duration, moment) in HELD_UP {
            for seconds in [0.6, 1.0, 2.0] {
                let mut rig = approaching(target, duration, friction);
                rig.plant.inertia = 1.0;
                rig.run_for(moment);
                let place = Vector3::from(rig.plant.frames().tool_pose().position);
                for cycle in 0..periods(seconds + 0.3) {
                    grip(&mut rig, &place);
                    rig.tick((cycle == periods(seconds)).then_some(Command::Hold));
                }
                rig.plant.push = [0.0; 6];
                let speed = (0..periods(6.0)).fold(0.0f64, |speed, _| {
                    rig.tick(None);
                    speed.max(hand_speed(&rig))
                });
                let way = (Vector3::from(rig.plant.frames().tool_pose().position) - place).norm();
                let state = rig.cycle.state();
                let what = format!("x{friction}, {duration} s, {seconds} s: {state:?}, {way:.3} m, {speed:.2} m/s");
                println!("{what}");
                assert!(way < 0.12 && speed < 0.45, "{what}");
            }
        }
    }
}

/// 3 N are no grip: the arm goes on to its target, and arrives there once they are gone.
#[test]
fn g1_an_arm_that_is_pulled_on_in_an_approach_reaches_its_target_once_it_is_let_go_of() {
    for direction in [[3.0, 0.0, 0.0], [-3.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, -3.0, 0.0], [0.0, 0.0, -3.0]] {
        for friction in [1.0, 0.3] {
            let mut rig = approaching(GOAL, 5.0, friction);
            let [x, y, z] = direction;
            rig.plant.push = [x, y, z, 0.0, 0.0, 0.0];
            rig.run_for(10.0);
            rig.plant.push = [0.0; 6];
            rig.run_for(3.0);
            assert_eq!((rig.cycle.state(), rig.cycle.fault()), (State::Hold, Fault::None));
            let away = (0..7).map(|joint| (rig.plant.q[joint] - GOAL[joint]).abs()).fold(0.0, f64::max);
            println!("{direction:?} x{friction}: {away:.4} rad from the target");
            assert!(away < 0.01, "{away} rad");
        }
    }
}

/// The change that makes it fail: a run takes over the spring that draws the arm back.
#[test]
fn g1_an_arm_that_was_led_aside_is_not_thrown_back_by_the_run_that_follows() {
    let compliant = RunOptions { compliant: true, ..RunOptions::default() };
    for options in [RunOptions::default(), compliant] {
        let run = |aside| {
            let mut from = GOAL;
            let (joint, way) = aside;
            from[joint] -= way;
            let (mut rig, fastest) = led_aside(from, aside, Command::Run(options));
            // A stiff run stops for somebody who does not let go of the arm as it begins.
            if rig.cycle.fault() != Fault::UnseenContact {
                rig.until(State::Hold, 10.0);
                assert_eq!(rig.cycle.fault(), Fault::None, "{aside:?}");
            }
            fastest
        };
        let undisturbed = run((0, 0.0));
        for aside in ASIDE {
            let fastest = run(aside);
            assert!(fastest < undisturbed + 0.15, "{aside:?}: {fastest} m/s, {undisturbed} undisturbed");
        }
    }
}

/// Speeds of the hand (m/s) as somebody lets go who leans on a joint of an arm that holds with this torque (N m),
/// unseen by the sensor, so many seconds after a compliant run begins; then the fastest, and 0.3 s later.
fn leaned_on(from: [f64; 7], (joint, torque): (usize, f64), seconds: f64) -> (Rig<f32>, [f64; 3]) {
    let mut rig = Rig::<f32>::new(from, 1);
    rig.command(Command::Hold);
    rig.run_for(2.0);
    let cycles = periods(1.0);
    for cycle in 0..2 * cycles {
        rig.plant.unseen[joint] = torque * f64::min(f64::from(cycle) / f64::from(cycles), 1.0);
        rig.tick(None);
    }
    // The run begins where the arm was led to.
    let here = rig.plant.q.into();
    let staying = Design { duration: 3.0, bent: false, start: here, goal: here, ..Design::default() };
    rig.load(&primitive(&staying)).expect("loads");
    let options = RunOptions { compliant: true, ..RunOptions::default() };
    rig.command(Command::Run(options));
    rig.run_for(seconds);
    rig.plant.unseen.fill(0.0);
    let speeds = [hand_speed(&rig); 3];
    let speeds = (0..periods(1.0)).fold(speeds, |[pushed, fastest, late], cycle| {
        rig.tick(None);
        let speed = hand_speed(&rig);
        [pushed, fastest.max(speed), if cycle == periods(0.3) { speed } else { late }]
    });
    (rig, speeds)
}

/// The change that makes it fail: a run takes over the torque of a spring that is drawn, and keeps it.
#[test]
fn g1_an_arm_that_is_leaned_on_as_a_compliant_run_begins_is_not_thrown_back() {
    let pushes = [(0, 10.0), (0, 20.0), (1, 20.0), (2, 4.0), (3, 6.0), (3, 11.0)];
    for (from, torques) in [(START, &pushes[..]), (GOAL, &pushes), (OUT, &pushes[..5])] {
        for (seconds, torque) in
            [0.05, 0.2, 0.5].into_iter().flat_map(|seconds| torques.iter().map(move |torque| (seconds, torque)))
        {
            for sign in [1.0, -1.0] {
                let (joint, torque) = (torque.0, torque.1 * sign);
                let [pushed, fastest, late] = leaned_on(from, (joint, torque), seconds).1;
                let what =
                    format!("J{}, {torque} N m for {seconds} s: {pushed:.2}, {fastest:.2}, {late:.2} m/s", joint + 1);
                println!("{what}");
                assert!(fastest < f64::max(0.35, pushed + 0.1) && late < BRAKED, "{what}");
            }
        }
    }
}

/// The most that J4 of the outstretched arm holds, let go of after 50 ms, throws its forearm, and the arm stops
/// (`JointSpeed`), 0.5 and 0.6 m/s. The change that makes it fail: a soft stop without damping.
#[test]
fn g1_an_outstretched_arm_that_its_elbow_was_leaned_on_is_used_again_after_its_stop() {
    for torque in [11.0, -11.0] {
        let (mut rig, speeds) = leaned_on(OUT, (3, torque), 0.05);
        let what = format!("{torque} N m: {speeds:.2?} m/s, {:?}, {:?}", rig.cycle.state(), rig.cycle.fault());
        assert_eq!((rig.cycle.state(), rig.cycle.fault()), (State::SoftStop, Fault::JointSpeed), "{what}");
        assert!(speeds[1] < 0.7 && speeds[2] < BRAKED && hand_speed(&rig) < 0.05, "{what}, {} m/s", hand_speed(&rig));
        recovers(&mut rig);
        rig.command(Command::Hold);
        rig.command(Command::Approach { q: START.map(|q| q as f32), duration: 6.0 });
        rig.until(State::Hold, 10.0);
        rig.load(&primitive(&Design::default())).expect("loads");
        rig.command(Command::Run(RunOptions { compliant: true, ..RunOptions::default() }));
        rig.until(State::Hold, 10.0);
        assert_eq!(rig.cycle.fault(), Fault::None, "{what}");
    }
}

/// 201 shoves from this number on: how many leave the hand too fast, how many cost the zero, in how many the safety
/// module would take the arm from 1.0 m/s on, and the fastest (m/s).
fn shoves(from: usize) -> (usize, usize, usize, f64) {
    let (mut late, mut zeros, mut taken, mut worst) = (0, 0, 0, 0.0f64);
    for index in from..from + 201 {
        let state = [State::Gravity, State::Hold, State::Run][index % 3];
        let force = 10.0 + 70.0 * fraction(index, 0.618_034);
        let seconds = (0.05 + 0.45 * fraction(index, 0.754_878)).min(10.0 / force);
        let direction = [0.569_84, 0.802_95, 0.324_72].map(|step| fraction(index, step) - 0.5);
        let moment = 1.5 * fraction(index, 0.430_16);
        let mut rig = in_state(state, moment, RunOptions::default());
        let outcome = shove(&mut rig, direction, force, seconds);
        let what = format!("{index}: {state:?}, {force:.0} N for {seconds:.2} s along {direction:.2?}: {outcome:?}");
        println!("{what}");
        // A run moves by itself, too, and a hold gives back what its spring took up.
        assert!(outcome.energy <= outcome.work.max(0.0) + 0.5, "{what}");
        assert!(outcome.unseen < 0.2, "{what}");
        assert_eq!(outcome.state == State::SoftStop, outcome.fault != Fault::None, "{what}");
        worst = worst.max(outcome.braked);
        late += usize::from(outcome.braked >= BRAKED);
        taken += usize::from(outcome.forearm >= 1.0);
        if outcome.state == State::SoftStop {
            zeros += usize::from(recovers(&mut rig));
        }
    }
    println!(
        "{late} of 201 faster than {BRAKED} m/s 0.3 s after the push, the fastest {worst:.2} m/s; {zeros} zeros lost; \
         {taken} for the safety module"
    );
    (late, zeros, taken, worst)
}

/// The safety module takes the arm away from its torque where elbow or forearm are at 1.0 m/s, and its brakes let the
/// arm sink faster than 0.25 m/s. 59 and 55 of 201 are left; without the brake it is 94 and more.
///
/// The change that makes it fail: a stop has no more than its damping, however fast the forearm is.
#[test]
fn g1_a_shove_of_up_to_10_n_s_in_teach_hold_and_run_is_braked_with_torque_and_seen() {
    for from in [0, 1005] {
        let (late, zeros, taken, worst) = shoves(from);
        assert!(late == 0 && zeros == 0 && taken < 65, "{late}, {zeros}, {taken}, {worst}");
    }
}

/// Compliant runs of each kind that the host asks for, and how many of 201 shoves leave the hand too fast.
fn compliant_runs() -> [(&'static str, Option<[f64; 6]>, RunOptions, usize); 4] {
    let open = RunOptions { compliant: true, ..RunOptions::default() };
    let nothing = Some([0.0; 6]);
    [
        ("open, no expectation", None, open, 1),
        ("open", nothing, open, 1),
        ("force", nothing, RunOptions { force_control: true, ..open }, 2),
        ("adapt", nothing, adapting(), 3),
    ]
}

/// The damping of such a run acts on a velocity that the model predicts, and no model knows of a shove. A spring that
/// was drawn threw the hand back: of 201 shoves 8 left it faster than 0.25 m/s (0.50).
///
/// The changes that make it fail: a drawn spring is not let go of; a quarter of the damping of a compliant run.
#[test]
fn g1_a_shove_in_a_compliant_run_gets_no_more_energy_than_it_brought() {
    for (kind, expected, options, too_fast) in compliant_runs() {
        let (mut late, mut worst) = (0, 0.0f64);
        for index in 0..201 {
            let force = 10.0 + 70.0 * fraction(index, 0.618_034);
            let seconds = (0.05 + 0.45 * fraction(index, 0.754_878)).min(10.0 / force);
            let direction = [0.569_84, 0.802_95, 0.324_72].map(|step| fraction(index, step) - 0.5);
            let mut rig = in_run(&Design { duration: 3.0, expected, ..Design::default() }, options);
            rig.run_for(1.5 * fraction(index, 0.430_16));
            let outcome = shove(&mut rig, direction, force, seconds);
            let what = format!("{kind} {index}: {force:.0} N for {seconds:.2} s along {direction:.2?}: {outcome:?}");
            assert!(outcome.energy <= outcome.work.max(0.0) + 0.5, "{what}");
            assert_eq!(outcome.state == State::SoftStop, outcome.fault != Fault::None, "{what}");
            late += usize::from(outcome.braked >= BRAKED);
            worst = worst.max(outcome.braked);
            if outcome.state == State::SoftStop {
                recovers(&mut rig);
            }
        }
        println!("{kind}: {late} of 201 late, {worst:.2} m/s");
        assert!(late <= too_fast && worst < 0.37, "{kind}: {late}, {worst} m/s");
    }
}

#[test]
fn g1_shoves_that_no_limit_was_chosen_on_are_braked_as_well() {
    let (late, zeros, _, worst) = shoves(2010);
    assert!(late == 0 && zeros == 0, "{late}, {zeros}, {worst}");
}
