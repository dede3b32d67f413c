//! Lost replies: the bridge, and what happens when it ends.

use control::act::limit::STEP_LIMIT;
use control::command::{Command, Refusal, RunOptions};
use control::sense::joints::COAST_CYCLES;
use control::{Event, Fault, RATE_HZ, State};

use crate::primitives::{Design, START, primitive};
use crate::rig::Rig;

/// A rig in the middle of a run.
fn running(seconds: f64) -> Rig<f32> {
    let mut rig = Rig::<f32>::new(START, 1);
    rig.load(&primitive(&Design { duration: 3.0, ..Design::default() })).expect("loads");
    rig.command(Command::Hold);
    rig.run_for(2.0);
    rig.command(Command::Run(RunOptions::default()));
    rig.run_for(seconds);
    rig
}

/// The positions of 60 cycles from a moment on, with `cycles` replies of the chosen motors lost at first; checks
/// torque.
fn with_losses(rig: &mut Rig<f32>, motors: [bool; 7], cycles: usize) -> Vec<[f64; 7]> {
    let mut last = rig.last.expect("ran").record.tau;
    (0..60)
        .map(|cycle| {
            rig.lose = if cycle < cycles { motors } else { [false; 7] };
            let record = rig.tick(None).record;
            let expected = if cycle < cycles { State::Coast } else { State::Run };
            assert_eq!(record.state, expected, "cycle {cycle}");
            for joint in 0..7 {
                let step = (record.tau[joint] - last[joint]).abs();
                assert!(step <= STEP_LIMIT[joint] as f32 * 1.0001, "J{}: {step}", joint + 1);
            }
            last = record.tau;
            rig.plant.q.into()
        })
        .collect()
}

fn deviation(a: &[[f64; 7]], b: &[[f64; 7]]) -> f64 {
    a.iter().zip(b).flat_map(|(a, b)| a.iter().zip(b).map(|(a, b)| (a - b).abs())).fold(0.0, f64::max)
}

#[test]
fn a1_single_lost_reply_causes_no_torque_step_and_no_lasting_error() {
    for moment in [0.1, 0.7, 1.2, 2.0] {
        let nominal = with_losses(&mut running(moment), [false; 7], 0);
        for motor in 0..7 {
            let mut motors = [false; 7];
            motors[motor] = true;
            let path = with_losses(&mut running(moment), motors, 1);
            let worst = deviation(&path, &nominal);
            assert!(worst <= 2e-3, "M{} at {moment} s: {worst} rad", motor + 1);
        }
    }
}

#[test]
fn a2_up_to_five_lost_cycles_are_bridged() {
    for cycles in 2..=5 {
        for motors in [
            [false, true, false, false, false, false, false],
            [false, false, false, false, true, false, false],
            [true; 7],
        ] {
            let nominal = with_losses(&mut running(0.9), [false; 7], 0);
            let path = with_losses(&mut running(0.9), motors, cycles);
            let worst = deviation(&path, &nominal);
            assert!(worst <= 10e-3, "{cycles} cycles: {worst} rad");
        }
    }
}

#[test]
fn a3_six_lost_cycles_stop_the_arm_softly() {
    let mut rig = running(0.9);
    let q = rig.plant.q;
    rig.lose = [true; 7];
    for cycle in 1..=COAST_CYCLES + 1 {
        rig.tick(None);
        let expected = if cycle <= COAST_CYCLES { State::Coast } else { State::SoftStop };
        assert_eq!(rig.cycle.state(), expected, "cycle {cycle}");
    }
    assert_eq!(rig.cycle.fault(), Fault::RepliesLost);
    // The replies come back; the stop stays.
    rig.lose = [false; 7];
    rig.run_for(0.3);
    assert_eq!(rig.cycle.state(), State::SoftStop);
    assert!(rig.plant.dq.amax() < 0.05, "{}", rig.plant.dq);
    assert!((rig.plant.q - q).amax() < 0.05, "{}", rig.plant.q - q);
}

