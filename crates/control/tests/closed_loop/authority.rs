//! Who may have torque, and how it comes and goes.

use control::act::limit::STEP_LIMIT;
use control::command::{Command, Refusal, RunOptions};
use control::time::periods;
use control::units::{JointPositions, Vector7};
use control::{Event, Fault, State};
use puck::SafetyMode;

use crate::primitives::{Design, GOAL, START, primitive};
use crate::rig::Rig;

#[test]
fn gravity_mode_holds_the_arm_still_and_lets_a_person_move_it() {
    let mut rig = Rig::<f32>::new(GOAL, 1);
    rig.command(Command::Gravity);
    rig.run_for(1.0);
    let rest = rig.plant.q;
    rig.run_for(5.0);
    let drift = (rig.plant.q - rest).amax();
    assert!(drift < 1e-4, "{drift} rad in 5 s");
    // 12 N sideways at the hand move it, and it stays where it is left.
    let before = rig.plant.frames().tool_pose().position;
    rig.plant.push = [0.0, 12.0, 0.0, 0.0, 0.0, 0.0];
    rig.run_for(0.6);
    rig.plant.push = [0.0; 6];
    rig.run_for(3.0);
    let moved = rig.plant.frames().tool_pose().position - before;
    assert!(moved.y > 0.03, "{moved:?}");
    assert_eq!(rig.cycle.state(), State::Gravity);
    let rest = rig.plant.q;
    rig.run_for(2.0);
    assert!((rig.plant.q - rest).amax() < 1e-4, "{} {}", rig.plant.q - rest, rig.plant.dq);
}

#[test]
fn gravity_mode_hardly_drifts_without_any_friction() {
    // Negative control of the sign and size of the gravity torque: friction cannot hide an error here.
    let mut rig = Rig::<f32>::new(GOAL, 0);
    rig.plant.coulomb *= 0.0;
    rig.plant.viscous *= 0.0;
    rig.command(Command::Hold);
    rig.run_for(3.0);
    rig.command(Command::Gravity);
    let before = rig.plant.q;
    rig.run_for(0.5);
    // Counts of torque are rounded down, half a count each; that alone may push.
    assert!((rig.plant.q - before).amax() < 0.02, "{}", rig.plant.q - before);
}

#[test]
fn the_first_torque_after_arming_is_gravity_with_a_limited_onset() {
    let mut rig = Rig::<f32>::new(GOAL, 0);
    rig.run_for(0.1);
    let gravity = rig.cycle.model().gravity_torque(&control::model::Frames::new(
        rig.cycle.model(),
        &JointPositions::from_f32(GOAL.map(|q| q as f32)),
    ));
    let mut last = [0.0f32; 7];
    let mut output = rig.command(Command::Hold);
    for _ in 0..periods(0.3) {
        for joint in 0..7 {
            let step = (output.record.tau[joint] - last[joint]).abs();
            assert!(step <= STEP_LIMIT[joint] as f32 * 1.0001, "J{}: {step}", joint + 1);
        }
        last = output.record.tau;
        output = rig.tick(None);
    }
    // J2 carries most of it.
    assert!(gravity.0[1].abs() > 15.0 && (last[1] - gravity.0[1]).abs() < 6.0, "{last:?} {gravity:?}");
}

/// The change that makes it fail: a compliant run takes over what the rate limit has held back of gravity, and gives it
/// back within a second.
#[test]
fn a_compliant_run_right_after_arming_does_not_inherit_the_gravity_that_has_yet_to_build_up() {
    let sagged = |arm: Command, run: Option<RunOptions>| {
        let mut rig = Rig::<f32>::new(START, 1);
        rig.load(&primitive(&Design { duration: 3.0, ..Design::default() })).expect("loads");
        rig.run_for(0.01);
        // Another arm that was just activated, and has not begun to fall.
        (rig.plant.q, rig.plant.dq) = (Vector7::from(START), Vector7::zeros());
        rig.command(arm);
        if let Some(options) = run {
            rig.command(Command::Run(options));
        }
        let before = rig.plant.frames().tool_pose().position.z;
        let lowest = (0..periods(0.5)).fold(before, |lowest: f64, _| {
            rig.tick(None);
            lowest.min(rig.plant.frames().tool_pose().position.z)
        });
        assert_eq!(rig.cycle.fault(), Fault::None, "{arm:?}, {run:?}");
        before - lowest
    };
    let compliant = RunOptions { compliant: true, ..RunOptions::default() };
    for arm in [Command::Gravity, Command::Hold] {
        let (held, run) = (sagged(arm, None), sagged(arm, Some(compliant)));
        println!("{arm:?}: {held:.3} m, with a run {run:.3} m");
        assert!(run < held + 0.05, "{arm:?}: {held} m, with a run {run} m");
    }
}

