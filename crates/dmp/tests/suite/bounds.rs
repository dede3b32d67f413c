//! Bounds of single parts: what was once accepted, or once came out, that no movement can use.

use crate::arm::{
    Coupling, Demonstration, ExpectedWrench, Feedback, FitOptions, GainSchedule, Limits, ORIGIN, Primitive, ROWS,
    Rollout, SENSORS, StartState, Tables, Velocity, configuration, gains, limits,
};
use crate::common::{ALPHA, DT, Plan};
use dmp::fit::{fit, minimum_jerk, phase_statistics, sensor_statistics};
use dmp::{
    Basis, CanonicalSystem, CouplingGains, Entry, FixedPoint, Group, OrientationError, Part, Phase, PointInput,
    PointState, PrimitiveError, Quaternion, RolloutError, Scalar, TableError, TransformationSystem,
};

/// Channels of the statistics of the tests.
const CHANNELS: usize = 12;
type Statistics<T> = dmp::SensorStatistics<T, CHANNELS, 64>;

fn feedback<T: Scalar>(limit: f64) -> Feedback<T> {
    let limit = T::from_f64(limit);
    Feedback::new([T::ONE; 10], [T::ONE; SENSORS], limits(limit, limit, limit)).unwrap()
}

fn norm<T: Scalar>(a: &[T]) -> f64 {
    a.iter().map(|a| a.to_f64().powi(2)).sum::<f64>().sqrt()
}

/// The reciprocal of such a value is infinite, and 0 times it is not a number.
#[test]
fn an_error_too_small_for_its_reciprocal_is_no_nan() {
    for limit in [0.0, 0.2] {
        for error in [2e-39_f32, 1e-45, f32::MIN_POSITIVE] {
            for axes in [[error; SENSORS], core::array::from_fn(|i| if i % 3 == 0 { error } else { 0.0 })] {
                let zeta = feedback(limit).of_error(&Plan::empty().build::<f32>(), 0.0, &axes);
                let pose = &zeta.poses[0];
                let all = [pose.position.as_slice(), &pose.orientation, &zeta.points].concat();
                assert!(all.iter().all(|z| z.is_finite()), "limit {limit}, error {error:e}: {zeta:?}");
                assert!(norm(&pose.position) <= 200.0 * limit && norm(&pose.orientation) <= 200.0 * limit, "{zeta:?}");
            }
        }
        // In fixed point the reciprocal saturates instead.
        let primitive = Plan::empty().build::<FixedPoint>();
        let zeta = feedback(limit).of_error(&primitive, FixedPoint::ZERO, &[FixedPoint::from_bits(1); SENSORS]);
        assert!(norm(&zeta.poses[0].position) <= 200.0 * limit, "limit {limit}: {zeta:?}");
    }
}

/// The four limits of the step in a type where `D^2` neither saturates nor swallows `4K`.
fn largest_step(k: f64, d: f64) -> f64 {
    (4.0 / (d.hypot(2.0 * k.sqrt()) + d)).min(2.0 / d).min(1.0 / k.sqrt()).min(2.5 * d / k).min(1.0)
}

fn check_largest_step<T: Scalar>(tolerance: f64) {
    for (k, d) in [
        (200.0, 28.28),
        (1.0, 1e4),
        (1.0, 46_341.0),
        (1e6, 46_341.0),
        (200.0, 1e6),
        (1e6, 1e6),
        (1e6, 2000.0),
        (1e6, 1.0),
        (1.0, 0.1),
        (0.1, 0.1),
    ] {
        let system = TransformationSystem::new(T::from_f64(k), T::from_f64(d)).unwrap();
        let (found, right) = (system.largest_step().to_f64(), largest_step(k, d));
        assert!((found / right - 1.0).abs() < tolerance, "K = {k}, D = {d}: {found:e} instead of {right:e}");
    }
}

#[test]
fn the_largest_stable_step_is_right_for_every_gain_in_every_number_type() {
    check_largest_step::<f64>(1e-12);
    check_largest_step::<f32>(1e-6);
    // 2e-6 in units of 2.3e-10.
    check_largest_step::<FixedPoint>(2e-4);
}

