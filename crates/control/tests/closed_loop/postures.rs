//! Accuracy of a held posture, under friction that nobody knows exactly.

use control::act::limit::STEP_LIMIT;
use control::command::{Command, RunOptions};
use control::law::Gains;
use control::law::integral::TOLERANCE;
use control::plan::Approach;
use control::plan::approach::SETTLING;
use control::time::periods;
use control::units::{JointPositions, Vector7};
use control::{CycleRecord, Event, RATE, State, flags, model};

use crate::primitives::{Design, GOAL, START, primitive};
use crate::rig::{Rig, cycle};

/// A rig that holds `q`, with `scale` times the friction of the model.
fn holding(q: [f64; 7], delay: usize, scale: f64) -> Rig<f32> {
    let mut rig = Rig::<f32>::new(q, delay);
    rig.plant.coulomb *= scale;
    rig.command(Command::Hold);
    rig.run_for(2.0);
    rig
}

/// Cycles in which a stuck joint is pulled aside.
const PULL: u16 = periods(0.047);

/// Moves J1 of an arm that is stuck by so much (rad), slowly enough for a joint.
fn pull_aside(rig: &mut Rig<f32>, way: f64) -> CycleRecord {
    for _ in 0..PULL {
        rig.plant.q[0] += way / f64::from(PULL);
        rig.tick(None);
    }
    rig.last.expect("ran").record
}

/// The largest error of a joint, in parts of its tolerance.
fn worst(rig: &Rig<f32>, target: &[f64; 7]) -> f64 {
    (0..7).map(|joint| (rig.plant.q[joint] - target[joint]).abs() / TOLERANCE[joint]).fold(0.0, f64::max)
}

/// Moves the arm to `target`; the time from the end of the path to the report of arrival (s).
fn approach(rig: &mut Rig<f32>, target: &[f64; 7]) -> f64 {
    let from = rig.last.expect("ran").record.q_d.map(f64::from);
    let path = Approach::new(
        &rig.plant.model,
        &JointPositions(Vector7::from(from)),
        &JointPositions(Vector7::from(*target)),
        0.0,
    );
    let begin = rig.number;
    rig.command(Command::Approach { q: target.map(|q| q as f32), duration: 0.0 });
    rig.until(State::Hold, 60.0);
    assert_eq!(rig.last.and_then(|output| output.event), Some(Event::Arrived));
    (rig.number - begin) as f64 / RATE - path.duration()
}

/// Postures near and far, so that joints arrive from either side.
const TARGETS: [[f64; 7]; 4] = [START, GOAL, [0.03, 0.63, -0.02, 1.53, 0.03, 0.33, -0.03], START];

#[test]
fn an_approach_ends_within_tolerance_and_without_hunting_whatever_friction_and_delay() {
    let (mut longest, mut at_arrival, mut at_rest) = (0.0f64, 0.0f64, 0.0f64);
    for delay in 0..=2 {
        for scale in [0.7, 1.0, 1.3] {
            let mut rig = holding(GOAL, delay, scale);
            for target in TARGETS {
                let seconds = approach(&mut rig, &target);
                longest = longest.max(seconds);
                at_arrival = at_arrival.max(worst(&rig, &target));
                assert!(worst(&rig, &target) <= 1.0, "delay {delay}, friction {scale}: {}", rig.plant.q);
                rig.run_for(2.0);
                let rest = rig.plant.q;
                for _ in 0..periods(1.0) {
                    rig.tick(None);
                    assert!(rig.plant.dq.amax() < 5e-3, "delay {delay}, friction {scale}: {}", rig.plant.dq);
                }
                at_rest = at_rest.max(worst(&rig, &target));
                assert!(worst(&rig, &target) <= 1.0, "delay {delay}, friction {scale}: {}", rig.plant.q);
                assert!((rig.plant.q - rest).amax() < 5e-4, "it hunts: {}", rig.plant.q - rest);
            }
        }
    }
    println!("arrival after {longest:.2} s, at {at_arrival:.2} of the tolerance, {at_rest:.2} three seconds later");
    assert!(longest < f64::from(SETTLING) / RATE, "{longest} s: arrived because the time was up");
}

#[test]
fn without_the_integral_friction_leaves_several_times_the_tolerance() {
    // Negative control of the test above.
    let gains = Gains { settling: Vector7::zeros(), ..Gains::tuned() };
    let mut left = 0.0f64;
    for scale in [0.7, 1.0, 1.3] {
        let mut rig = Rig::<f32>::new(GOAL, 1);
        rig.cycle = cycle(gains);
        rig.plant.coulomb *= scale;
        rig.command(Command::Hold);
        rig.run_for(2.0);
        for target in TARGETS {
            let seconds = approach(&mut rig, &target);
            assert!(seconds <= f64::from(SETTLING) / RATE + 0.01, "it arrives all the same: {seconds} s");
            rig.run_for(2.0);
            left = left.max(worst(&rig, &target));
        }
    }
    println!("{left} times the tolerance");
    assert!(left > 3.0, "{left}");
}

#[test]
fn a_frictionless_arm_is_held_steadily_as_well() {
    // Nothing damps a limit cycle here but the controller.
    for delay in 0..=2 {
        let mut rig = holding(GOAL, delay, 0.0);
        rig.plant.viscous *= 0.0;
        for target in TARGETS.into_iter().skip(2) {
            approach(&mut rig, &target);
            rig.run_for(2.0);
            for _ in 0..periods(1.0) {
                rig.tick(None);
                assert!(worst(&rig, &target) <= 1.0, "delay {delay}: {}", rig.plant.q);
            }
        }
    }
}

