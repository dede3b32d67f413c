//! Each group of rows with gains and limits of its own, so that no group can take those of another unnoticed.

use crate::arm::{
    Configuration, Coupling, ExpectedWrench, Feedback, ORIGIN, Primitive, ROWS, Reference, Rollout, SENSORS,
    StartState, Tables, configuration, coupling, gains, limits, pose, velocity,
};
use crate::common::{ALPHA, DT};
use dmp::{Hemisphere, OrientationError, Quaternion};

const DURATION: f64 = 4.0;
/// Stiffness of position, orientation, posture, hand.
const K: [f64; 4] = [100.0, 160.0, 250.0, 400.0];
/// Damping, of no two the same relation to the stiffness.
const D: [f64; 4] = [21.0, 17.0, 33.0, 47.0];
/// Limits of displacement, rotation, hand.
const LIMITS: [f64; 3] = [0.3, 0.5, 0.7];
/// Velocity of position, orientation, posture, hand at the start.
const V: [f64; 4] = [0.1, 0.2, 0.3, 0.4];

fn primitive(error: OrientationError, weight: impl Fn(usize) -> f64) -> Primitive<f64, 10> {
    let weights: Vec<f64> = (0..ROWS * 10).map(|i| weight(i / 10)).collect();
    Primitive::new(&Tables {
        control_period: DT,
        duration: DURATION,
        alpha: ALPHA,
        activation: 0.7,
        kernel_count: 10,
        weights: &weights,
        gains: gains(K, D),
        orientation_error: error,
        hemisphere: Hemisphere::Demonstrated,
        start: ORIGIN,
        goal: ORIGIN,
        start_velocity: velocity([V[0]; 3], [V[1]; 3], [V[2]; 7], [V[3]; 4]),
    })
    .unwrap()
}

fn feedback() -> Feedback<f64> {
    let [displacement, rotation, hand] = LIMITS;
    let feedback = Feedback::new([2.0; 10], [3.0; SENSORS], limits(displacement, rotation, hand)).unwrap();
    Feedback { expected: ExpectedWrench::new(&[[0.5; SENSORS]], DURATION).unwrap(), ..feedback }
}

fn first(primitive: &Primitive<f64, 10>, start: &StartState<f64>, coupling: &Coupling<f64>) -> Reference<f64> {
    Rollout::start(primitive, start).unwrap().step(primitive, DT, coupling).unwrap()
}

/// Accelerations of one row of each group times tau^2, at the first tick.
fn driven(plan: &Reference<f64>) -> [f64; 4] {
    [plan.poses[0].position.a[1], plan.poses[0].orientation.domega[1], plan.points.a[5], plan.points.a[9]]
        .map(|a| a * DURATION * DURATION)
}

fn close(found: [f64; 4], expected: [f64; 4]) {
    for (group, (found, expected)) in found.iter().zip(expected).enumerate() {
        assert!((found - expected).abs() < 1e-9 * expected.abs().max(1.0), "group {group}: {found}, not {expected}");
    }
}

#[test]
fn every_group_has_its_own_stiffness_and_damping() {
    for error in [OrientationError::Quaternion, OrientationError::RotationVector] {
        let still = primitive(error, |_| 0.0);
        let systems = [
            &still.pose_systems()[0][0],
            &still.pose_systems()[0][1],
            &still.point_systems()[6],
            &still.point_systems()[7],
        ];
        assert_eq!(systems.map(|system| system.stiffness()), K);
        assert_eq!(systems.map(|system| system.damping()), D);
        // From rest at start = goal nothing but the velocity, tau V, drives: -D tau V.
        let moving = first(&still, &StartState::demonstrated(&still), &Coupling::NONE);
        close(driven(&moving), core::array::from_fn(|group| -D[group] * DURATION * V[group]));
        // Nothing but the forcing term: K f, with as many different weights as rows (all kernels alike, so f(1) is the
        // weight).
        let forced = primitive(error, |row| 0.01 * (row + 1) as f64);
        let pushed = first(&forced, &StartState::at_rest(ORIGIN), &Coupling::NONE);
        let weights = [2.0, 5.0, 12.0, 16.0].map(|row: f64| 0.01 * row);
        close(driven(&pushed), core::array::from_fn(|group| K[group] * weights[group]));
        // Nothing but the coupling.
        let mut zeta = coupling([1.0; 3], [2.0; 3], [4.0; 4]);
        zeta.points[..7].fill(3.0);
        close(driven(&first(&still, &StartState::at_rest(ORIGIN), &zeta)), [1.0, 2.0, 3.0, 4.0]);
    }
}

