//! Conditions that the gains meet in every posture.

use control::law::Gains;
use control::model::{ArmModel, Frames};
use control::units::JointPositions;
use control::{Payload, model};
use nalgebra::SMatrix;

/// Postures spread over the soft limits by a fixed sequence, and the straight arm.
fn postures() -> Vec<[f64; 7]> {
    let mut seed = 1u64;
    let mut random = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as f64 / (1u64 << 31) as f64
    };
    let mut postures = vec![[0.0; 7], model::HOME];
    postures.extend((0..400).map(|_| {
        core::array::from_fn(|joint| {
            let (min, max) = (model::SOFT_MIN[joint], model::SOFT_MAX[joint]);
            min + (max - min) * random()
        })
    }));
    postures
}

#[test]
fn no_damping_mode_is_faster_than_the_delay_of_the_loop_allows() {
    let arm = ArmModel::<f64>::new(Payload::SensorAndHand);
    let gains = Gains::<f64>::tuned();
    let mut worst = 0.0f64;
    for damping in [gains.stiff.damping, gains.compliant.damping, gains.stop_damping] {
        // Eigenvalues of M^-1 K_d are those of the symmetric K_d^1/2 M^-1 K_d^1/2.
        let root = SMatrix::<f64, 7, 7>::from_diagonal(&damping.map(f64::sqrt));
        for q in postures() {
            let mass = arm.mass_matrix(&Frames::new(&arm, &JointPositions::from_array(q)));
            let inverse = mass.try_inverse().expect("positive definite");
            worst = worst.max((root * inverse * root).symmetric_eigenvalues().max());
        }
    }
    println!("fastest damping mode: {worst} /s");
    // Velocity filter 4.5 ms, differencing 1.7 ms, hold 1.7 ms and one cycle of delay 3.3 ms: rings at pi/2 / 11.2 ms =
    // 140 /s.
    assert!(worst < 100.0, "{worst}");
}

#[test]
fn the_anti_windup_clamp_leaves_more_torque_than_friction() {
    let gains = Gains::<f64>::tuned();
    for tracking in [gains.stiff, gains.compliant] {
        for joint in 0..7 {
            let push = tracking.clamp[joint] * tracking.stiffness[joint];
            assert!(push > 2.0 * model::FRICTION_COULOMB[joint], "J{}: {push} N m", joint + 1);
        }
    }
}

#[test]
fn friction_is_never_fed_forward_in_full() {
    let gains = Gains::<f64>::tuned();
    for joint in 0..7 {
        assert!(gains.stiff.coulomb[joint] < model::FRICTION_COULOMB[joint]);
        assert!(gains.compliant.coulomb[joint] < model::FRICTION_COULOMB[joint]);
    }
}