#[test]
fn an_obstacle_feels_no_more_than_one_and_a_half_times_the_friction_in_addition() {
    let mut rig = holding(GOAL, 1, 1.0);
    rig.plant.push[1] = 25.0;
    let stiffness = f64::from(Gains::<f32>::tuned().stiff.stiffness[0]);
    let (mut most, mut stands) = (0.0f64, 0);
    for _ in 0..periods(10.0) {
        let record = rig.tick(None).record;
        // Gravity has no part in the torque of J1; what the spring and the damper do not explain is the integral's.
        let spring = stiffness * f64::from(record.q_d[0] - record.q[0]);
        // The damper acts on an observed velocity, which is that of a joint that stands once it has stood for a moment.
        stands = if record.dq[0].abs() < 1e-3 { stands + 1 } else { 0 };
        if stands > periods(0.25) {
            most = most.max((f64::from(record.tau[0]) - spring).abs());
        }
    }
    let friction = model::FRICTION_COULOMB[0];
    assert!(most > 1.4 * friction && most < 1.55 * friction, "{most} N m after 10 s");
    // Let go, it comes back to where it was asked to be.
    let hold = rig.last.expect("ran").record.q_d.map(f64::from);
    rig.plant.push[1] = 0.0;
    rig.run_for(3.0);
    assert!(worst(&rig, &hold) <= 1.0, "{}", rig.plant.q);
}

#[test]
fn a_state_without_the_integral_forgets_it() {
    let mut rig = holding(GOAL, 1, 1.0);
    rig.plant.push[1] = 25.0;
    rig.run_for(3.0);
    assert!(rig.last.expect("ran").record.tau[0].abs() > 3.0);
    rig.plant.push[1] = 0.0;
    rig.command(Command::Gravity);
    rig.run_for(1.0);
    let output = rig.command(Command::Hold);
    assert!(output.record.tau[0].abs() < 0.05, "{:?}", output.record.tau);
}

#[test]
fn lost_replies_leave_the_integral_as_it_was() {
    // A joint that is being shifted towards its target, with every third cycle lost.
    let torque = |lossy: bool| {
        let mut rig = holding(GOAL, 1, 1.0);
        rig.plant.coulomb *= 10.0;
        pull_aside(&mut rig, 0.006);
        // Until the motion has left the velocity filter, and the observer has forgotten that nobody had asked for it.
        rig.run_for(0.4);
        let before = rig.last.expect("ran").record.tau[0];
        for cycle in 0..periods(0.1) {
            rig.lose = [lossy && cycle % 3 != 2; 7];
            rig.tick(None);
        }
        rig.lose = [false; 7];
        (rig.last.expect("ran").record.tau[0] - before).abs()
    };
    let (complete, lossy) = (torque(false), torque(true));
    assert!(complete > 0.2 && (lossy / complete - 1.0 / 3.0).abs() < 0.05, "{lossy} of {complete} N m");
}

#[test]
fn while_a_torque_is_cut_the_integral_waits() {
    // While gravity torque builds up, the rate limit acts; the arm is stuck meanwhile, beside the posture it should
    // hold.
    let mut rig = Rig::<f32>::new(GOAL, 0);
    rig.plant.coulomb *= 50.0;
    rig.command(Command::Hold);
    let mut record = pull_aside(&mut rig, 0.012);
    let mut cycles = PULL;
    while record.flags & flags::RATE_LIMITED != 0 {
        record = rig.tick(None).record;
        cycles += 1;
    }
    let stiff = Gains::<f32>::tuned().stiff;
    let spring = stiff.stiffness[0] * (record.q_d[0] - record.q[0]) - stiff.damping[0] * record.dq[0];
    assert!(cycles > 20, "{cycles} cycles");
    assert!(spring.abs() > 3.0 && (record.tau[0] - spring).abs() < 0.02, "{} of {spring} N m", record.tau[0]);
}

#[test]
fn from_approach_to_hold_to_run_and_back_the_torque_makes_no_step() {
    let mut rig = holding(GOAL, 1, 1.3);
    rig.load(&primitive(&Design::default())).expect("loads");
    let mut last = rig.last.expect("ran").record;
    let mut largest = 0.0f32;
    for (command, first) in [
        (Command::Approach { q: START.map(|q| q as f32), duration: 0.0 }, State::Approach),
        (Command::Run(RunOptions::default()), State::Run),
    ] {
        let mut next = Some(command);
        // Through the movement and two seconds into the hold that follows it.
        let mut held = 0;
        while held < periods(2.0) {
            let record = rig.tick(next.take()).record;
            assert!([first, State::Hold].contains(&record.state), "{:?}", record.state);
            assert_eq!(record.flags & flags::RATE_LIMITED, 0);
            for ((now, before), limit) in record.tau.iter().zip(last.tau).zip(STEP_LIMIT) {
                largest = largest.max((now - before).abs() / limit as f32);
            }
            held += u16::from(record.state == State::Hold);
            last = record;
        }
    }
    println!("largest step: {largest} of the rate limit");
    assert!(largest < 0.3, "{largest}");
}

#[test]
fn after_a_run_the_arm_stays_where_it_arrived() {
    // Eq (11) leaves q_d beyond the arm by what friction takes; holding q_d itself would creep there.
    for delay in 0..=2 {
        let mut rig = holding(START, delay, 1.0);
        rig.load(&primitive(&Design::default())).expect("loads");
        rig.command(Command::Run(RunOptions::default()));
        rig.until(State::Hold, 20.0);
        let arrived = rig.plant.q;
        rig.run_for(4.0);
        let crept = (rig.plant.q - arrived).amax();
        assert!(crept < 1e-3, "{crept} rad");
    }
}
