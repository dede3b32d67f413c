//! Values at the edge of what is accepted: the shortest periods, almost full turns, limits and speeds that are none.

use dmp::fit::weights_from_spread;
use dmp::{
    Configuration, Coupling, DisplacementLimits, ExpectedSensors, FixedPoint, Gains, Hemisphere, LogMap,
    OrientationError, Pose, PoseCoupling, PoseLimits, Primitive, PrimitiveError, PrimitiveTables, Quaternion, Rollout,
    Scalar, StartState, Stiffness, Velocity,
};
use proptest::prelude::*;

const KERNELS: usize = 5;
const TURN: f64 = 2.0 * core::f64::consts::PI;

/// A metre along x and a turn by `angle` about z without a forcing term.
fn primitive<T: Scalar>(
    period: f64,
    duration: f64,
    error: OrientationError,
    angle: f64,
) -> Result<Primitive<T, 0, 1, KERNELS>, PrimitiveError> {
    let orientation = Quaternion::from_rotation_vector(&[0.0, 0.0, angle]);
    let goal = Configuration { poses: [Pose { position: [1.0, 0.0, 0.0], orientation }], points: [] };
    Primitive::new(&PrimitiveTables {
        control_period: T::from_f64(period),
        duration: T::from_f64(duration),
        alpha: T::from_f64(4.6),
        activation: T::from_f64(0.7),
        kernel_count: KERNELS,
        weights: &[T::NO_WEIGHT; 6 * KERNELS],
        gains: Gains::<f64, 0, 1>::critically_damped(&Stiffness::uniform(200.0), error).cast(),
        orientation_error: error,
        hemisphere: Hemisphere::Demonstrated,
        start: Configuration::ORIGIN,
        goal: goal.cast(),
        start_velocity: Velocity::ZERO,
    })
}

/// The first period is 1e-22 s: the acceleration of such a plan is larger than an f32 can hold.
fn check_shortest_period<T: Scalar>() {
    for (period, duration) in [(1e-22, 1e-19), (9e-7, 1.0), (1e-6, 1.8e-5)] {
        let Ok(primitive) = primitive::<T>(period, duration, OrientationError::Quaternion, 1.0) else {
            assert!(period < 1e-6, "{period} is refused");
            continue;
        };
        assert!(period >= 1e-6, "{period} is taken");
        let mut rollout = Rollout::start(&primitive, &StartState::demonstrated(&primitive)).unwrap();
        for _ in 0..1000 {
            let plan = rollout.step(&primitive, primitive.control_period(), &Coupling::NONE).unwrap();
            assert!(plan.poses[0].position.a[0].is_finite() && plan.poses[0].orientation.domega[2].is_finite());
        }
    }
}

#[test]
fn a_control_period_below_a_microsecond_is_refused_and_one_of_it_gives_finite_plans() {
    check_shortest_period::<f64>();
    check_shortest_period::<f32>();
    check_shortest_period::<FixedPoint>();
    let refused = primitive::<f32>(1e-22, 1e-19, OrientationError::Quaternion, 1.0).unwrap_err();
    assert_eq!(refused, PrimitiveError::ControlPeriod);
}

/// Starts close to where the rotation vector is a full turn: there its velocity has no end.
fn check_full_turn<T: Scalar>(sizes: &[f64]) {
    let error = OrientationError::RotationVector;
    for missing in [1e-3, 1e-4, 1e-6] {
        let refused = primitive::<T>(0.002, 2.0, error, TURN - missing).map(|_| ()).unwrap_err();
        assert_eq!(refused, PrimitiveError::TurnsTooFar, "{missing}");
    }
    let angle = 359.0_f64.to_radians();
    let primitive = primitive::<T>(0.002, 2.0, error, angle).unwrap();
    let centre = Quaternion::from_rotation_vector(&[0.0, 0.0, 0.5 * angle]);
    for (size, way) in sizes.iter().flat_map(|size| [(size, 1.0), (size, -1.0)]) {
        let [w, x, y, z] =
            centre.product(&Quaternion::from_rotation_vector(&[0.0, 0.0, way * (TURN - size)])).to_array();
        let f = T::from_f64;
        let mut start = StartState::demonstrated(&primitive);
        start.configuration.poses[0].orientation = Quaternion::new(f(w), f(x), f(y), f(z));
        start.velocity.poses[0].angular = [f(1.0), f(0.5), f(0.2)];
        let mut rollout = Rollout::start(&primitive, &start).unwrap();
        let plan = rollout.step(&primitive, f(0.002), &Coupling::NONE).unwrap();
        for (omega, expected) in plan.poses[0].orientation.omega.into_iter().zip([1.0, 0.5, 0.2]) {
            assert!((omega.to_f64() - expected).abs() < 0.02, "{size}: {omega:?} is not {expected}");
        }
    }
}

