//! `WrenchEstimator`: what is believed of the sensor, its zero, its age, and the wrench at the grasp point.

use control::model::{ArmModel, Frames};
use control::sense::wrench::FullScale;
use control::sense::{Deviation, Drift, WrenchEstimator};
use control::time::periods;
use control::units::{JointPositions, Vector6, Wrench};
use control::{Payload, RATE};
use nalgebra::Vector3;
use puck::{GaugeStatus, RawWrench};

/// A sample of the sensor (N, N m, sensor axes).
fn sample(force: [f64; 3], torque: [f64; 3]) -> RawWrench {
    let counts = |values: [f64; 3], scale: f64| values.map(|value| (value * scale).round() as i16);
    RawWrench { force: counts(force, 256.0), torque: counts(torque, 4096.0), status: None }
}

/// A sample of this force along x alone.
fn along_x(force: f64) -> RawWrench {
    sample([force, 0.0, 0.0], [0.0; 3])
}

/// The same as the sensor sends it with this status.
fn judged(force: f64, status: u8) -> RawWrench {
    RawWrench { status: Some(GaugeStatus(status)), ..along_x(force) }
}

/// A cycle of a hand without weight.
fn take(estimator: &mut WrenchEstimator<f64>, raw: Option<RawWrench>, at_rest: bool) {
    estimator.update(raw.as_ref(), Some(&Vector6::zeros()), at_rest);
}

/// An estimator after so many cycles at rest, in which nothing changes.
fn rested(raw: &RawWrench, cycles: u16) -> WrenchEstimator<f64> {
    let mut estimator = WrenchEstimator::new();
    for _ in 0..cycles {
        take(&mut estimator, Some(*raw), true);
    }
    estimator
}

fn frames(q: [f64; 7]) -> Frames<f64> {
    Frames::new(&ArmModel::new(Payload::SensorAndHand), &JointPositions::from_array(q))
}

const POSTURE: [f64; 7] = [-0.49, 1.56, 1.47, 1.85, -0.17, -0.58, 1.75];

/// Time at rest after which there is a mean, in control periods.
fn half() -> u16 {
    periods(0.15)
}

#[test]
fn nothing_is_known_before_the_first_sample_in_a_known_posture() {
    let mut estimator = WrenchEstimator::<f64>::default();
    let known = |estimator: &mut WrenchEstimator<f64>| {
        let tared = estimator.tare();
        assert_eq!(estimator.is_tared(), tared);
        let wrench = estimator.wrench(&frames(POSTURE));
        (estimator.age(), tared, estimator.raw_force() > 1e-9, wrench.force.norm() + wrench.torque.norm() > 1e-9)
    };
    take(&mut estimator, None, true);
    assert_eq!(known(&mut estimator), (None, false, false, false));
    estimator.update(Some(&along_x(3.0)), None, true);
    assert_eq!(known(&mut estimator), (Some(0), false, false, false));
    take(&mut estimator, Some(along_x(3.0)), true);
    assert!(estimator.raw_force() == 3.0 && estimator.wrench(&frames(POSTURE)) != Wrench::zero());
    assert_eq!(known(&mut estimator), (Some(0), true, false, false));
}

#[test]
fn a_sample_that_is_lost_or_bad_is_bridged_by_the_last_and_the_wrench_grows_old() {
    let mut estimator = rested(&along_x(0.5), 1);
    for (age, raw) in [(1, None), (2, Some(judged(0.75, 0x40))), (3, None)] {
        take(&mut estimator, raw, false);
        assert_eq!((estimator.age(), estimator.raw_force(), estimator.is_saturated()), (Some(age), 0.5, false));
    }
    take(&mut estimator, Some(along_x(0.75)), false);
    assert_eq!((estimator.age(), estimator.raw_force()), (Some(0), 0.75));
}

