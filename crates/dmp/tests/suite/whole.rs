//! The whole primitive under any numbers: whatever tables are accepted and whatever is asked of a run, what it gives
//! is finite and bounded, in every number type and both orientation systems.

use crate::arm::{
    Configuration, Coupling, ExpectedWrench, Feedback, Primitive, ROWS, Reference, Rollout, SENSORS, StartState,
    Tables, Velocity, coupling, gains, limits,
};
use crate::common::DT;
use dmp::{FixedPoint, Hemisphere, OrientationError, Pose, Quaternion, Scalar, TransformationSystem, Twist, bounds};
use proptest::prelude::*;

/// Most kernels of a case.
const KERNELS: usize = 6;

/// Mostly numbers of a movement, but also none, the smallest, denormal ones of both floating-point types, the largest.
fn any_number() -> impl Strategy<Value = f64> {
    const STRANGE: [f64; 20] = [
        0.0,
        -0.0,
        5e-324,
        2e-310,
        2e-39,
        -1e-45,
        1e-30,
        1e-10,
        1e-5,
        1e3,
        1e6,
        -1e6,
        1e30,
        -1e30,
        3.4e38,
        1e300,
        f64::MAX,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::NAN,
    ];
    prop_oneof![
        4 => -2.0..2.0_f64,
        2 => prop::sample::select(STRANGE.to_vec()),
        1 => prop::num::f64::ANY,
        // A size anywhere between the smallest and the largest.
        1 => (-45.0..39.0_f64, any::<bool>()).prop_map(|(exponent, negative)| {
            if negative { -(10.0_f64.powf(exponent)) } else { 10.0_f64.powf(exponent) }
        }),
    ]
}

/// A number on a logarithmic scale.
fn logarithmic(low: f64, high: f64) -> impl Strategy<Value = f64> {
    (low.ln()..high.ln()).prop_map(f64::exp)
}

/// Everything a primitive is made from, in f64.
#[derive(Clone, Debug)]
struct Case {
    duration: f64,
    alpha: f64,
    activation: f64,
    kernels: usize,
    stiffness: [f64; 4],
    damping: [f64; 4],
    /// Start and goal: 3 position, 3 rotation vector, 7 posture, 4 hand.
    ends: [[f64; 17]; 2],
    velocity: [f64; 17],
    weights: Vec<f64>,
    is_vector: bool,
    is_nearest: bool,
    /// K1, K2, limits 3, expected value, recorded duration.
    feedback: [f64; 7],
    /// Values put into the place of others: which, and what.
    slips: Vec<(usize, f64)>,
}

fn row() -> impl Strategy<Value = [f64; 17]> {
    prop::array::uniform17(-1.5..1.5_f64)
}

fn any_case() -> impl Strategy<Value = Case> {
    let shape = (logarithmic(1.001, 300.0), 2.3..13.8_f64, 0.05..0.95_f64, 2..=KERNELS, any::<bool>(), any::<bool>());
    let gains = prop::array::uniform4((logarithmic(0.1, 1e6), logarithmic(0.05, 20.0)));
    let tables = (row(), row(), row(), prop::collection::vec(-3.0..3.0_f64, ROWS * KERNELS));
    let feedback = (logarithmic(1e-3, 1e6), logarithmic(1e-3, 1e3), 0.0..2.0_f64, 0.0..3.1_f64, -50.0..50.0_f64);
    let slips = prop::collection::vec((0..200_usize, any_number()), 0..3);
    (shape, gains, tables, feedback, slips).prop_map(
        |(shape, gains, (start, goal, velocity, weights), feedback, slips)| {
            let (slowness, alpha, activation, kernels, is_vector, is_nearest) = shape;
            // By the damping ratio: from swinging to creeping.
            let gains = gains.map(|(k, ratio)| (k, 2.0 * ratio * k.sqrt()));
            // From as short as it can be.
            let shortest =
                |(k, d): (f64, f64)| TransformationSystem::new(k, d).map_or(1.0, |system| DT / system.largest_step());
            let duration = slowness * gains.map(shortest).into_iter().fold(0.0, f64::max);
            let (k1, k2, displacement, angle, expected) = feedback;
            Case {
                duration,
                alpha,
                activation,
                kernels,
                stiffness: gains.map(|(k, _)| k),
                damping: gains.map(|(_, d)| d),
                ends: [start, goal],
                velocity,
                weights,
                is_vector,
                is_nearest,
                feedback: [k1, k2, displacement, angle, angle, expected, duration],
                slips,
            }
        },
    )
}

