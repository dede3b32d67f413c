//! Heat, warnings and overruns (faults A15, E8, G12, G14): what they do, what they leave behind, and the way back.

use control::command::{Command, Refusal, RunOptions};
use control::time::periods;
use control::units::JointPositions;
use control::{Caution, CycleOutput, Event, Fault, Goal, PERIOD, State, flags};
use puck::SafetyMode;

use crate::primitives::{Design, GOAL, START, primitive};
use crate::rig::Rig;

fn holding() -> Rig<f32> {
    let mut rig = Rig::<f32>::new(START, 1);
    rig.command(Command::Hold);
    rig.run_for(1.0);
    rig.load(&primitive(&Design { duration: 3.0, ..Design::default() })).expect("loads");
    rig
}

fn refused(output: CycleOutput, reason: Refusal) {
    assert_eq!(output.event, Some(Event::Refused(reason)), "{:?}", output.record.state);
}

/// Goes on for so many cycles while the brakes hold the arm.
fn braked(rig: &mut Rig<f32>, cycles: usize) {
    let q = rig.plant.q;
    for _ in 0..cycles {
        rig.tick(None);
        (rig.plant.q, rig.plant.dq) = (q, q * 0.0);
    }
}

/// The way back that a person goes: clear, hold, to the start, the whole movement.
fn recover(rig: &mut Rig<f32>) {
    rig.run_for(1.5);
    if rig.cycle.state() != State::Hold {
        rig.command(Command::ClearFault);
        rig.command(Command::Hold);
    }
    rig.command(Command::Approach { q: START.map(|q| q as f32), duration: 0.0 });
    rig.until(State::Hold, 20.0);
    rig.command(Command::Run(RunOptions::default()));
    rig.until(State::Hold, 10.0);
    assert_eq!(rig.cycle.fault(), Fault::None);
}

/// Time that a run takes while this is found, from its middle on (s).
fn time(caution: Caution) -> (f64, u32) {
    let mut rig = holding();
    rig.command(Command::Run(RunOptions { speed: 1.5, ..RunOptions::default() }));
    let begin = rig.number;
    rig.run_for(0.5);
    rig.cycle.set_caution(caution);
    let told = rig.tick(None).record.flags;
    rig.until(State::Hold, 20.0);
    ((rig.number - begin) as f64 * PERIOD, told & (flags::CAUTION | flags::SLOWED))
}

#[test]
fn g14_a_warning_is_told_and_a_derated_run_goes_on_at_half_speed() {
    let (free, none) = time(Caution::None);
    let (warned, flag) = time(Caution::Warned);
    let (slow, flags) = time(Caution::Slowed);
    println!("{free} {warned} {slow} s");
    assert_eq!((none, flag, flags), (0, flags::CAUTION, flags::CAUTION | flags::SLOWED));
    assert!((warned - free).abs() < 0.01 && slow > free + 1.0, "{free} {warned} {slow}");
    // No command makes it faster; once the cause is gone it goes on as was asked for last.
    let mut rig = holding();
    rig.cycle.set_caution(Caution::Slowed);
    rig.command(Command::Run(RunOptions { speed: 2.0, ..RunOptions::default() }));
    rig.run_for(1.0);
    rig.command(Command::SetSpeed { factor: 1.8 });
    refused(rig.tick(Some(Command::SetSpeed { factor: 2.5 })), Refusal::OutOfRange);
    let phase = |rig: &mut Rig<f32>| -> f32 {
        let before = rig.tick(None).record.phase.ln();
        rig.run_for(0.3);
        before - rig.last.expect("ran").record.phase.ln()
    };
    let held = phase(&mut rig);
    rig.cycle.set_caution(Caution::None);
    rig.run_for(1.0);
    let free = phase(&mut rig);
    assert!((free / held - 3.6).abs() < 0.1, "{free} against {held}");
}

/// The change that makes it fail: a run begins as fast as was asked for, and slows down within half a second.
#[test]
fn g14_a_run_that_begins_derated_is_slow_from_its_first_cycle() {
    let phases = |caution: Caution, speed: f32| {
        let mut rig = holding();
        rig.cycle.set_caution(caution);
        rig.command(Command::Run(RunOptions { speed, ..RunOptions::default() }));
        [1, 10, 60].map(|cycles| {
            (0..cycles).for_each(|_| {
                rig.tick(None);
            });
            rig.last.expect("ran").record.phase
        })
    };
    let half = phases(Caution::None, 0.5);
    assert_eq!(phases(Caution::Slowed, 2.0), half);
    assert_ne!(phases(Caution::None, 2.0), half);
}