#[test]
fn ends_an_almost_full_turn_apart_are_refused_and_those_of_359_degrees_start_as_asked() {
    const SIZES: [f64; 9] = [0.0, 1e-6, 1e-5, 1e-4, 1e-3, 4e-3, 8e-3, 9e-3, 2e-2];
    check_full_turn::<f64>(&SIZES);
    check_full_turn::<f32>(&SIZES);
    check_full_turn::<FixedPoint>(&SIZES);
}

/// A driver gives a quaternion of either sign. In fixed point the square of a small vector part has no digits left.
fn check_other_sign<T: Scalar>(tolerance: f64) {
    for exponent in 5..100 {
        let size = 0.7_f64.powi(exponent);
        let map = LogMap::between(&Quaternion::IDENTITY, &Quaternion::<T>::IDENTITY);
        let part = size / 3.0_f64.sqrt();
        let [w, v] = [-(1.0 - size * size).sqrt(), part].map(T::from_f64);
        let q = Quaternion::new(w, v, v, v);
        let expected = -2.0 * size.asin() / 3.0_f64.sqrt();
        for y in map.vector(&q, &[T::ZERO; 3]) {
            assert!((y.to_f64() - expected).abs() < tolerance, "{size:e}: {y:?} is not {expected}");
        }
        let length: f64 = q.rotation_vector().map(|r| r.to_f64() * r.to_f64()).iter().sum::<f64>().sqrt();
        // Below the last digit there is no axis.
        assert!(size < 1e-8 || (length - TURN + 2.0 * size.asin()).abs() < 10.0 * tolerance, "{size:e}: {length}");
    }
}

#[test]
fn a_quaternion_of_the_other_sign_has_the_same_coordinates_in_every_number_type() {
    check_other_sign::<f64>(1e-12);
    check_other_sign::<f32>(2e-6);
    check_other_sign::<FixedPoint>(1e-5);
}

fn limits(displacement: f64, rotation: f64, point: f64) -> DisplacementLimits<f64, 1, 1> {
    DisplacementLimits { poses: [PoseLimits { displacement, rotation }], points: [point] }
}

#[test]
fn limits_that_are_none_let_no_coupling_through() {
    let weights = [0.0; 14];
    let gains = |error| Gains::critically_damped(&Stiffness::uniform(200.0), error);
    for error in [OrientationError::Quaternion, OrientationError::RotationVector] {
        let primitive = Primitive::<f64, 1, 1, 2>::new(&PrimitiveTables {
            control_period: 0.002,
            duration: 1.0,
            alpha: 4.6,
            activation: 0.7,
            kernel_count: 2,
            weights: &weights,
            gains: gains(error),
            orientation_error: error,
            hemisphere: Hemisphere::Nearest,
            start: Configuration::ORIGIN,
            goal: Configuration::ORIGIN,
            start_velocity: Velocity::ZERO,
        })
        .unwrap();
        let push = PoseCoupling { position: [1e4, 0.0, 0.0], orientation: [0.0, 1e4, 0.0] };
        let zeta = Coupling { poses: [push], points: [1e4] };
        for limit in [f64::NAN, -0.1, f64::NEG_INFINITY] {
            let limited = primitive.limited_coupling(&zeta, &limits(limit, limit, limit));
            assert_eq!(limited, Coupling::NONE, "{limit}");
        }
        // More than half a turn is no limit of a rotation: sin(theta/2) would fall again and turn its sign.
        let half = primitive.limited_coupling(&zeta, &limits(0.1, core::f64::consts::PI, 0.1));
        for rotation in [4.0, 7.0, 1e300] {
            assert_eq!(primitive.limited_coupling(&zeta, &limits(0.1, rotation, 0.1)), half, "{rotation}");
        }
    }
}

#[test]
fn an_expectation_is_not_trusted_at_a_speed_that_is_no_number() {
    let expected = ExpectedSensors::<f32, 1, 1>::new(&[[0.0]], 1.0).unwrap();
    for speed in [f32::INFINITY, f32::NEG_INFINITY, f32::NAN, f32::MAX, -1.0, 0.0] {
        assert_eq!(expected.trust(speed), 0.0, "{speed}");
    }
    assert_eq!(expected.trust(1.0), 1.0);
}

proptest! {
    #[test]
    fn weights_from_spread_are_numbers_within_their_range_or_refused(
        spread in prop::collection::vec(prop::array::uniform2(prop::num::f64::ANY), 1..5),
        floor in prop::num::f64::ANY,
        resolution in prop::array::uniform2(prop::num::f64::ANY),
        unbounded in any::<bool>(),
    ) {
        let resolution = if unbounded { [f64::INFINITY; 2] } else { resolution.map(f64::abs) };
        let spread: Vec<[f64; 2]> = spread.iter().map(|row| row.map(|x| x % 1e3)).collect();
        if let Ok(weights) = weights_from_spread(&spread, 3, 4, floor.abs(), &resolution) {
            prop_assert!(weights.iter().flatten().all(|weight| (0.25..=4.0).contains(weight)), "{:?}", weights);
        }
    }
}
