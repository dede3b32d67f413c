//! Bounds of single parts: what was once accepted, or once came out, that no movement can use.

use crate::common::{ALPHA, DT, ORIGIN, Plan};
use dmp::fit::{Demonstration, FitOptions, experience, fit, minimum_jerk, phase_statistics};
use dmp::{
    Basis, CanonicalSystem, Coupling, EXPERIENCE_CHANNELS, Feedback, FixedPoint, GainSchedule, Limits,
    OrientationError, Phase, Quaternion, Rollout, RolloutError, SENSORS, Scalar, SensorMap, StartState, Stiffness,
    TableError, TransformationSystem,
};

fn feedback<T: Scalar>(limit: f64) -> Feedback<T> {
    let f = T::from_f64;
    Feedback::new(
        GainSchedule::constant([T::ONE; 10]).unwrap(),
        GainSchedule::constant([T::ONE; SENSORS]).unwrap(),
        Limits { displacement: f(limit), rotation: f(limit), hand: f(limit) },
    )
    .unwrap()
}

fn stiffness<T: Scalar>() -> Stiffness<T> {
    let k = T::from_f64(200.0);
    Stiffness { position: k, orientation: k, hand: k, orientation_error: OrientationError::Quaternion }
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
                let zeta = feedback(limit).coupling(0.0, &axes, &SensorMap::IDENTITY, &stiffness());
                let all = [zeta.position.as_slice(), &zeta.orientation, &zeta.hand].concat();
                assert!(all.iter().all(|z| z.is_finite()), "limit {limit}, error {error:e}: {zeta:?}");
                assert!(norm(&zeta.position) <= 200.0 * limit && norm(&zeta.orientation) <= 200.0 * limit, "{zeta:?}");
            }
        }
        // In fixed point the reciprocal saturates instead.
        let zeta = feedback(limit).coupling(
            FixedPoint::ZERO,
            &[FixedPoint::from_bits(1); SENSORS],
            &SensorMap::IDENTITY,
            &stiffness(),
        );
        assert!(norm(&zeta.position) <= 200.0 * limit, "limit {limit}: {zeta:?}");
    }
}

/// `4/(sqrt(D^2 + 4K) + D)`, capped at `2/D`, in a type where `D^2` neither saturates nor swallows `4K`.
fn largest_step(k: f64, d: f64) -> f64 {
    (4.0 / (d.hypot(2.0 * k.sqrt()) + d)).min(2.0 / d)
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
        (1e6, 0.01),
        (1.0, 0.01),
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

type Run = Vec<(f64, [f64; EXPERIENCE_CHANNELS])>;

/// A run whose values fall from its very beginning.
fn run_from(value: f64) -> Run {
    (0..200).map(|k| f64::from(k) / 199.0).map(|u| (u, [value - u; EXPERIENCE_CHANNELS])).collect()
}

#[test]
fn a_sample_at_no_progress_is_no_sample_at_the_end() {
    let floor = [0.05; EXPERIENCE_CHANNELS];
    for u in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut run = run_from(1.0);
        run[50].0 = u;
        assert_eq!(experience(&[&run, &run_from(1.0)], 8, &floor).err(), Some(TableError::NotFinite), "{u}");
    }
}

#[test]
fn a_run_without_a_usable_sample_leaves_the_others_alone() {
    let alone = phase_statistics(&[&run_from(1.0)], 8).unwrap();
    for stray in [vec![(1.5, [7.0; EXPERIENCE_CHANNELS]); 3], vec![(-0.5, [7.0; EXPERIENCE_CHANNELS])], vec![]] {
        let both = phase_statistics(&[&run_from(1.0), &stray], 8).unwrap();
        assert_eq!(both, alone, "a run of {} samples outside", stray.len());
    }
}

/// Singular values of the design matrix `A_ki = s_k psi_i/sum psi` by one-sided Jacobi rotations: another way than the fit's.
fn condition_of_the_design(count: usize, activation: f64, samples: usize) -> f64 {
    let canonical = CanonicalSystem::new(ALPHA).unwrap();
    let basis = Basis::<f64, 200>::new(&canonical, count, activation).unwrap();
    let mut columns = vec![vec![0.0; samples]; count];
    for k in 0..samples {
        let active = basis.evaluate(canonical.phase_at(k as f64 / (samples - 1) as f64));
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
    Demonstration::new(DT, position, still, posture, hand).unwrap()
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
        plan.goal.orientation = about_z(60.0);
        let primitive = plan.build::<f64>();
        let mut rollout = Rollout::start(&primitive, &StartState::demonstrated(&primitive)).unwrap();
        let before = rollout.clone();
        for far in [about_z(178.0), about_z(180.0), about_z(178.0).negated()] {
            assert_eq!(rollout.set_goal_orientation(&primitive, far), Err(RolloutError::TurnsTooFar), "{hemisphere:?}");
            assert_eq!(rollout, before);
        }
        for near in [about_z(170.0), about_z(-90.0)] {
            rollout.clone().set_goal_orientation(&primitive, near).unwrap();
        }
        // The same bound holds where a run begins.
        let turned = StartState::at_rest(dmp::Configuration { orientation: about_z(-118.0), ..ORIGIN });
        assert_eq!(Rollout::start(&primitive, &turned).err(), Some(RolloutError::TurnsTooFar), "{hemisphere:?}");
    }
    // Rotation vectors go any way round.
    let mut plan = Plan::empty();
    plan.orientation_error = OrientationError::RotationVector;
    let primitive = plan.build::<f64>();
    let mut rollout = Rollout::start(&primitive, &StartState::demonstrated(&primitive)).unwrap();
    rollout.set_goal_orientation(&primitive, about_z(180.0)).unwrap();
}

/// The fit goes on with rest behind the last sample only if everything rests there. Whatever of it still moves would else be
/// stopped short.
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
    others[4].goal.hand[3] += 1e-6;
    others[5].hemisphere = dmp::Hemisphere::Demonstrated;
    others[6].weights.swap(3, 4);
    for (index, other) in others.iter().enumerate() {
        let other = other.build::<f32>();
        assert_eq!(rollout.step(&other, DT as f32, &Coupling::NONE).err(), refused.err(), "{index}");
        assert_eq!(rollout.coupling(&other, &[0.0; SENSORS], &SensorMap::IDENTITY).err(), refused.err(), "{index}");
        assert_eq!(rollout.set_speed(&other, 0.5), refused, "{index}");
        assert_eq!(rollout.set_duration(&other, 6.0), refused, "{index}");
        assert_eq!(rollout.set_goal_orientation(&other, Quaternion::IDENTITY), refused, "{index}");
        assert_eq!(rollout, before);
    }
    // A copy is the same movement, and so is one with another memory.
    let mut copy = primitive.clone();
    copy.set_expected(Some(&dmp::ExpectedWrench::new(&[[1.0; SENSORS]], 5.0).unwrap()));
    rollout.step(&copy, DT as f32, &Coupling::NONE).unwrap();
}
