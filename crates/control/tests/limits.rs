//! Torque limits leave room for what the arm weighs, and nothing finite or not gets past them.

use control::act::TorqueLimiter;
use control::act::hand::{HandLimiter, TORQUE_LIMIT};
use control::act::limit::{LimitReport, MOTOR_COUNTS_LIMIT, STEP_LIMIT, WORST_GRAVITY};
use control::model::{ArmModel, Frames};
use control::units::{JointPositions, JointTorques, Vector7};
use control::{Calibration, PERIOD, Payload, model};
use proptest::prelude::*;

/// Largest gravity torque per joint over a grid of postures within the mechanical stops (J1 does not matter).
fn worst_gravity() -> [f64; 7] {
    let arm = ArmModel::<f64>::new(Payload::SensorAndHand);
    let mut worst = [0.0f64; 7];
    let steps = |joint: usize, count: usize| {
        let (min, max) = (model::POSITION_MIN[joint], model::POSITION_MAX[joint]);
        (0..=count).map(move |step| min + (max - min) * step as f64 / count as f64)
    };
    for q2 in steps(1, 16) {
        for q3 in steps(2, 14) {
            for q4 in steps(3, 20) {
                for q5 in steps(4, 12) {
                    for q6 in steps(5, 10) {
                        let q = JointPositions::from_array([0.0, q2, q3, q4, q5, q6, 0.5]);
                        let gravity = arm.gravity_torque(&Frames::new(&arm, &q));
                        for (worst, torque) in worst.iter_mut().zip(gravity.0.iter()) {
                            *worst = worst.max(torque.abs());
                        }
                    }
                }
            }
        }
    }
    worst
}

#[test]
fn the_worst_gravity_torque_is_the_one_the_limits_are_made_for() {
    let worst = worst_gravity();
    println!("worst gravity torque: {worst:.2?} N m");
    for joint in 0..7 {
        let stated = WORST_GRAVITY[joint];
        assert!(
            worst[joint] <= stated + 1e-9 && stated <= worst[joint] + 0.5,
            "J{}: {} {stated}",
            joint + 1,
            worst[joint]
        );
    }
}

fn limiter() -> TorqueLimiter<f64> {
    TorqueLimiter::new(&Calibration::nominal(Payload::SensorAndHand))
}