/// Ten movements in slow motion: at a hundredth of the speed a factor per tick rounds to the same side every time.
fn drift<T: Scalar>(h: f64) -> f64 {
    let canonical = CanonicalSystem::new(T::from_f64(ALPHA)).unwrap();
    let mut phase = Phase::<T>::START;
    let h = T::from_f64(h);
    let mut worst = 0.0_f64;
    while phase.progress() < T::ONE {
        phase.step(&canonical, h);
        let u = phase.progress().to_f64();
        worst = worst.max((phase.s().to_f64() / (-ALPHA * u).exp() - 1.0).abs());
    }
    worst
}

#[test]
fn the_phase_belongs_to_the_progress_at_every_speed() {
    for h in [DT / 5.0, DT / 50.0, DT / 300.0] {
        let (single, fixed, double) = (drift::<f32>(h), drift::<FixedPoint>(h), drift::<f64>(h));
        println!("h = {h:.1e}: s is off by {single:.1e} (f32), {fixed:.1e} (fixed point), {double:.1e} (f64)");
        assert!(single < 6e-7 && fixed < 3e-8 && double < 1e-14, "h = {h}: {single:e} {fixed:e} {double:e}");
    }
}

type Run = Vec<(f64, [f64; CHANNELS])>;

/// A run whose values fall from its very beginning.
fn run_from(value: f64) -> Run {
    (0..200).map(|k| f64::from(k) / 199.0).map(|u| (u, [value - u; CHANNELS])).collect()
}

#[test]
fn a_sample_at_no_progress_is_no_sample_at_the_end() {
    let floor = [0.05; CHANNELS];
    for u in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut run = run_from(1.0);
        run[50].0 = u;
        assert_eq!(
            sensor_statistics::<CHANNELS, 64>(&[&run, &run_from(1.0)], 8, &floor, &[false; CHANNELS]).err(),
            Some(TableError::NotFinite),
            "{u}"
        );
    }
}

#[test]
fn a_run_without_a_usable_sample_leaves_the_others_alone() {
    let alone = phase_statistics(&[&run_from(1.0)], 8).unwrap();
    for stray in [vec![(1.5, [7.0; CHANNELS]); 3], vec![(-0.5, [7.0; CHANNELS])], vec![]] {
        let both = phase_statistics(&[&run_from(1.0), &stray], 8).unwrap();
        assert_eq!(both, alone, "a run of {} samples outside", stray.len());
    }
}

/// Singular values of the design matrix `A_ki = s_k psi_i/sum psi` by one-sided Jacobi rotations: another way than the
/// fit's.
fn condition_of_the_design(count: usize, activation: f64, samples: usize) -> f64 {
    let canonical = CanonicalSystem::new(ALPHA).unwrap();
    let basis = Basis::<f64, 200>::new(&canonical, count, activation).unwrap();
    let mut columns = vec![vec![0.0; samples]; count];
    let at = |k: usize| basis.evaluate(canonical.phase_at(k as f64 / (samples - 1) as f64));
    for (k, active) in (0..samples).map(at).enumerate() {
        for i in active.active() {
            columns[i][k] = active.factor(i);
        }
    }
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    for _ in 0..30 {
        for i in 0..count {
            for j in i + 1..count {
                let (a, b, c) =
                    (dot(&columns[i], &columns[i]), dot(&columns[j], &columns[j]), dot(&columns[i], &columns[j]));
                if c.abs() <= 1e-15 * (a * b).sqrt() {
                    continue;
                }
                let zeta = (b - a) / (2.0 * c);
                let t = zeta.signum() / (zeta.abs() + (1.0 + zeta * zeta).sqrt());
                let (cos, sin) = (1.0 / (1.0 + t * t).sqrt(), t / (1.0 + t * t).sqrt());
                let (left, right) = columns.split_at_mut(j);
                for (x, y) in left[i].iter_mut().zip(&mut right[0]) {
                    (*x, *y) = (cos * *x - sin * *y, sin * *x + cos * *y);
                }
            }
        }
    }
    let lengths: Vec<f64> = columns.iter().map(|column| dot(column, column).sqrt()).collect();
    let (low, high) = lengths.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), x| (low.min(*x), high.max(*x)));
    high / low
}