#[test]
fn nothing_is_armed_without_a_person_an_active_safety_module_and_all_positions() {
    let mut rig = Rig::<f32>::new(GOAL, 0);
    rig.safety = SafetyMode::Idle;
    rig.run_for(0.1);
    for command in [Command::Gravity, Command::Hold, Command::Run(RunOptions::default())] {
        let output = rig.tick(Some(command));
        assert_eq!(output.event, Some(Event::Refused(Refusal::SafetyNotActive)), "{command:?}");
    }
    assert_eq!(rig.last.expect("ran").actuation.frames(), None, "nothing is sent to idle pucks");
    rig.safety = SafetyMode::Active;
    rig.run_for(1.0);
    assert_eq!(rig.cycle.state(), State::Idle, "nobody asked");
    assert_eq!(rig.plant.torque, Vector7::zeros());
    rig.lose[3] = true;
    assert_eq!(rig.tick(Some(Command::Hold)).event, Some(Event::Refused(Refusal::PositionsMissing)));
    rig.lose[3] = false;
    rig.tick(None);
    assert_eq!(
        rig.tick(Some(Command::Approach { q: [0.5; 7], duration: 1.0 })).event,
        Some(Event::Refused(Refusal::WrongState))
    );
    rig.command(Command::Hold);
}

#[test]
fn a15_safety_dropped_ends_in_idle_and_torque_returns_only_when_asked_for() {
    for mode in [SafetyMode::Idle, SafetyMode::EStop] {
        let mut rig = Rig::<f32>::new(START, 1);
        rig.load(&primitive(&Design::default())).expect("loads");
        rig.command(Command::Hold);
        rig.run_for(2.0);
        rig.command(Command::Run(RunOptions::default()));
        rig.run_for(1.5);
        rig.safety = mode;
        let output = rig.tick(None);
        assert_eq!((output.record.state, output.record.fault), (State::Idle, Fault::SafetyDropped));
        assert_eq!(output.record.tau, [0.0; 7]);
        // Zero torque is said three times, so that no motor keeps pulling; then the bus is left alone.
        for cycle in 0..5 {
            let frames = rig.last.expect("ran").actuation.frames();
            assert_eq!(frames.is_some(), cycle < 3, "cycle {cycle}");
            rig.tick(None);
        }
        rig.safety = SafetyMode::Active;
        rig.run_for(0.2);
        assert_eq!(rig.cycle.state(), State::Idle);
        assert_eq!(rig.plant.torque, Vector7::zeros());
        let output = rig.command(Command::Gravity);
        for (torque, limit) in output.record.tau.iter().zip(STEP_LIMIT) {
            assert!(torque.abs() <= limit as f32 * 1.0001);
        }
        assert_eq!(rig.tick(Some(Command::SetSpeed { factor: 1.0 })).event, Some(Event::Refused(Refusal::WrongState)));
    }
}

#[test]
fn a_silent_safety_module_counts_as_dropped() {
    let mut rig = Rig::<f32>::new(GOAL, 0);
    rig.command(Command::Hold);
    let mut cycles = 0;
    while rig.cycle.state() == State::Hold {
        let sample = control::BusSample { positions: rig.plant.counts(), wrench: None, safety: None, hand: None };
        rig.cycle.step(&control::CycleInput { sample, ..Default::default() });
        cycles += 1;
    }
    assert!((periods(1.0)..=periods(1.0) + 2).contains(&cycles), "{cycles}");
    assert_eq!(rig.cycle.fault(), Fault::SafetyDropped);
}