#[test]
fn a_step_of_more_than_a_newton_or_a_twentieth_of_a_newton_metre_is_believed_with_its_second_sample() {
    let zero = [0.0; 3];
    for axis in 0..3 {
        for sign in [1.0, -1.0] {
            let along = |value: f64| {
                let mut parts = zero;
                parts[axis] = sign * value;
                parts
            };
            let at_once = |raw: RawWrench| {
                let mut estimator = rested(&sample(zero, zero), 1);
                take(&mut estimator, Some(raw), false);
                let first = estimator.raw_force();
                take(&mut estimator, Some(raw), false);
                assert!(estimator.raw_force() > 0.0, "the second sample is believed");
                first > 0.0
            };
            assert!(at_once(sample(along(1.0), zero)) && !at_once(sample(along(1.0 + 1.0 / 256.0), zero)));
            let touch = [1.0 / 256.0; 3];
            assert!(at_once(sample(touch, along(0.049))) && !at_once(sample(touch, along(0.051))));
        }
    }
}

#[test]
fn what_changes_fast_is_one_cycle_late_once_and_a_wild_sample_is_not_believed() {
    let mut estimator = rested(&along_x(8.0), 1);
    let mut believed = |force: f64| {
        take(&mut estimator, Some(along_x(force)), false);
        estimator.raw_force()
    };
    assert_eq!([8.5, 20.0, 8.5].map(&mut believed), [8.5, 8.5, 8.5], "a wild sample");
    assert_eq!([12.0, 16.0, 20.0, 24.0].map(&mut believed), [8.5, 16.0, 20.0, 24.0], "a blow");
    assert_eq!([24.0, 20.0, 24.0].map(&mut believed), [24.0, 24.0, 24.0], "wild again");
}