fn demonstration(position: Vec<[f64; 3]>, posture: Vec<[f64; 7]>, hand: Vec<[f64; 4]>) -> Demonstration {
    let still = vec![Quaternion::IDENTITY; position.len()];
    crate::arm::demonstration(DT, position, still, posture, hand).unwrap()
}

#[test]
fn the_reported_condition_is_that_of_the_design_matrix_whatever_the_ridge() {
    let samples = 601;
    // Still moving at its end, so that the fit does not go on with rest and the matrix is the one of the samples.
    let position = (0..samples).map(|k| [k as f64 * 1e-3, 0.0, 0.0]).collect();
    let moving = demonstration(position, vec![[0.0; 7]; samples], vec![[0.0; 4]; samples]);
    for (kernel_count, activation) in [(10, 0.7), (50, 0.7), (50, 0.9)] {
        let right = condition_of_the_design(kernel_count, activation, samples);
        for ridge in [1e-12, 1e-8, 1e-2] {
            let options = FitOptions { kernel_count, activation, ridge, cutoff: None, ..FitOptions::default() };
            let found = fit(&moving, &options).unwrap().report.condition;
            println!(
                "N = {kernel_count}, a = {activation}, ridge {ridge:e}: condition {found:.3e}, really {right:.3e}"
            );
            assert!((found / right - 1.0).abs() < 0.02, "{found:e} instead of {right:e}");
        }
    }
}

#[test]
fn a_goal_in_flight_is_no_further_away_than_one_at_the_start() {
    let about_z = |degrees: f64| Quaternion::from_rotation_vector(&[0.0, 0.0, degrees.to_radians()]);
    for hemisphere in [dmp::Hemisphere::Nearest, dmp::Hemisphere::Demonstrated] {
        let mut plan = Plan::empty();
        plan.hemisphere = hemisphere;
        plan.goal.poses[0].orientation = about_z(60.0);
        let primitive = plan.build::<f64>();
        let mut rollout = Rollout::start(&primitive, &StartState::demonstrated(&primitive)).unwrap();
        let before = rollout.clone();
        for far in [about_z(178.0), about_z(180.0), about_z(178.0).negated()] {
            assert_eq!(
                rollout.set_goal_orientation(&primitive, 0, far),
                Err(RolloutError::TurnsTooFar),
                "{hemisphere:?}"
            );
            assert_eq!(rollout, before);
        }
        for near in [about_z(170.0), about_z(-90.0)] {
            rollout.clone().set_goal_orientation(&primitive, 0, near).unwrap();
        }
        // The same bound holds where a run begins.
        let turned = StartState::at_rest(configuration([0.0; 3], about_z(-118.0), [0.0; 7], [0.0; 4]));
        assert_eq!(Rollout::start(&primitive, &turned).err(), Some(RolloutError::TurnsTooFar), "{hemisphere:?}");
    }
    // Rotation vectors go any way round.
    let mut plan = Plan::empty();
    plan.orientation_error = OrientationError::RotationVector;
    let primitive = plan.build::<f64>();
    let mut rollout = Rollout::start(&primitive, &StartState::demonstrated(&primitive)).unwrap();
    rollout.set_goal_orientation(&primitive, 0, about_z(180.0)).unwrap();
}