#[test]
fn e2_a_start_too_far_from_the_primitive_is_refused() {
    let mut q = START;
    q[3] += 0.06;
    let mut rig = Rig::<f32>::new(q, 0);
    rig.command(Command::Hold);
    rig.run_for(2.0);
    assert_eq!(rig.tick(Some(Command::Run(RunOptions::default()))).event, Some(Event::Refused(Refusal::NoPrimitive)));
    rig.load(&primitive(&Design::default())).expect("loads");
    assert_eq!(rig.tick(Some(Command::Run(RunOptions::default()))).event, Some(Event::Refused(Refusal::StartTooFar)));
    assert_eq!(rig.cycle.state(), State::Hold);
    for speed in [0.0, -1.0, 10.0, f32::NAN, f32::INFINITY] {
        let mut near = Rig::<f32>::new(START, 0);
        near.load(&primitive(&Design::default())).expect("loads");
        near.command(Command::Hold);
        near.run_for(2.0);
        let command = Command::Run(RunOptions { speed, ..RunOptions::default() });
        assert_eq!(near.tick(Some(command)).event, Some(Event::Refused(Refusal::OutOfRange)), "{speed}");
    }
}

#[test]
fn e5_stop_at_any_phase_comes_to_rest_within_the_torque_rate() {
    for seconds in [0.02, 0.5, 1.0, 2.0, 3.5] {
        let mut rig = Rig::<f32>::new(START, 1);
        rig.load(&primitive(&Design::default())).expect("loads");
        rig.command(Command::Hold);
        rig.run_for(2.0);
        rig.command(Command::Run(RunOptions::default()));
        rig.run_for(seconds);
        let mut last = rig.last.expect("ran").record.tau;
        let q = rig.plant.q;
        rig.command(Command::Stop);
        for _ in 0..periods(0.3) {
            let record = rig.tick(None).record;
            assert_eq!(record.state, State::SoftStop);
            for joint in 0..7 {
                // The command cycle and one more lie between.
                assert!((record.tau[joint] - last[joint]).abs() <= 2.0 * STEP_LIMIT[joint] as f32 * 1.0001);
            }
            last = record.tau;
        }
        assert!(rig.plant.dq.amax() < 0.05, "{}", rig.plant.dq);
        assert!((rig.plant.q - q).amax() < 0.05, "{}", rig.plant.q - q);
        assert_eq!(
            rig.tick(Some(Command::Run(RunOptions::default()))).event,
            Some(Event::Refused(Refusal::WrongState))
        );
        rig.command(Command::Hold);
    }
}

#[test]
fn b8_a_joint_pushed_to_its_limit_is_pushed_back() {
    let mut posture = GOAL;
    posture[5] = -1.40;
    let mut rig = Rig::<f32>::new(posture, 1);
    rig.command(Command::Gravity);
    rig.run_for(1.0);
    // The hand is turned about an axis that bends the wrist towards its stop.
    let axis = rig.plant.frames().jacobian().0.column(5).fixed_rows::<3>(3).into_owned();
    let torque = -axis * 0.7;
    rig.plant.push = [0.0, 0.0, 0.0, torque.x, torque.y, torque.z];
    let mut lowest = 0.0f64;
    for _ in 0..periods(2.0) {
        rig.tick(None);
        lowest = lowest.min(rig.plant.q[5]);
    }
    assert!(lowest < -1.50, "the push reached the limit: {lowest}");
    assert!(lowest > -1.57 - 1f64.to_radians(), "{lowest}");
}

#[test]
fn a_joint_that_leaves_its_soft_limits_under_control_is_stopped_with_the_reason() {
    let mut posture = GOAL;
    posture[5] = -1.45;
    let mut rig = Rig::<f32>::new(posture, 1);
    rig.command(Command::Hold);
    rig.run_for(1.0);
    // Slowly, about the axis that bends the wrist towards its stop.
    let axis = rig.plant.frames().jacobian().0.column(5).fixed_rows::<3>(3).into_owned();
    for step in 0..periods(5.0) {
        let torque = -axis * (6.0 * f64::from(step) / f64::from(periods(5.0)));
        rig.plant.push = [0.0, 0.0, 0.0, torque.x, torque.y, torque.z];
        if rig.tick(None).record.state == State::SoftStop {
            break;
        }
    }
    assert_eq!((rig.cycle.state(), rig.cycle.fault()), (State::SoftStop, Fault::JointLimit));
    assert_eq!(rig.tick(Some(Command::Hold)).event, Some(Event::Refused(Refusal::FaultLatched)));
    rig.plant.push = [0.0; 6];
    rig.run_for(2.0);
    rig.command(Command::ClearFault);
    assert_eq!((rig.cycle.state(), rig.cycle.fault()), (State::Gravity, Fault::None));
}