/// The change that makes it fail: only the speed that the run is held to is looked at; then nothing refuses the other
/// one, and the run stays slow once the warning is over.
#[test]
fn g14_a_speed_that_a_movement_cannot_have_is_refused_also_while_the_arm_is_held_back() {
    for caution in [Caution::None, Caution::Slowed] {
        let mut rig = holding();
        // As short and as stiff as this takes no more than 1.4 times its speed.
        let movement = Design { duration: 0.5, stiffness: 8e3, goal: START, bent: false, ..Design::default() };
        rig.load(&primitive(&movement)).expect("loads");
        rig.cycle.set_caution(caution);
        let run = |speed| Command::Run(RunOptions { speed, ..RunOptions::default() });
        refused(rig.tick(Some(run(2.0))), Refusal::OutOfRange);
        rig.command(run(0.5));
        refused(rig.tick(Some(Command::SetSpeed { factor: 2.0 })), Refusal::OutOfRange);
    }
}

/// The change that makes it fail: an approach begins as if nothing had been found.
#[test]
fn g14_an_approach_that_begins_derated_takes_twice_the_time() {
    let time = |caution: Caution| {
        let mut rig = holding();
        rig.cycle.set_caution(caution);
        // Long, beside the time that the arm takes to settle.
        rig.command(Command::Approach { q: GOAL.map(|q| q as f32), duration: 4.0 });
        let begin = rig.number;
        rig.until(State::Hold, 40.0);
        let off = (0..7).map(|joint| (rig.plant.q[joint] - GOAL[joint]).abs()).fold(0.0, f64::max);
        assert!(off < 0.03, "{off} rad beside the target");
        (rig.number - begin) as f64 * PERIOD
    };
    let [free, warned, slow] = [Caution::None, Caution::Warned, Caution::Slowed].map(time);
    println!("{free} {warned} {slow} s");
    assert!((warned - free).abs() < 0.05 && (1.5..2.2).contains(&(slow / free)), "{free} {warned} {slow}");
}

#[test]
fn g14_a_motor_that_is_too_hot_stops_the_arm_and_lets_it_be_lowered() {
    for command in [Command::Gravity, Command::Hold, Command::Run(RunOptions::default())] {
        let mut rig = holding();
        rig.command(command);
        rig.run_for(1.0);
        rig.external = Some(Fault::MotorHot);
        rig.run_for(1.0);
        assert_eq!((rig.cycle.state(), rig.cycle.fault()), (State::SoftStop, Fault::MotorHot), "{command:?}");
        refused(rig.tick(Some(Command::ClearFault)), Refusal::CauseRemains);
        refused(rig.tick(Some(Command::Hold)), Refusal::CauseRemains);
        rig.command(Command::Release);
        rig.run_for(0.5);
        assert_eq!(rig.cycle.state(), State::Lower, "heat is no reason to stay up");
        rig.command(Command::Stop);
        rig.external = None;
        recover(&mut rig);
    }
    // An idle arm is not armed while it is hot.
    let mut rig = Rig::<f32>::new(GOAL, 1);
    rig.run_for(0.2);
    rig.external = Some(Fault::MotorHot);
    refused(rig.tick(Some(Command::Hold)), Refusal::CauseRemains);
    rig.external = None;
    rig.command(Command::Hold);
}

#[test]
fn g12_an_overrun_at_any_transition_leaves_nothing_of_the_state_behind() {
    let goal = Command::SetGoal(Goal { position: Some([0.6, 0.2, 0.0]), ..Goal::STORED });
    let speed = Command::SetSpeed { factor: 0.5 };
    let approach = Command::Approach { q: GOAL.map(|q| q as f32), duration: 3.0 };
    for command in [Command::Gravity, Command::Hold, approach, Command::Run(RunOptions::default())] {
        // With the command, in the cycle after it, on the way, and where a movement ends by itself.
        for late in [0u32, 1, 200, 1201] {
            let mut rig = holding();
            let first = rig.tick(Some(command).filter(|_| late > 0));
            assert!(late == 0 || first.event == Some(Event::Accepted));
            for _ in 1..late {
                rig.tick(None);
            }
            rig.external = Some(Fault::Overrun);
            let output = rig.tick(Some(command).filter(|_| late == 0));
            rig.external = None;
            assert_eq!((output.record.state, output.record.fault), (State::SoftStop, Fault::Overrun));
            for changes in [goal, speed] {
                refused(rig.tick(Some(changes)), Refusal::WrongState);
            }
            let rest = rig.plant.q;
            rig.run_for(1.5);
            rig.command(Command::ClearFault);
            rig.command(Command::Hold);
            for _ in 0..900 {
                let record = rig.tick(None).record;
                assert_eq!((record.state, record.phase), (State::Hold, 0.0), "nothing goes on by itself");
            }
            assert!((rig.plant.q - rest).amax() < 0.1, "{command:?} {late}: {}", rig.plant.q - rest);
            recover(&mut rig);
        }
    }
}