/// The fit goes on with rest behind the last sample only if everything rests there. Whatever of it still moves would
/// else be stopped short.
#[test]
fn a_demonstration_ends_at_rest_only_if_posture_and_hand_rest_too() {
    let samples = 1501;
    let position = minimum_jerk([0.1, -0.3, 0.2], [0.5, 0.1, -0.1], samples);
    let rest = (vec![[0.2; 7]; samples], vec![[0.3; 4]; samples]);
    // A finger that closes at its full speed to the very end, and a posture that does.
    let closing: Vec<[f64; 4]> = (0..samples).map(|k| [0.0, 1e-3 * k as f64, 0.0, 0.0]).collect();
    let swinging: Vec<[f64; 7]> = (0..samples).map(|k| std::array::from_fn(|_| 5e-4 * k as f64)).collect();
    let left_behind = |posture: Vec<[f64; 7]>, hand: Vec<[f64; 4]>| {
        let options = FitOptions { cutoff: None, ..FitOptions::default() };
        let learned = fit(&demonstration(position.clone(), posture, hand), &options).unwrap();
        learned.report.rows[6..].iter().map(|row| row.max).fold(0.0_f64, f64::max)
    };
    let (still, finger, posture) =
        (left_behind(rest.0.clone(), rest.1.clone()), left_behind(rest.0, closing), left_behind(swinging, rest.1));
    println!(
        "largest distance of posture and hand: {still:.1e}, finger moving {finger:.1e}, posture moving {posture:.1e}"
    );
    assert!(still < 1e-9 && finger < 1e-4 && posture < 1e-4, "{still:e} {finger:e} {posture:e}");
}

#[test]
fn a_run_goes_on_only_with_the_primitive_it_was_started_with() {
    let plan = Plan::golden();
    let primitive = plan.build::<f32>();
    let mut rollout = Rollout::start(&primitive, &StartState::demonstrated(&primitive)).unwrap();
    rollout.step(&primitive, DT as f32, &Coupling::NONE).unwrap();
    let before = rollout.clone();
    let refused = Err(RolloutError::OtherPrimitive);
    let mut others = vec![plan.clone(); 7];
    others[0].weights[0] += 1e-6;
    *others[1].weights.last_mut().unwrap() += 1e-6;
    others[2].duration = 4.0;
    others[3].stiffness = 201.0;
    others[4].goal.points[10] += 1e-6;
    others[5].hemisphere = dmp::Hemisphere::Demonstrated;
    others[6].weights.swap(3, 4);
    for (index, other) in others.iter().enumerate() {
        let other = other.build::<f32>();
        assert_eq!(rollout.step(&other, DT as f32, &Coupling::NONE).err(), refused.err(), "{index}");
        assert_eq!(rollout.check(&other), refused, "{index}");
        assert_eq!(rollout.set_speed(&other, 0.5), refused, "{index}");
        assert_eq!(rollout.set_duration(&other, 6.0), refused, "{index}");
        assert_eq!(rollout.set_goal_orientation(&other, 0, Quaternion::IDENTITY), refused, "{index}");
        assert_eq!(rollout, before);
    }
    // A copy is the same movement.
    rollout.step(&primitive.clone(), DT as f32, &Coupling::NONE).unwrap();
}

/// A tick that comes late after one that came early: each is stable alone.
#[test]
fn ticks_of_changing_length_are_stable_whatever_the_damping() {
    for (ratio, short) in [(0.1, 0.325), (0.3, 0.275), (0.5, 0.4), (0.7, 0.3), (1.0, 0.3)] {
        let k = 200.0_f64;
        let system = TransformationSystem::new(k, 2.0 * ratio * k.sqrt()).unwrap();
        let mut state = PointState::new(0.0, 0.0);
        let longest = system.largest_step();
        for tick in 0..4000 {
            let h = if tick % 2 == 0 { longest } else { short * longest };
            let rhs = system.right_hand_side(&state, &PointInput { start: 0.0, goal: 1.0, s: 0.0, f: 0.0, zeta: 0.0 });
            state.step(rhs, h);
        }
        assert!((state.x() - 1.0).abs() < 1e-6, "damping ratio {ratio}: {}", state.x());
    }
}

