//! Joint estimation: wrap, loss, implausible replies, noise of quantisation; and the wrench filter.

use control::sense::JointEstimator;
use control::sense::filter::{Butterworth, LowPass};
use control::sense::joints::COAST_CYCLES;
use control::units::{JointPositions, Vector7};
use control::{Calibration, Payload, RATE, Real, model};
use nalgebra::SVector;
use puck::Counts;

type Replies = [Option<Counts>; 7];

fn replies(calibration: &Calibration<f64>, q: [f64; 7]) -> Replies {
    let motor = calibration.transmission().motor_from_joint(&q);
    calibration.drives().counts(&motor).expect("finite").map(|counts| Some(counts.wrapped()))
}

fn nominal<R: Real>() -> Calibration<R> {
    Calibration::nominal(Payload::SensorAndHand)
}

#[test]
fn the_transmission_of_the_bus_is_that_of_the_arm_model() {
    let calibration = nominal::<f64>();
    for joint in 0..7 {
        let mut unit = [0.0; 7];
        unit[joint] = 1.0;
        let motors = calibration.transmission().motor_from_joint(&unit);
        for (motor, row) in model::JOINT_TO_MOTOR.iter().enumerate() {
            let expected = row[joint];
            // The model file rounds N3/n3 to six digits.
            assert!(
                (motors[motor] - expected).abs() < 1e-4,
                "M{} J{}: {} {expected}",
                motor + 1,
                joint + 1,
                motors[motor]
            );
        }
    }
}

#[test]
fn a_calibration_with_garbage_scales_is_refused() {
    let good = ([4096; 7], [2472; 7]);
    assert!(Calibration::<f32>::new(good.0, good.1, Payload::None).is_ok());
    for bad in [0, -4096, 255, i32::MAX] {
        let mut counts = good.0;
        counts[4] = bad;
        let error = Calibration::<f32>::new(counts, good.1, Payload::None).expect_err("refused");
        assert_eq!(error, control::CalibrationError::CountsPerRevolution(4));
        let mut torques = good.1;
        torques[2] = if bad == i32::MAX { bad } else { bad.min(499) };
        assert!(Calibration::<f32>::new(good.0, torques, Payload::None).is_err());
    }
}

#[test]
fn positions_are_those_of_the_counts() {
    let q = [0.3, -1.2, 0.7, 2.1, -3.0, 0.4, -2.2];
    let calibration = nominal::<f64>();
    let mut estimator = JointEstimator::<f32>::new(&nominal());
    let state = estimator.update(&replies(&calibration, q), false).expect("complete");
    for (estimate, true_angle) in state.q.0.iter().zip(q) {
        assert!((f64::from(*estimate) - true_angle).abs() < 2e-4, "{state:?}");
    }
    assert_eq!(state.dq.0, Vector7::zeros());
}

#[test]
fn nothing_is_known_before_all_seven_answer_together() {
    let calibration = nominal::<f64>();
    let mut estimator = JointEstimator::<f32>::new(&nominal());
    let mut partial = replies(&calibration, [0.1; 7]);
    partial[6] = None;
    assert!(estimator.update(&partial, false).is_none());
    assert!(estimator.update(&[None; 7], false).is_none());
    assert!(estimator.update(&replies(&calibration, [0.1; 7]), false).is_some());
}

#[test]
fn a9_the_22_bit_counter_wraps_without_a_step() {
    let mut estimator = JointEstimator::<f64>::new(&nominal());
    // J1 turns so far (on paper) that the counter of M1 passes 2^21.
    let start = (1 << 21) - 50;
    let mut last: Option<f64> = None;
    for step in 0..100 {
        let mut counts = [Some(Counts(0)); 7];
        counts[0] = Some(Counts(start + step).wrapped());
        let state = estimator.update(&counts, true).expect("complete");
        assert_eq!((state.missing, state.implausible), (0, false));
        if let Some(last) = last {
            let expected = -std::f64::consts::TAU / 4096.0 / 42.0;
            assert!((state.q.0[0] - last - expected).abs() < 1e-9);
        }
        last = Some(state.q.0[0]);
    }
}

#[test]
fn constant_speed_is_estimated_without_bias_and_with_little_noise() {
    let calibration = nominal::<f64>();
    let mut estimator = JointEstimator::<f32>::new(&nominal());
    let speed = [0.5, -0.4, 0.6, -0.5, 1.0, -0.8, 1.2];
    let (mut sum, mut square, mut count) = ([0.0f64; 7], [0.0f64; 7], 0.0);
    for cycle in 0..400 {
        let q = speed.map(|speed| 0.2 + speed * cycle as f64 / RATE);
        let state = estimator.update(&replies(&calibration, q), true).expect("complete");
        if cycle > 60 {
            for joint in 0..7 {
                let error = f64::from(state.dq.0[joint]) - speed[joint];
                sum[joint] += error;
                square[joint] += error * error;
            }
            count += 1.0;
        }
    }
    for joint in 0..7 {
        let (mean, rms) = (sum[joint] / count, (square[joint] / count).sqrt());
        assert!(mean.abs() < 2e-3 && rms < 6e-3, "J{}: mean {mean}, rms {rms} rad/s", joint + 1);
    }
}