#[test]
fn replies_that_stay_away_take_torque_off() {
    let mut rig = running(0.9);
    rig.lose = [true; 7];
    rig.until(State::Fault, 0.3);
    assert_eq!(rig.cycle.fault(), Fault::RepliesLostForLong, "the same loss, gone on");
    assert_eq!(rig.tick(None).record.tau, [0.0; 7]);
}

#[test]
fn a4_random_loss_of_one_percent_does_not_disturb_the_run() {
    let mut rig = running(0.0);
    let mut seed = 1u64;
    let mut last = rig.last.expect("ran").record.tau;
    while rig.cycle.state() != State::Hold {
        for lose in &mut rig.lose {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            *lose = (seed >> 40).is_multiple_of(100);
        }
        let record = rig.tick(None).record;
        assert!(matches!(record.state, State::Run | State::Coast | State::Hold), "{record:?}");
        for joint in 0..7 {
            assert!((record.tau[joint] - last[joint]).abs() <= STEP_LIMIT[joint] as f32 * 1.0001);
        }
        last = record.tau;
        assert!(rig.number < u64::from(RATE_HZ) * 30);
    }
}

#[test]
fn while_replies_are_missing_the_feedback_is_frozen() {
    let mut rig = Rig::<f32>::new(START, 0);
    rig.command(Command::Hold);
    rig.run_for(2.0);
    // A sideways push sets J1 in motion; gravity has no part in its torque.
    rig.plant.push[1] = 40.0;
    rig.run_for(0.05);
    let before = rig.last.expect("ran").record;
    assert!(before.dq[0].abs() > 0.02, "J1 moves: {:?}", before.dq);
    rig.lose = [true; 7];
    for _ in 0..5 {
        let record = rig.tick(None).record;
        assert_eq!(record.state, State::Coast);
        let change = (record.tau[0] - before.tau[0]).abs();
        assert!(change < 0.02, "{change} N m from a position that nobody measured");
    }
}

#[test]
fn a7_a_motor_that_begins_to_count_anew_stops_the_arm_softly_without_a_step_and_for_good() {
    for (motor, jump) in [(0, 30_000), (1, -5_000), (3, 1 << 20), (4, 2_000), (6, -100_000)] {
        let mut rig = running(0.9);
        rig.jump[motor] = jump;
        let mut last = rig.last.expect("ran").record.tau;
        for cycle in 0..600 {
            let record = rig.tick(None).record;
            let state = if cycle == 0 { State::Coast } else { State::SoftStop };
            assert_eq!(record.state, state, "M{} by {jump}, cycle {cycle}", motor + 1);
            for joint in 0..7 {
                let step = (record.tau[joint] - last[joint]).abs();
                assert!(step <= STEP_LIMIT[joint] as f32 * 1.0001, "J{}: {step}", joint + 1);
                // The posture is still the one that the arm has, so that gravity is carried.
                let error = f64::from(record.q[joint]) - rig.plant.q[joint];
                assert!(error.abs() < 0.01, "M{} by {jump}, cycle {cycle}, J{}: {error}", motor + 1, joint + 1);
            }
            last = record.tau;
        }
        assert_eq!(rig.cycle.fault(), Fault::ImplausiblePosition);
        assert!(rig.plant.dq.amax() < 1e-3, "{}", rig.plant.dq);
        // No Clear leads on: nobody knows where zero is.
        assert_eq!(rig.tick(Some(Command::ClearFault)).event, Some(Event::Refused(Refusal::ZeroLost)));
        assert_eq!((rig.cycle.state(), rig.cycle.fault()), (State::SoftStop, Fault::ImplausiblePosition));
        // A new start with a new zero: the arm can be used again.
        rig.cycle.reset();
        rig.jump = [0; 7];
        rig.tick(None);
        rig.command(Command::ClearFault);
        rig.command(Command::Hold);
        rig.run_for(0.3);
        assert_eq!((rig.cycle.state(), rig.cycle.fault()), (State::Hold, Fault::None));
    }
}