fn refused<T: Scalar>(weights: &[f64], change: impl Fn(&mut Tables<'_, T>)) -> Option<PrimitiveError> {
    let weights: Option<Vec<T::Weight>> = weights.iter().map(|&w| T::from_f64(w).to_weight()).collect();
    let Some(weights) = weights else {
        return Some(PrimitiveError::Weight);
    };
    let f = T::from_f64;
    let mut tables = Tables {
        control_period: f(DT),
        duration: f(5.0),
        alpha: f(ALPHA),
        activation: f(0.7),
        kernel_count: 10,
        weights: &weights,
        gains: gains([f(200.0); 4], [28.3, 20.0, 28.3, 28.3].map(f)),
        orientation_error: OrientationError::Quaternion,
        hemisphere: dmp::Hemisphere::Demonstrated,
        start: ORIGIN.cast(),
        goal: ORIGIN.cast(),
        start_velocity: Velocity::ZERO,
    };
    change(&mut tables);
    Primitive::<T, 10>::new(&tables).err()
}

/// `late`: what becomes of a large weight of a late kernel.
fn check_weights<T: Scalar>(late: Option<PrimitiveError>) {
    let weights = |at: usize, value: f64| {
        let mut weights = vec![0.0; ROWS * 10];
        weights[at] = value;
        weights
    };
    // One of each group, at the first and the last kernel, by sign and size. Neighbours share it.
    for (at, row, kernel) in [(0, 0, 0), (39, 3, 9), (64, 6, 4), (169, 16, 9)] {
        for value in [1e6, -1e6, 1e30, -1e30] {
            match refused::<T>(&weights(at, value), |_| {}) {
                Some(PrimitiveError::WeightTooLarge { group, index, kernel: near }) => {
                    assert_eq!(Group::of_weights(row, 1), (group, usize::from(index)));
                    assert!(near <= kernel && near + 6 > kernel, "{near} is not near {kernel}");
                }
                other => assert!(late.is_some() && other == late, "{value:e} at {at}: {other:?}"),
            }
        }
        assert_eq!(refused::<T>(&weights(at, 100.0), |_| {}), None);
    }
    assert!(refused::<T>(&[1e6; ROWS * 10], |_| {}).is_some() && refused::<T>(&[-1e6; ROWS * 10], |_| {}).is_some());
    // At its end the phase, and with it what a weight does, is a hundredth.
    assert_eq!(refused::<T>(&weights(39, 5000.0), |_| {}), late, "a late kernel may be larger");
    assert!(refused::<T>(&weights(30, 5000.0), |_| {}).is_some(), "an early one may not");
    // Large ones that cancel at each centre do not cancel half-way between them, and beyond a thousand not at all.
    let alternating: Vec<f64> = (0..ROWS * 10).map(|i| if i % 2 == 0 { 3e5 } else { -3e5 }).collect();
    assert!(refused::<T>(&alternating, |_| {}).is_some());
    assert!(refused::<T>(&alternating, |tables| tables.activation = T::from_f64(0.95)).is_some());
}

#[test]
fn a_weight_larger_than_any_movement_needs_is_refused_by_its_place() {
    check_weights::<f64>(None);
    check_weights::<f32>(None);
    // Weights are kept in 32 bits there.
    check_weights::<FixedPoint>(Some(PrimitiveError::Weight));
    let error = PrimitiveError::WeightTooLarge { group: Group::Points, index: 1, kernel: 4 };
    assert_eq!(
        error.to_string(),
        "the weights of point row 1 at kernel 4 (both from 0) are larger than any movement needs"
    );
}

#[test]
fn the_weights_of_real_fits_are_far_inside_the_bound() {
    // A reach of a second and a quarter, noise of 0.2 mm that nobody filters, few and many kernels.
    let samples = 375;
    let mut state = 1_u64;
    let mut noise = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5) * 4e-4
    };
    let mut position = minimum_jerk([0.1, -0.3, 0.2], [0.8, 0.4, -0.3], samples);
    position.iter_mut().flatten().for_each(|x| *x += noise());
    let hand = minimum_jerk([0.0; 4], [0.0, 2.4, 2.4, 2.4], samples);
    let moving = demonstration(position, vec![[0.2; 7]; samples], hand);
    for kernel_count in [10, 50, 100] {
        let options = FitOptions { kernel_count, cutoff: None, ..FitOptions::default() };
        let learned = fit(&moving, &options).unwrap();
        // Ten times these weights would still be a movement.
        let mut larger = learned.clone();
        larger.weights.iter_mut().for_each(|weight| *weight *= 10.0);
        larger.primitive::<f64, 100>().unwrap();
        let largest = learned.weights.iter().fold(0.0_f64, |largest, weight| largest.max(weight.abs()));
        println!("{kernel_count} kernels: largest weight {largest:.1}");
    }
}