impl Case {
    /// With the slips in their places.
    fn slipped(&self) -> Self {
        let mut case = self.clone();
        for &(place, value) in &self.slips {
            let [start, goal] = &mut case.ends;
            let small = [&mut case.duration, &mut case.alpha, &mut case.activation];
            let mut places: Vec<&mut f64> =
                small.into_iter().chain(&mut case.stiffness).chain(&mut case.damping).collect();
            places.extend(start.iter_mut().chain(goal).chain(&mut case.velocity).chain(&mut case.feedback));
            places.extend(&mut case.weights);
            let count = places.len();
            *places[place % count] = value;
        }
        case
    }

    /// The primitive, and its feedback.
    fn build<T: Scalar>(&self) -> Option<(Primitive<T, KERNELS>, Feedback<T>)> {
        let f = T::from_f64;
        let weights = self.weights.iter().take(ROWS * self.kernels).map(|&w| f(w).to_weight());
        let weights = weights.collect::<Option<Vec<T::Weight>>>()?;
        let [k1, k2, displacement, rotation, hand, expected, recorded] = self.feedback.map(f);
        let feedback = Feedback::new([k1; 10], [k2; SENSORS], limits(displacement, rotation, hand)).ok()?;
        let expected = ExpectedWrench::new(&[[expected; SENSORS]], recorded).ok()?;
        let primitive = Primitive::new(&Tables {
            control_period: f(DT),
            duration: f(self.duration),
            alpha: f(self.alpha),
            activation: f(self.activation),
            kernel_count: self.kernels,
            weights: &weights,
            gains: gains(self.stiffness, self.damping).cast(),
            orientation_error: if self.is_vector {
                OrientationError::RotationVector
            } else {
                OrientationError::Quaternion
            },
            hemisphere: if self.is_nearest { Hemisphere::Nearest } else { Hemisphere::Demonstrated },
            start: configuration(&self.ends[0]),
            goal: configuration(&self.ends[1]),
            start_velocity: velocity(&self.velocity),
        })
        .ok()?;
        Some((primitive, Feedback { expected, ..feedback }))
    }

    /// Largest distance of a row of a group from 0: its drive, times the overshoot of a system that swings.
    fn farthest(&self, group: usize) -> f64 {
        let (k, d) = (self.stiffness[group], self.damping[group]);
        let moves = self.duration / k * (self.duration * bounds::LARGEST_ACCELERATION + d * bounds::LARGEST_SPEED);
        let swing = 1.0 + 2.0 * k.sqrt() / d;
        10.0 * swing * (2.0 * moves + 6.0 * bounds::LARGEST_VALUE)
    }
}

fn quaternion<T: Scalar>([x, y, z]: [f64; 3]) -> Quaternion<T> {
    Quaternion::from_rotation_vector(&[x, y, z].map(T::from_f64))
}

fn configuration<T: Scalar>(row: &[f64; 17]) -> Configuration<T> {
    let part = |at: usize| T::from_f64(row[at]);
    let pose = Pose { position: core::array::from_fn(part), orientation: quaternion([row[3], row[4], row[5]]) };
    Configuration { poses: [pose], points: core::array::from_fn(|i| part(6 + i)) }
}

fn velocity<T: Scalar>(row: &[f64; 17]) -> Velocity<T> {
    let part = |at: usize| T::from_f64(row[at]);
    let twist = Twist { linear: core::array::from_fn(part), angular: core::array::from_fn(|i| part(3 + i)) };
    Velocity { poses: [twist], points: core::array::from_fn(|i| part(6 + i)) }
}

/// A change in flight between two ticks.
#[derive(Clone, Debug)]
enum Ask {
    Nothing,
    Goal([f64; 17]),
    Orientation([f64; 4]),
    Speed(f64),
    Duration(f64),
    Slew(Option<f64>),
    Filter(Option<f64>),
    Pause,
    Freeze,
    Resume,
    Settle,
}

/// One tick: what is asked before it, its length, what the sensors measure, and a coupling that is given instead.
type Tick = (Ask, f64, [f64; SENSORS], Option<[f64; 10]>);