#[test]
fn every_posture_can_be_held_with_room_for_control() {
    let mut limiter = limiter();
    let arm = ArmModel::<f64>::new(Payload::SensorAndHand);
    // Outstretched forwards: the heaviest posture of J2.
    let q = JointPositions::from_array([0.0, 1.57, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let mut wanted = arm.gravity_torque(&Frames::new(&arm, &q));
    for (torque, extra) in wanted.0.iter_mut().zip(model::CONTROL_SIGNAL_LIMIT) {
        *torque += torque.signum() * extra * 0.4;
    }
    let mut report = LimitReport::default();
    for _ in 0..200 {
        report = limiter.limit(&wanted).1;
    }
    assert_eq!(report, LimitReport::default());
    assert!((limiter.last().torques().0 - wanted.0).amax() < 1e-9);
}

#[test]
fn a_limit_that_cut_is_told_and_a_reset_begins_from_nothing() {
    for bits in 0..8 {
        let report =
            LimitReport { joint: bits & 1 != 0, motor: bits & 2 != 0, rate: bits & 4 != 0, ..LimitReport::default() };
        assert_eq!(report.is_cut(), bits != 0, "{report:?}");
    }
    let mut limiter = limiter();
    let wanted = JointTorques(Vector7::from(STEP_LIMIT));
    limiter.limit(&wanted);
    assert_ne!(*limiter.last().torques(), JointTorques::zero());
    limiter.reset();
    assert_eq!(*limiter.last().torques(), JointTorques::zero());
    let (limited, report) = limiter.limit(&JointTorques(wanted.0 * 2.0));
    assert!(report.rate && !report.joint);
    assert!(limited.torques().0.iter().zip(STEP_LIMIT).all(|(torque, limit)| *torque <= limit + 1e-12));
    let (_, report) = limiter.limit(&JointTorques(Vector7::repeat(1e3)));
    assert!(report.joint && report.rate && report.is_cut());
}

#[test]
fn a_pair_of_which_both_motors_are_beyond_their_caps_is_scaled_for_the_worse_one() {
    // Pucks with so many counts for a newton metre that both motors reach their caps.
    let calibration = Calibration::<f64>::new([4096; 7], [20_000; 7], Payload::SensorAndHand).expect("sound");
    for wanted in [[0.0, 50.0, 8.0, 0.0, 4.0, 1.0, 0.0], [0.0, 50.0, -8.0, 0.0, 4.0, -1.0, 0.0]] {
        let mut limiter = TorqueLimiter::new(&calibration);
        for _ in 0..100 {
            limiter.limit(&JointTorques(Vector7::from(wanted)));
        }
        let torques = limiter.last().torques().0;
        let motors = calibration.transmission().motor_torques_from_joint(&torques.into());
        for (motor, (torque, cap)) in motors.iter().zip(limiter.motor_limits()).enumerate() {
            assert!(torque.abs() <= cap * (1.0 + 1e-9), "M{}: {torque} of {cap}", motor + 1);
        }
    }
}

#[test]
fn a_step_is_the_full_scale_of_the_manufacturers_controllers_in_50_ms() {
    let full_scale = [25.0, 20.0, 15.0, 15.0, 5.0, 5.0, 5.0];
    for (joint, (limit, full_scale)) in STEP_LIMIT.iter().zip(full_scale).enumerate() {
        let wanted = full_scale * PERIOD / 0.05;
        assert!((limit - wanted).abs() < 1e-12, "J{}: {limit}", joint + 1);
    }
}

#[test]
fn motors_stay_below_the_warning_of_the_safety_module_in_every_corner() {
    let calibration = Calibration::<f64>::nominal(Payload::SensorAndHand);
    for corner in 0..128u32 {
        let mut limiter = TorqueLimiter::new(&calibration);
        let wanted =
            JointTorques::from_array(core::array::from_fn(|joint| if corner >> joint & 1 == 0 { 1e6 } else { -1e6 }));
        for _ in 0..400 {
            limiter.limit(&wanted);
        }
        let motors = calibration.transmission().motor_torques_from_joint(&limiter.last().torques().0.into());
        for (motor, torque) in motors.iter().enumerate() {
            let counts = torque.abs() * model::TORQUE_COUNTS[motor];
            assert!(counts <= MOTOR_COUNTS_LIMIT + 1e-6, "M{}: {counts}", motor + 1);
            assert!(torque.abs() <= model::MOTOR_TORQUE_MAX[motor] + 1e-12);
        }
    }
}

#[test]
fn a_torque_that_is_not_finite_keeps_the_last_one() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut limiter = limiter();
        limiter.limit(&JointTorques::from_array([1.0; 7]));
        let last = limiter.last();
        let mut wanted = JointTorques::from_array([1.2; 7]);
        wanted.0[3] = bad;
        let (torques, report) = limiter.limit(&wanted);
        assert!(report.not_finite);
        assert_eq!(torques, last);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 20_000, failure_persistence: None, ..ProptestConfig::default() })]

    /// Any sequence of wanted torques: always finite, within joint and motor limits, and no step above the rate.
    #[test]
    fn limits_hold_for_any_sequence(wanted in prop::collection::vec(prop::array::uniform7(prop::num::f32::ANY), 1..12)) {
        let calibration = Calibration::<f32>::nominal(Payload::SensorAndHand);
        let mut limiter = TorqueLimiter::new(&calibration);
        let mut last = [0.0f32; 7];
        for wanted in wanted {
            let torques: [f32; 7] = limiter.limit(&JointTorques::from_array(wanted)).0.torques().0.into();
            let motors = calibration.transmission().motor_torques_from_joint(&torques);
            for joint in 0..7 {
                prop_assert!(torques[joint].is_finite());
                prop_assert!(torques[joint].abs() <= limiter.joint_limits()[joint]);
                prop_assert!(motors[joint].abs() <= limiter.motor_limits()[joint] * 1.00001);
                prop_assert!((torques[joint] - last[joint]).abs() <= STEP_LIMIT[joint] as f32 * 1.00001);
            }
            last = torques;
        }
    }

    /// Torques that did not leave do not count: no step from one torque on the bus to the next is above the rate.
    #[test]
    fn a12_the_step_after_torques_that_did_not_leave_is_within_the_limit(
        cycles in prop::collection::vec((prop::array::uniform7(-60.0f64..60.0), any::<bool>(), any::<bool>()), 1..60)
    ) {
        let mut limiter = limiter();
        let mut bus = [0.0f64; 7];
        for (wanted, arm_left, wrist_left) in cycles {
            let torques: [f64; 7] = limiter.limit(&JointTorques::from_array(wanted)).0.torques().0.into();
            limiter.not_sent(!arm_left, !wrist_left);
            for joint in 0..7 {
                if if joint < 4 { arm_left } else { wrist_left } {
                    prop_assert!((torques[joint] - bus[joint]).abs() <= STEP_LIMIT[joint] * 1.00001, "J{}", joint + 1);
                    bus[joint] = torques[joint];
                }
                prop_assert_eq!(limiter.last().torques().0[joint], bus[joint]);
            }
        }
    }

    /// The same for the hand.
    #[test]
    fn a12_the_step_of_the_hand_after_torques_that_did_not_leave_is_within_the_limit(
        cycles in prop::collection::vec((prop::array::uniform4(-9.0f64..9.0), any::<bool>()), 1..60)
    ) {
        let mut limiter = HandLimiter::new();
        let mut bus = [0.0f64; 4];
        for (wanted, left) in cycles {
            let torques = *limiter.limit(&wanted).torques();
            if left {
                for digit in 0..4 {
                    let largest = TORQUE_LIMIT[digit] / 15.0 * 1.00001;
                    prop_assert!((torques[digit] - bus[digit]).abs() <= largest, "digit {digit}");
                }
                bus = torques;
            } else {
                limiter.not_sent();
            }
        }
    }
}