#[test]
fn starts_goals_and_velocities_out_of_this_world_are_refused_by_their_place() {
    let weights = [0.0; ROWS * 10];
    let far = |change: &dyn Fn(&mut Tables<'_, f64>)| refused::<f64>(&weights, change);
    let too_large = |part: Part, group: Group, index: u8| Some(PrimitiveError::TooLarge { part, group, index });
    for value in [20.1, -1e30] {
        assert_eq!(far(&|t| t.start.poses[0].position[1] = value), too_large(Part::Start, Group::Position, 1));
        assert_eq!(far(&|t| t.start.points[6] = value), too_large(Part::Start, Group::Points, 6));
        assert_eq!(far(&|t| t.goal.points[10] = value), too_large(Part::Goal, Group::Points, 10));
        let fast = 3.0 * value;
        let part = Part::StartVelocity;
        assert_eq!(far(&|t| t.start_velocity.poses[0].linear[0] = fast), too_large(part, Group::Position, 0));
        assert_eq!(far(&|t| t.start_velocity.poses[0].angular[2] = fast), too_large(part, Group::Orientation, 2));
        assert_eq!(far(&|t| t.start_velocity.points[8] = fast), too_large(part, Group::Points, 8));
    }
    for (part, name, largest, unit) in [
        (Part::Start, "start", dmp::bounds::LARGEST_VALUE, "m or rad"),
        (Part::Goal, "goal", dmp::bounds::LARGEST_VALUE, "m or rad"),
        (Part::StartVelocity, "start velocity", dmp::bounds::LARGEST_SPEED, "m/s or rad/s"),
    ] {
        let error = PrimitiveError::TooLarge { part, group: Group::Orientation, index: 2 };
        assert_eq!(
            error.to_string(),
            format!("orientation value 2 (from 0) of the {name} is larger than any movement needs: {largest} {unit}")
        );
    }

    // What comes in flight has the same bounds.
    let primitive = Plan::golden().build::<f32>();
    let demonstrated = StartState::demonstrated(&primitive);
    let refused = Err(RolloutError::TooLarge);
    let mut start = demonstrated;
    start.configuration.points[4] = 1e30;
    assert_eq!(Rollout::start(&primitive, &start).map(|_| ()), refused);
    let mut start = demonstrated;
    start.velocity.poses[0].angular[0] = 51.0;
    assert_eq!(Rollout::start(&primitive, &start).map(|_| ()), refused);
    let mut rollout = Rollout::start(&primitive, &demonstrated).unwrap();
    let before = rollout.clone();
    assert_eq!(rollout.set_goal_position(0, [0.0, 1e30, 0.0]), refused);
    assert_eq!(rollout.set_goal_points([-21.0; 11]), refused);
    assert_eq!(rollout.set_speed_slew(Some(1e30)), Err(RolloutError::TooFast));
    assert_eq!(rollout, before);
}

fn check_tables<T: Scalar>() {
    let f = T::from_f64;
    let gains = |values: f64| GainSchedule::constant([f(values); 10]).unwrap();
    let sensors = |values: f64| GainSchedule::<T, SENSORS>::constant([f(values); SENSORS]).unwrap();
    let limits = |displacement: f64, rotation: f64, hand: f64| limits(f(displacement), f(rotation), f(hand));
    let limited = |limits: Limits<T>| limits.check().err();
    let feedback = |k1: f64, k2: f64| CouplingGains::new(gains(k1), sensors(k2)).err();
    let too_large = |entry: Entry| Some(TableError::TooLarge(entry));
    assert_eq!((feedback(1e4, 4.0), limited(limits(0.5, 3.0, 3.0))), (None, None));
    for value in [1e30, 2.1, 1e6] {
        assert_eq!(limited(limits(value, 1.0, 1.0)), too_large(Entry::Displacement), "{value}");
    }
    for value in [1e30, 3.15] {
        assert_eq!(limited(limits(0.2, value, 1.0)), too_large(Entry::Rotation), "{value}");
        assert_eq!(limited(limits(0.2, 1.0, value)), too_large(Entry::PointDisplacement), "{value}");
    }
    for (value, error) in [(-0.1, TableError::Negative), (f64::NAN, TableError::NotFinite)] {
        let is_refused = limited(limits(0.2, 1.0, value)) == Some(error);
        assert!(is_refused || f(value) == T::ZERO, "{value}");
    }
    let (point, column) = (0, 0);
    assert_eq!(feedback(1e30, 1.0), too_large(Entry::Sensitivity { point, column }));
    assert_eq!(feedback(1.0, 1e30), too_large(Entry::SensorWeight { point, column }));

    let mut samples = vec![[T::ZERO; SENSORS]; 7];
    assert!(ExpectedWrench::new(&samples, f(5.0)).is_ok());
    for duration in [0.0, -1.0, 4000.0, 1e30] {
        assert_eq!(ExpectedWrench::new(&samples, f(duration)).err(), Some(TableError::Duration), "{duration}");
    }
    samples[4][8] = f(-1e30);
    let entry = Entry::Expected { point: 4, column: 8 };
    assert_eq!(ExpectedWrench::new(&samples, f(5.0)).err(), too_large(entry));

    let statistics = |mean: f64, spread: f64| {
        let mut tables = [[[f(0.5); CHANNELS]; 3]; 2];
        (tables[0][2][11], tables[1][1][0]) = (f(mean), f(spread));
        Statistics::new(&tables[0], &tables[1], 3).err()
    };
    assert_eq!(statistics(1.0, 1e-3), None);
    assert_eq!(statistics(1e30, 1.0), too_large(Entry::Mean { point: 2, column: 11 }));
    assert_eq!(statistics(1.0, 1e30), too_large(Entry::Spread { point: 1, column: 0 }));
    for narrow in [0.0, 1e-7, 1e-39] {
        assert_eq!(statistics(1.0, narrow), Some(TableError::Spread), "{narrow}");
    }
}

#[test]
fn limits_gains_and_sensor_values_beyond_anything_real_are_refused_by_their_place() {
    check_tables::<f64>();
    check_tables::<f32>();
    check_tables::<FixedPoint>();
    assert_eq!(
        TableError::TooLarge(Entry::Displacement).to_string(),
        "the limit of the displacement is larger than anything real"
    );
    assert_eq!(
        TableError::TooLarge(Entry::Mean { point: 2, column: 11 }).to_string(),
        "the mean of the statistics at point 2, column 11 (from 0) is larger than anything real"
    );
}

fn check_turns<T: Scalar>() {
    for size in [1e-45, 1e-20, 0.2, 3.0, 900.0, 1.1e3, 1e4, 1e7, 1e10, 1e19, 1e20, 1e30, 3e38, 1e300] {
        for axis in [[1.0, 0.0, 0.0], [0.6, -0.5, 0.62]] {
            let q = Quaternion::from_rotation_vector(&axis.map(|part: f64| T::from_f64(part * size)));
            assert!((norm(&q.to_array()) - 1.0).abs() < 1e-6, "{size:e}: {q:?}");
        }
        let (sin, cos) = T::from_f64(size).sin_cos();
        let length = norm(&[sin, cos]);
        assert!(size > f64::from(f32::MAX) || (length - 1.0).abs() < 0.1, "{size:e}: {length}");
    }
    for nothing in [f64::NAN, f64::INFINITY] {
        let q = Quaternion::from_rotation_vector(&[T::from_f64(nothing), T::ZERO, T::ZERO]);
        assert!((norm(&q.to_array()) - 1.0).abs() < 1e-6, "{nothing}: {q:?}");
    }
}

/// Their squares overflow, and the place of their angle in a turn is lost; a rotation they still are.
#[test]
fn rotation_vectors_of_any_length_give_unit_quaternions() {
    check_turns::<f64>();
    check_turns::<f32>();
    check_turns::<FixedPoint>();
}