#[test]
fn an_arm_that_moves_too_fast_is_stopped() {
    let mut rig = Rig::<f32>::new(GOAL, 1);
    rig.command(Command::Gravity);
    rig.run_for(1.0);
    rig.plant.push = [0.0, 60.0, 0.0, 0.0, 0.0, 0.0];
    rig.until(State::SoftStop, 3.0);
    assert!(matches!(rig.cycle.fault(), Fault::TipSpeed | Fault::JointSpeed), "{:?}", rig.cycle.fault());
    let speeds = rig.plant.frames().watched_speeds(&control::units::JointVelocities(rig.plant.dq), 0.35);
    assert!(speeds[0].max(speeds[1]) < 1.0, "before the safety module faults: {speeds:?}");
}

#[test]
fn a_bus_fault_takes_torque_off_and_asks_for_idle() {
    let mut rig = Rig::<f32>::new(GOAL, 1);
    rig.command(Command::Hold);
    rig.run_for(1.0);
    let sample = control::BusSample {
        positions: rig.plant.counts(),
        wrench: None,
        safety: Some(SafetyMode::Active),
        hand: None,
    };
    let input = control::CycleInput { cycle: 0, sample, command: None, external_fault: Some(Fault::BusFault) };
    let output = rig.cycle.step(&input);
    assert_eq!((output.record.state, output.record.fault), (State::Fault, Fault::BusFault));
    assert_eq!(output.record.tau, [0.0; 7]);
    assert!(output.actuation.frames().is_some(), "zero torque is said");
    rig.run_for(0.02);
    assert!(rig.last.expect("ran").actuation.requests_idle());
    assert_eq!(rig.tick(Some(Command::Gravity)).event, Some(Event::Refused(Refusal::FaultLatched)));
    // E8: no clearing while the cause is there, none needed twice when it is gone.
    let clear = control::CycleInput { command: Some(Command::ClearFault), ..input };
    assert_eq!(rig.cycle.step(&clear).event, Some(Event::Refused(Refusal::CauseRemains)));
    rig.plant.dq = Vector7::zeros();
    rig.plant.coulomb *= 50.0;
    rig.run_for(0.5);
    rig.command(Command::ClearFault);
    assert_eq!((rig.cycle.state(), rig.cycle.fault()), (State::Idle, Fault::None));
    let hold = control::CycleInput { command: Some(Command::Hold), ..input };
    assert_eq!(rig.cycle.step(&hold).event, Some(Event::Refused(Refusal::CauseRemains)));
    rig.command(Command::Hold);
}

/// The change that makes it fail: an arrival that has yet to be told hides what comes after it.
#[test]
fn a_stop_right_behind_an_arrival_that_an_answer_has_delayed_is_told() {
    let running = || {
        let mut rig = Rig::<f32>::new(START, 1);
        rig.load(&primitive(&Design { duration: 3.0, ..Design::default() })).expect("loads");
        rig.command(Command::Hold);
        rig.run_for(2.0);
        rig.command(Command::Run(RunOptions::default()));
        rig
    };
    let mut rig = running();
    rig.until(State::Hold, 20.0);
    let arrives = rig.number;
    for external in [None, Some(Fault::Overrun)] {
        let mut rig = running();
        while rig.number + 1 < arrives {
            rig.tick(None);
        }
        // Its answer goes before the news.
        let output = rig.tick(Some(Command::SetSpeed { factor: 1.0 }));
        assert_eq!((output.record.state, output.event), (State::Hold, Some(Event::Accepted)));
        rig.external = external;
        let first = rig.tick(Some(Command::Stop).filter(|_| external.is_none())).event;
        rig.external = None;
        let told = [first, rig.tick(None).event, rig.tick(None).event].into_iter().flatten().last();
        let fault = external.unwrap_or(Fault::None);
        assert_eq!(told, Some(Event::Entered(State::SoftStop, fault)), "{external:?}");
    }
}