#[test]
fn every_clamp_is_its_own_limit_times_its_own_stiffness() {
    for (error, turn) in
        [(OrientationError::Quaternion, (0.5 * LIMITS[1]).sin()), (OrientationError::RotationVector, LIMITS[1])]
    {
        let primitive = primitive(error, |_| 0.0);
        let rollout = Rollout::start(&primitive, &StartState::at_rest(ORIGIN)).unwrap();
        let feedback = feedback();
        let zeta = |force: f64| feedback.coupling(&rollout, &primitive, &[force; SENSORS]).unwrap();
        // K1 K2 (F - F_expected), as long as it is small.
        let small = zeta(1.5);
        assert_eq!(small, coupling([6.0; 3], [6.0; 3], [0.0, 6.0, 6.0, 6.0]));
        let blow = zeta(1e4);
        let length = |a: [f64; 3]| a.iter().map(|a| a * a).sum::<f64>().sqrt();
        assert!((length(blow.poses[0].position) / (K[0] * LIMITS[0]) - 1.0).abs() < 1e-12, "{blow:?}");
        assert!((length(blow.poses[0].orientation) / (K[1] * turn) - 1.0).abs() < 1e-12, "{error:?}: {blow:?}");
        let finger = K[3] * LIMITS[2];
        assert_eq!(blow.points[7..], [0.0, finger, finger, finger]);
    }
}

#[test]
fn the_coupling_of_a_run_fades_where_its_speed_is_not_that_of_the_recording() {
    let primitive = primitive(OrientationError::Quaternion, |_| 0.0);
    let mut rollout = Rollout::start(&primitive, &StartState::at_rest(ORIGIN)).unwrap();
    rollout.set_speed_slew(None).unwrap();
    // The duration deviates by 0, 5, 30, 40 and 100 % of the recorded one.
    for (speed, trust) in [(1.0, 1.0), (1.0 / 1.05, 1.0), (1.0 / 1.3, 0.5), (1.0 / 1.4, 0.25), (0.5, 0.0), (0.0, 0.0)] {
        rollout.set_speed(&primitive, speed).unwrap();
        let zeta = feedback().coupling(&rollout, &primitive, &[1.5; SENSORS]).unwrap();
        let values = zeta.poses[0].position.iter().chain(&zeta.poses[0].orientation).chain(&zeta.points[8..]);
        for value in values {
            assert!((value - 6.0 * trust).abs() < 1e-9, "speed {speed}: {zeta:?}");
        }
    }
}

#[test]
fn every_group_takes_a_new_goal_at_once_or_through_the_filter() {
    let turned = Quaternion::from_rotation_vector(&[0.1, -0.2, 0.3]);
    let goal: Configuration<f64> =
        configuration([0.1, 0.2, 0.3], turned, [0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0], [1.1, 1.2, 1.3, 1.4]);
    for error in [OrientationError::Quaternion, OrientationError::RotationVector] {
        for filter in [None, Some(12.5)] {
            let primitive = primitive(error, |_| 0.0);
            let mut rollout = Rollout::start(&primitive, &StartState::at_rest(ORIGIN)).unwrap();
            rollout.set_goal_filter(filter).unwrap();
            rollout.set_goal_position(0, goal.poses[0].position).unwrap();
            rollout.set_goal_points(goal.points).unwrap();
            rollout.set_goal_orientation(&primitive, 0, goal.poses[0].orientation).unwrap();
            let mut plan = rollout.step(&primitive, DT, &Coupling::NONE).unwrap();
            for _ in 0..9000 {
                plan = rollout.step(&primitive, DT, &Coupling::NONE).unwrap();
            }
            let far = |x: &[f64], goal: &[f64]| x.iter().zip(goal).any(|(x, goal)| (x - goal).abs() > 1e-6);
            let x = pose(&plan).position.x;
            assert!(!far(&x, &goal.poses[0].position), "{error:?}, {filter:?}: {x:?}");
            assert!(!far(&plan.points.x, &goal.points), "{error:?}, {filter:?}: {:?}", plan.points.x);
            let missed =
                plan.poses[0].orientation.quaternion.aligned_with(&turned).conjugate().product(&turned).angle();
            assert!(missed < 1e-6, "{error:?}, {filter:?}: {missed}");
        }
    }
}