#[test]
fn the_weight_of_the_hand_is_taken_off_before_anything_else() {
    let mut estimator = WrenchEstimator::<f64>::new();
    let weight = Vector6::new(4.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    estimator.update(Some(&along_x(10.0)), Some(&weight), true);
    assert_eq!(estimator.raw_force(), 6.0);
    let at_rest = estimator.rest_force() - Vector3::new(6.0, 0.0, 0.0);
    assert!(at_rest.norm() < 1e-9, "a bias is there from the first sample on: {at_rest}");
    assert!(estimator.tare());
    assert!(estimator.raw_force() < 1e-9 && estimator.rest_force().norm() < 1e-9);
    estimator.update(Some(&along_x(9.0)), Some(&weight), true);
    assert!((estimator.raw_force() - 1.0).abs() < 1e-9);
}

#[test]
fn the_force_at_rest_is_the_mean_of_the_last_samples_that_were_measured() {
    let mut estimator = rested(&along_x(0.5), half());
    let more = half() / 3;
    for _ in 0..more {
        take(&mut estimator, Some(along_x(1.0)), true);
        take(&mut estimator, None, true);
    }
    let samples = f64::from(half() + more);
    let mean = (0.5 * f64::from(half()) + f64::from(more)) / samples;
    assert!((estimator.rest_force().x - mean).abs() < 1e-12, "{} {mean}", estimator.rest_force());
    for _ in more..half() {
        take(&mut estimator, Some(along_x(1.0)), true);
    }
    assert_eq!(estimator.rest_force().x, 1.0, "what is older than a whole block is forgotten");
    // A motion ends the rest; the filter follows at once.
    take(&mut estimator, Some(along_x(0.0)), false);
    let filtered = estimator.rest_force().x;
    assert!(filtered > 0.9 && filtered < 1.0, "{filtered}");
    for _ in 0..half() / 2 {
        take(&mut estimator, Some(along_x(0.0)), true);
    }
    assert!(estimator.rest_force().x.abs() < 0.01, "{}", estimator.rest_force());
}

#[test]
fn the_first_rest_tares_by_itself_and_no_later_one() {
    let mut estimator = rested(&along_x(0.5), half() - 1);
    estimator.tare_first();
    assert!(!estimator.is_tared());
    take(&mut estimator, Some(along_x(0.5)), true);
    estimator.tare_first();
    assert!(estimator.is_tared() && estimator.rest_force().x == 0.0);
    for _ in 0..half() {
        take(&mut estimator, Some(along_x(1.0)), true);
    }
    estimator.tare_first();
    assert_eq!(estimator.rest_force().x, 0.5);
}

#[test]
fn a_tare_by_itself_takes_away_up_to_a_newton_of_drift_and_no_load() {
    let drifted = |tared: bool, force: [f64; 3]| {
        let mut estimator = rested(&sample([0.0; 3], [0.0; 3]), half());
        assert!(!tared || estimator.tare());
        for _ in 0..2 * half() {
            take(&mut estimator, Some(sample(force, [0.0; 3])), true);
        }
        estimator.tare_drift();
        estimator.rest_force().norm() == 0.0
    };
    for axis in 0..3 {
        for sign in [1.0, -1.0] {
            let along = |value: f64| {
                let mut force = [0.0; 3];
                force[axis] = sign * value;
                force
            };
            assert!(drifted(true, along(0.9)) && !drifted(true, along(1.1)));
            assert!(drifted(false, along(1.1)), "the first tare takes whatever is there");
        }
    }
}

#[test]
fn what_was_followed_in_a_run_counts_for_the_next_tare_as_the_tare_before_it_does() {
    // The sensor drifts by 0.8 N while the hand moves freely, and goes on to 1.5 N at rest.
    let mut estimator = rested(&sample([0.0; 3], [0.0; 3]), half());
    assert!(estimator.tare());
    let (mut drift, here) = (Drift::new(), frames(POSTURE));
    for tick in 0..(6.0 * RATE) as u32 {
        take(&mut estimator, Some(along_x(f64::min(0.2 * f64::from(tick) / RATE, 0.8))), false);
        let measured = estimator.wrench(&here);
        let deviation = Deviation::new(&[0.0; 9], &measured, None);
        estimator.follow(&mut drift, &measured, (Some(&deviation), false), &here);
    }
    assert!(estimator.raw_force() < 0.05, "{}", estimator.raw_force());
    for _ in 0..2 * half() {
        take(&mut estimator, Some(along_x(1.5)), true);
    }
    assert!(estimator.rest_force().x > 0.6);
    estimator.tare_drift();
    assert_eq!(estimator.rest_force().x, 0.0);
}

#[test]
fn full_scale_is_counted_in_each_axis_either_way_and_forgotten_with_a_sample_within_the_range() {
    // The frame cannot carry what the sensor can measure along z.
    let ranges = [(0, 80.0), (1, 80.0), (2, 32_767.0 / 256.0)];
    let mut tried = ranges.map(|(axis, range)| (axis, range, true)).to_vec();
    tried.extend([0, 1, 2].map(|axis| (axis, 2.75, false)));
    for (axis, range, is_force) in tried {
        for sign in [1.0, -1.0] {
            let at = |share: f64| {
                let mut parts = [0.0; 3];
                parts[axis] = sign * share * range;
                if is_force { sample(parts, [0.0; 3]) } else { sample([0.0; 3], parts) }
            };
            let mut estimator = WrenchEstimator::<f64>::new();
            for (share, expected) in [(0.989, 0), (0.991, 1), (0.995, 2), (0.991, 3), (0.989, 0), (0.991, 1)] {
                take(&mut estimator, Some(at(share)), false);
                let counted = if is_force {
                    FullScale { force: expected, torque: 0 }
                } else {
                    FullScale { force: 0, torque: expected }
                };
                assert_eq!(estimator.full_scale(), counted, "axis {axis}, {share} of {range}");
                assert_eq!(estimator.is_saturated(), expected > 0);
            }
        }
    }
}

#[test]
fn gauges_at_their_end_are_told_and_a_bad_sample_of_them_counts_as_full_scale() {
    let mut estimator = rested(&along_x(0.5), 1);
    for (status, force, is_saturated) in
        [(0x01, 0, true), (0x80, 0, false), (0x41, 1, true), (0x60, 2, true), (0x40, 2, true), (0x00, 0, false)]
    {
        take(&mut estimator, Some(judged(0.5, status)), false);
        assert_eq!(estimator.full_scale(), FullScale { force, torque: 0 }, "{status:#04x}");
        assert_eq!(estimator.is_saturated(), is_saturated, "{status:#04x}");
    }
}

#[test]
fn a_sample_that_is_lost_confirms_no_full_scale() {
    let mut estimator = rested(&along_x(0.5), 1);
    for (raw, force) in [(Some(along_x(79.9)), 1), (None, 0), (Some(along_x(79.9)), 1), (Some(along_x(79.9)), 2)] {
        take(&mut estimator, raw, false);
        assert_eq!(estimator.full_scale(), FullScale { force, torque: 0 }, "{raw:?}");
    }
}

/// The sensor's sample of a wrench of the environment at the grasp point (world axes).
fn sensed(frames: &Frames<f64>, force: Vector3<f64>, torque: Vector3<f64>) -> RawWrench {
    let to_sensor = frames.sensor_to_world().transpose();
    let torque = torque - frames.tool_to_sensor().cross(&force);
    sample((to_sensor * force).into(), (to_sensor * torque).into())
}

#[test]
fn a_wrench_at_the_grasp_point_is_measured_as_it_acts_in_every_posture() {
    for q in [POSTURE, [0.3, 0.9, -0.4, 1.6, -1.5, 0.9, -1.0], [0.0; 7]] {
        let here = frames(q);
        for (force, torque) in [
            (Vector3::new(2.0, -3.0, 5.0), Vector3::zeros()),
            (Vector3::zeros(), Vector3::new(0.3, -0.2, 0.5)),
            (Vector3::new(-1.0, 4.0, 2.0), Vector3::new(-0.1, 0.4, 0.2)),
        ] {
            let mut estimator = WrenchEstimator::<f64>::new();
            take(&mut estimator, Some(sensed(&here, force, torque)), false);
            let measured = estimator.wrench(&here);
            let torque = here.tool_to_world().transpose() * torque;
            assert!((measured.force - force).norm() < 0.01, "{measured:?}");
            assert!((measured.torque - torque).norm() < 0.002, "{measured:?} {torque}");
        }
    }
}

#[test]
fn what_is_expected_is_no_error_of_the_sensor_and_what_is_not_is_one() {
    let here = frames(POSTURE);
    let (force, torque) = (Vector3::new(0.05, -0.05, 0.08), Vector3::new(0.01, 0.015, -0.01));
    let in_tool = here.tool_to_world().transpose() * torque;
    let expected = [force.x, force.y, force.z, in_tool.x, in_tool.y, in_tool.z, 0.0, 0.0, 0.0];
    for (expected, is_followed) in [(Some(expected), false), (Some([0.0; 9]), true), (None, false)] {
        let mut estimator = rested(&sample([0.0; 3], [0.0; 3]), half());
        assert!(estimator.tare());
        let mut drift = Drift::new();
        for _ in 0..(6.0 * RATE) as u32 {
            take(&mut estimator, Some(sensed(&here, force, torque)), false);
            let measured = estimator.wrench(&here);
            let deviation = expected.map(|expected| Deviation::new(&expected, &measured, None));
            estimator.follow(&mut drift, &measured, (deviation.as_ref(), false), &here);
        }
        let left = estimator.wrench(&here);
        let (force, in_tool) = if is_followed { (Vector3::zeros(), Vector3::zeros()) } else { (force, in_tool) };
        assert!((left.force - force).norm() < 0.01, "{left:?} {force}");
        assert!((left.torque - in_tool).norm() < 0.002, "{left:?} {in_tool}");
    }
}

#[test]
fn an_error_of_the_force_alone_is_followed_as_such_and_takes_no_torque_along() {
    let here = frames(POSTURE);
    let mut estimator = rested(&sample([0.0; 3], [0.0; 3]), half());
    assert!(estimator.tare());
    let mut drift = Drift::new();
    for _ in 0..(2.0 * RATE) as u32 {
        take(&mut estimator, Some(sample([0.1, 0.1, -0.1], [0.0; 3])), false);
        let measured = estimator.wrench(&here);
        // A force at the sensor and nothing else.
        let torque = here.tool_to_world().transpose() * here.tool_to_sensor().cross(&measured.force);
        assert!((measured.torque - torque).norm() < 1e-9, "{measured:?} {torque}");
        estimator.follow(&mut drift, &measured, (Some(&Deviation::new(&[0.0; 9], &measured, None)), false), &here);
    }
    assert!(estimator.raw_force() < 0.02, "{}", estimator.raw_force());
}