fn any_tick() -> impl Strategy<Value = Tick> {
    let any_row = || prop_oneof![row(), prop::array::uniform17(any_number())];
    let ask = prop_oneof![
        8 => Just(Ask::Nothing),
        2 => any_row().prop_map(Ask::Goal),
        1 => row().prop_map(|[x, y, z, ..]| Ask::Orientation(quaternion::<f64>([x, y, z]).to_array())),
        1 => prop::array::uniform4(any_number()).prop_map(Ask::Orientation),
        2 => any_number().prop_map(Ask::Speed),
        1 => any_number().prop_map(Ask::Duration),
        1 => prop::option::of(any_number()).prop_map(Ask::Slew),
        1 => prop::option::of(any_number()).prop_map(Ask::Filter),
        1 => Just(Ask::Pause),
        1 => Just(Ask::Freeze),
        3 => Just(Ask::Resume),
        1 => Just(Ask::Settle),
    ];
    let dt = prop_oneof![6 => Just(1.0 / 300.0), 2 => 0.0..4e-3_f64, 1 => any_number()];
    let measured = prop::array::uniform9(any_number());
    (ask, dt, measured, prop::option::of(prop::array::uniform10(any_number())))
}

/// Asks; a refusal is an answer as well.
fn ask<T: Scalar>(rollout: &mut Rollout<T, KERNELS>, primitive: &Primitive<T, KERNELS>, ask: &Ask) {
    let f = T::from_f64;
    let _ = match ask {
        Ask::Nothing => Ok(()),
        Ask::Goal(row) => {
            let goal = configuration::<T>(row);
            let _ = rollout.set_goal_points(goal.points);
            rollout.set_goal_position(0, goal.poses[0].position)
        }
        Ask::Orientation(q) => {
            let [w, x, y, z] = q.map(f);
            rollout.set_goal_orientation(primitive, 0, Quaternion::new(w, x, y, z))
        }
        Ask::Speed(speed) => rollout.set_speed(primitive, f(*speed)),
        Ask::Duration(duration) => rollout.set_duration(primitive, f(*duration)),
        Ask::Slew(slew) => rollout.set_speed_slew(slew.map(f)),
        Ask::Filter(rate) => rollout.set_goal_filter(rate.map(f)),
        Ask::Pause => {
            rollout.pause();
            Ok(())
        }
        Ask::Freeze => {
            rollout.freeze();
            Ok(())
        }
        Ask::Resume => {
            rollout.resume();
            Ok(())
        }
        Ask::Settle => {
            rollout.settle();
            Ok(())
        }
    };
}

fn largest<T: Scalar>(values: &[T]) -> Result<f64, TestCaseError> {
    values.iter().try_fold(0.0_f64, |largest, value| {
        prop_assert!(value.is_finite(), "{values:?}");
        Ok(largest.max(value.to_f64().abs()))
    })
}

fn check_plan<T: Scalar>(plan: &Reference<T>, case: &Case) -> Result<(), TestCaseError> {
    let Reference { phase, progress, time, rate, poses: [pose], points } = plan;
    largest(&[*progress, *time, *rate])?;
    prop_assert!(*phase >= T::ZERO && *phase <= T::ONE && *progress >= T::ZERO && *rate >= T::ZERO, "{plan:?}");
    let orientation = &pose.orientation;
    for (group, x, v, a) in [
        (0, pose.position.x.as_slice(), pose.position.v.as_slice(), pose.position.a.as_slice()),
        (2, &points.x[..7], &points.v[..7], &points.a[..7]),
        (3, &points.x[7..], &points.v[7..], &points.a[7..]),
    ] {
        let (far, limit) = (largest(x)?, case.farthest(group));
        prop_assert!(far <= limit, "group {group} is at {far:e} of {limit:e}");
        largest(v)?;
        largest(a)?;
    }
    let q = orientation.quaternion.to_array();
    largest(&q)?;
    let norm = q.iter().map(|q| q.to_f64().powi(2)).sum::<f64>().sqrt();
    prop_assert!((norm - 1.0).abs() < 1e-3, "|q| = {norm}");
    largest(&orientation.omega)?;
    largest(&orientation.domega)?;
    largest(&orientation.omega_world())?;
    largest(&orientation.domega_world())?;
    Ok(())
}