#[test]
fn a1_a_lost_reply_changes_position_and_velocity_by_little() {
    let calibration = nominal::<f64>();
    let run = |lost: std::ops::Range<i32>| {
        let mut estimator = JointEstimator::<f64>::new(&nominal());
        let mut states = Vec::new();
        for cycle in 0..140 {
            // One rad/s with some acceleration.
            let t = f64::from(cycle) / RATE;
            let q = [0.8 * t + 0.5 * t * t; 7];
            let mut sample = replies(&calibration, q);
            if lost.contains(&cycle) {
                sample[0] = None;
                sample[4] = None;
            }
            states.push(estimator.update(&sample, true).expect("complete"));
        }
        states
    };
    let nominal_states = run(0..0);
    for length in 1..=5 {
        for (cycle, (a, b)) in run(100..100 + length).iter().zip(&nominal_states).enumerate() {
            let dq = (a.q.0 - b.q.0).amax();
            let ddq = (a.dq.0 - b.dq.0).amax();
            assert!(dq < 5e-4 && ddq < 0.03, "{length} lost, cycle {cycle}: {dq} rad, {ddq} rad/s");
            let lost = cycle >= 100 && cycle < 100 + length as usize;
            assert_eq!(a.missing, if lost { 2 } else { 0 });
        }
    }
}

#[test]
fn a7_a_jump_of_counts_is_rejected_and_never_believed_while_torque_is_on() {
    let calibration = nominal::<f64>();
    for jump in [400, 5_000, 100_000, 1 << 20] {
        let mut estimator = JointEstimator::<f64>::new(&nominal());
        let mut sample = replies(&calibration, [0.2; 7]);
        let before = estimator.update(&sample, true).expect("complete");
        sample[1] = sample[1].map(|counts| Counts(counts.0 + jump).wrapped());
        for cycle in 1..=20 {
            let state = estimator.update(&sample, true).expect("known");
            // The gate opens with the time since the last reply, up to six cycles.
            if jump > 6 * 300 {
                assert!(state.implausible && state.age == cycle, "jump {jump}: {state:?}");
                assert!((state.q.0 - before.q.0).amax() < 1e-3);
            }
        }
        // Without torque, two replies that agree are taken as the new truth.
        estimator.update(&sample, false);
        let state = estimator.update(&sample, false).expect("known");
        assert_eq!(state.missing, 0);
    }
}

#[test]
fn after_the_bridge_the_estimate_stands_still() {
    let calibration = nominal::<f64>();
    let mut estimator = JointEstimator::<f64>::new(&nominal());
    for cycle in 0..100 {
        estimator.update(&replies(&calibration, [0.5 * f64::from(cycle) / RATE; 7]), true);
    }
    let mut last = JointPositions::<f64>::zero();
    for cycle in 0..60u8 {
        let state = estimator.update(&[None; 7], true).expect("known");
        if cycle > COAST_CYCLES {
            assert!((state.q.0 - last.0).amax() < 1e-12);
        }
        if cycle > 40 {
            assert!(state.dq.0.amax() < 1e-3, "{state:?}");
        }
        last = state.q;
    }
}

#[test]
fn the_filter_has_unit_gain_at_rest_and_half_power_at_its_cut_off() {
    let gain = |frequency: f64| {
        let mut filter = LowPass::<f64, 1>::new(Butterworth::new(50.0, 300.0));
        let (mut inputs, mut outputs) = (0.0, 0.0);
        for k in 0..3000 {
            let x = (std::f64::consts::TAU * frequency * f64::from(k) / 300.0).sin();
            let y = filter.step(&SVector::from([x]))[0];
            if k >= 1500 {
                inputs += x * x;
                outputs += y * y;
            }
        }
        (outputs / inputs).sqrt()
    };
    assert!((gain(0.2) - 1.0).abs() < 1e-3);
    assert!((gain(50.0) - 0.5f64.sqrt()).abs() < 1e-3);
    assert!(gain(120.0) < 0.05);
    let mut filter = LowPass::<f64, 1>::new(Butterworth::new(15.0, 300.0));
    filter.settle(&SVector::from([3.0]));
    for _ in 0..10 {
        assert!((filter.step(&SVector::from([3.0]))[0] - 3.0).abs() < 1e-12);
    }
}