#[test]
fn e8_a_clear_is_refused_while_the_motors_are_silent_even_after_the_safety_module_dropped() {
    let mut rig = holding();
    rig.lose = [true; 7];
    rig.run_for(0.1);
    assert_eq!((rig.cycle.state(), rig.cycle.fault()), (State::SoftStop, Fault::RepliesLost));
    rig.safety = SafetyMode::Idle;
    braked(&mut rig, 90);
    assert_eq!((rig.cycle.state(), rig.cycle.fault()), (State::Idle, Fault::RepliesLost));
    refused(rig.tick(Some(Command::ClearFault)), Refusal::CauseRemains);
    // Nor before any position is known again.
    rig.cycle.reset();
    refused(rig.tick(Some(Command::ClearFault)), Refusal::CauseRemains);
    rig.safety = SafetyMode::Active;
    refused(rig.tick(Some(Command::Hold)), Refusal::PositionsMissing);
    rig.lose = [false; 7];
    braked(&mut rig, 30);
    refused(rig.tick(Some(Command::Hold)), Refusal::FaultLatched);
    rig.command(Command::ClearFault);
    rig.command(Command::Hold);
    recover(&mut rig);
}

#[test]
fn a15_what_an_integral_had_gathered_is_gone_after_a_drop_of_the_safety_module() {
    let mut rig = holding();
    rig.command(Command::Tare);
    // A person leans on the arm until the integrals are full.
    rig.plant.push = [0.0, 15.0, 0.0, 0.0, 0.0, 0.0];
    rig.run_for(3.0);
    rig.plant.push = [0.0; 6];
    rig.safety = SafetyMode::Idle;
    rig.tick(None);
    assert_eq!(rig.cycle.state(), State::Idle);
    let q = rig.plant.q;
    braked(&mut rig, 100);
    rig.safety = SafetyMode::Active;
    for _ in 0..100 {
        let output = rig.tick(None);
        assert_eq!(output.record.tau, [0.0; 7], "not before a person arms it");
        (rig.plant.q, rig.plant.dq) = (q, q * 0.0);
    }
    let frames = control::model::Frames::new(rig.cycle.model(), &JointPositions::from_f32(q.map(|q| q as f32).into()));
    let gravity = rig.cycle.model().gravity_torque(&frames).0;
    let mut output = rig.command(Command::Hold);
    for _ in 0..periods(0.1) {
        (rig.plant.q, rig.plant.dq) = (q, q * 0.0);
        output = rig.tick(None);
    }
    for (joint, (torque, gravity)) in output.record.tau.iter().zip(gravity.iter()).enumerate() {
        assert!((torque - gravity).abs() < 0.3, "J{}: {torque} N m, gravity {gravity}", joint + 1);
    }
    recover(&mut rig);
}

/// The changes that make it fail: a tare does not ask if the arm moves; it does not ask what presses.
#[test]
fn b5_a_sensor_is_tared_at_rest_and_not_while_somebody_presses_on_it() {
    let mut rig = holding();
    rig.command(Command::Tare);
    // As much as a tool that is mounted may weigh.
    rig.plant.push[0] = 15.0;
    rig.run_for(1.0);
    rig.command(Command::Tare);
    // It stands whatever presses.
    let friction = rig.plant.coulomb;
    rig.plant.coulomb *= 100.0;
    rig.plant.push[0] = 40.0;
    rig.run_for(1.0);
    assert_eq!(rig.tick(Some(Command::Tare)).event, Some(Event::Refused(Refusal::ForceAtRest)));
    rig.plant.push[0] = 15.0;
    rig.run_for(1.0);
    rig.plant.coulomb = friction;
    let zero = rig.last.expect("ran").record.wrench[0];
    assert!(zero.abs() < 0.5, "the zero from before holds: {zero}");
    rig.command(Command::Approach { q: [0.0; 7], duration: 0.0 });
    rig.run_for(0.7);
    assert_eq!(rig.tick(Some(Command::Tare)).event, Some(Event::Refused(Refusal::Moving)));
}