fn check_coupling<T: Scalar>(zeta: &Coupling<T>, case: &Case) -> Result<(), TestCaseError> {
    // As they are in this number type.
    let rounded = |value: f64| T::from_f64(value).to_f64();
    let [k, k_o, _, k_h] = case.stiffness.map(rounded);
    let [_, _, displacement, rotation, hand, ..] = case.feedback.map(rounded);
    let norm = |a: &[T; 3]| -> Result<f64, TestCaseError> {
        largest(a)?;
        Ok(a.iter().map(|a| a.to_f64().powi(2)).sum::<f64>().sqrt())
    };
    let turn = if case.is_vector { rotation } else { (rotation / 2.0).sin() };
    // Half a unit in the last place of K times the limit, in fixed point of both factors.
    let within = |found: f64, limit: f64, k: f64| found <= limit * k * (1.0 + 1e-5) + (k + 1.0) * 1e-9;
    prop_assert!(within(norm(&zeta.poses[0].position)?, displacement, k), "{zeta:?}");
    prop_assert!(within(norm(&zeta.poses[0].orientation)?, turn, k_o), "{zeta:?}");
    prop_assert!(within(largest(&zeta.points[7..])?, hand, k_h), "{zeta:?}");
    Ok(())
}

fn check<T: Scalar>(case: &Case, start: Option<&[f64; 17]>, ticks: &[Tick]) -> Result<bool, TestCaseError> {
    let case = case.slipped();
    let Some((primitive, feedback)) = case.build::<T>() else {
        return Ok(false);
    };
    let f = T::from_f64;
    let mut from = StartState::demonstrated(&primitive);
    if let Some(row) = start {
        from = StartState { configuration: configuration(row), velocity: velocity(row) };
    }
    let Ok(mut rollout) = Rollout::start(&primitive, &from) else {
        return Ok(false);
    };
    for (asked, dt, measured, given) in ticks {
        ask(&mut rollout, &primitive, asked);
        let zeta = feedback.coupling(&rollout, &primitive, &measured.map(f)).unwrap();
        check_coupling(&zeta, &case)?;
        let zeta = given.map_or(zeta, |given| {
            let given = given.map(f);
            let mut any = coupling(
                core::array::from_fn(|i| given[i]),
                core::array::from_fn(|i| given[3 + i]),
                core::array::from_fn(|i| given[6 + i]),
            );
            any.points[..7].copy_from_slice(&given[..7]);
            any
        });
        // Each several times, so that what grows has time to.
        for _ in 0..5 {
            let plan = rollout.step(&primitive, f(*dt), &zeta);
            prop_assert_eq!(plan.is_err(), f(*dt) > f(DT));
            if let Ok(plan) = plan {
                check_plan(&plan, &case)?;
            }
        }
    }
    Ok(true)
}

/// The cases of one number type: all of them bounded, and enough of them runs.
fn check_many<T: Scalar>() {
    let mut runner = proptest::test_runner::TestRunner::new(ProptestConfig {
        failure_persistence: None,
        ..ProptestConfig::with_cases(2000)
    });
    let runs = std::cell::Cell::new([0_u32; 2]);
    let start = prop::option::of(prop_oneof![row(), prop::array::uniform17(any_number())]);
    let cases = (any_case(), start, prop::collection::vec(any_tick(), 1..60));
    let result = runner.run(&cases, |(case, start, ticks)| {
        if check::<T>(&case, start.as_ref(), &ticks)? {
            let mut count = runs.get();
            count[usize::from(case.is_vector)] += 1;
            runs.set(count);
        }
        Ok(())
    });
    if let Err(error) = result {
        panic!("{error}");
    }
    let [quaternions, vectors] = runs.get();
    println!("{quaternions} runs on quaternions, {vectors} on rotation vectors");
    assert!(quaternions > 300 && vectors > 300, "too few of the cases ran: {quaternions} and {vectors}");
}

#[test]
fn whatever_is_asked_a_plan_in_double_precision_is_finite_and_bounded() {
    check_many::<f64>();
}

#[test]
fn whatever_is_asked_a_plan_in_single_precision_is_finite_and_bounded() {
    check_many::<f32>();
}

#[test]
fn whatever_is_asked_a_plan_in_fixed_point_is_bounded() {
    check_many::<FixedPoint>();
}
