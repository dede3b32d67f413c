//! Mistakes of somebody who learns a movement for the first time: each has an error that names it.

use dmp::fit::{
    Demonstration, DemonstrationError, FitError, FitOptions, Learned, PoseSamples, fit, fit_several, minimum_jerk,
};
use dmp::{
    Coupling, FixedPoint, GainError, Group, OrientationError, Part, Primitive, PrimitiveError, Quaternion, Rollout,
    Scalar, StartState, Stiffness,
};

/// Normally distributed numbers, the same for the same seed.
fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        let uniform = |_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        (0..12).map(uniform).sum()
    }
}

fn row(period: f64, samples: usize) -> Demonstration<1, 0> {
    let samples: Vec<f64> = minimum_jerk([0.0], [1.0], samples).into_iter().map(|[x]| x).collect();
    Demonstration::of_row(period, &samples).unwrap()
}

fn turn(angle: f64, samples: usize) -> PoseSamples {
    let orientation = minimum_jerk([0.0; 3], [0.0, 0.0, angle], samples);
    PoseSamples {
        position: minimum_jerk([0.0; 3], [0.3, 0.0, 0.0], samples),
        orientation: orientation.iter().map(Quaternion::from_rotation_vector).collect(),
    }
}

fn refused(change: impl Fn(&mut FitOptions<1, 0>)) -> FitError {
    let mut options = FitOptions::default();
    change(&mut options);
    fit(&row(0.002, 1001), &options).expect_err("it is refused")
}

#[test]
fn a_period_or_stiffness_that_is_none_is_not_reported_as_a_weight() {
    for period in [f64::NAN, f64::INFINITY, -0.002, 0.0, 1e-9, 1e300] {
        let error = refused(|options| options.control_period = Some(period));
        assert_eq!(error, FitError::Primitive(PrimitiveError::ControlPeriod), "{period}");
    }
    let error = GainError::Stiffness;
    for stiffness in [f64::NAN, f64::INFINITY, -200.0, 0.0, 1e7] {
        let found = refused(|options| options.stiffness = Stiffness::uniform(stiffness));
        let expected = PrimitiveError::Gains { group: Group::Points, index: 0, error };
        assert_eq!(found, FitError::Primitive(expected), "{stiffness}");
    }
    for (period, error) in [(1e-320, PrimitiveError::ControlPeriod), (1e300, PrimitiveError::Duration)] {
        let options = FitOptions { cutoff: None, ..FitOptions::default() };
        assert_eq!(fit(&row(period, 100), &options).unwrap_err(), FitError::Primitive(error));
    }
}

#[test]
fn a_cut_off_that_would_flatten_the_whole_movement_is_refused() {
    // Slower than one period within the movement the ends do not stay in their places: at 0.1 Hz the goal of this
    // demonstration of one second would come out at -0.15 instead of 1.
    for (duration, cutoff) in [(1.0, 0.3), (1.0, 0.9), (0.1, 7.5), (1.0, 1e-9)] {
        let options = FitOptions { cutoff: Some(cutoff), ..FitOptions::default() };
        let period = 0.001;
        let demonstration = row(period, (duration / period) as usize + 1);
        assert_eq!(fit(&demonstration, &options).unwrap_err(), FitError::Cutoff, "{duration} s, {cutoff} Hz");
    }
    let options = FitOptions { cutoff: Some(1.01), ..FitOptions::default() };
    let learned = fit(&row(0.001, 1001), &options).unwrap();
    assert!((learned.goal.points[0] - 1.0).abs() < 1e-3 && learned.start.points[0].abs() < 1e-3);
}

#[test]
fn poses_alone_are_learned_with_and_without_empty_rows() {
    let with = Demonstration::<0, 1>::new(0.01, [turn(1.0, 200)], vec![[]; 200]).unwrap();
    let without = Demonstration::<0, 1>::new(0.01, [turn(1.0, 200)], Vec::new()).unwrap();
    assert_eq!(with, without);
    let rows = Demonstration::<0, 1>::new(0.01, [turn(1.0, 200)], vec![[]; 199]);
    assert_eq!(rows, Err(DemonstrationError::Lengths));
    let uneven = PoseSamples { position: Vec::new(), ..turn(1.0, 200) };
    assert_eq!(Demonstration::<0, 1>::new(0.01, [uneven], Vec::new()), Err(DemonstrationError::Lengths));
    let none = Demonstration::<0, 0>::new(0.01, [], Vec::new());
    assert_eq!(none, Err(DemonstrationError::TooFew { samples: 0 }));
}

#[test]
fn demonstrations_that_turn_opposite_ways_are_not_called_quaternions_of_wrong_length() {
    let shown = |angle: f64| Demonstration::<0, 1>::new(0.01, [turn(angle, 200)], vec![[]; 200]).unwrap();
    let error = fit_several(&[shown(3.1), shown(-3.1)], &FitOptions::default()).unwrap_err();
    let FitError::Demonstration(DemonstrationError::Opposite { sample }) = error else { panic!("{error:?}") };
    assert!((100..200).contains(&sample), "{sample}");
    assert_eq!(error.to_string(), format!("the orientations of sample {sample} are too far apart to have a mean"));
}

/// The noise of a sensor has no share of itself that is small.
#[test]
fn a_pose_that_only_trembles_is_at_rest() {
    let samples = 1001;
    for seed in 1..4 {
        let mut noise = noise(seed);
        let still = PoseSamples {
            position: (0..samples).map(|_| [0; 3].map(|_| 2e-5 * noise())).collect(),
            orientation: (0..samples)
                .map(|_| Quaternion::from_rotation_vector(&[0; 3].map(|_| 2e-4 * noise())))
                .collect(),
        };
        let points = minimum_jerk([0.0], [1.0], samples);
        let learned = fit(&Demonstration::new(0.002, [still], points).unwrap(), &FitOptions::default()).unwrap();
        let primitive: Primitive<f64, 1, 1, 50> = learned.primitive().unwrap();
        let mut rollout = Rollout::start(&primitive, &StartState::demonstrated(&primitive)).unwrap();
        let (mut point, mut turn) = (0.0_f64, 0.0_f64);
        while rollout.progress() < 3.0 {
            let plan = rollout.step(&primitive, 0.002, &Coupling::NONE).unwrap();
            if plan.progress > 1.0 {
                point = point.max((plan.points.x[0] - learned.goal.points[0]).abs());
                let q = plan.poses[0].orientation.quaternion;
                turn = turn.max(learned.goal.poses[0].orientation.conjugate().product(&q).angle());
            }
        }
        assert!(point < 1e-4, "seed {seed}: the joint leaves its goal by {point} rad");
        assert!(turn < 2e-3, "seed {seed}: the hand that stood still turns by {turn} rad");
    }
}

/// The same movement in all number types, from the swing of a leg at 1 kHz to ten minutes.
#[test]
fn number_types_agree_on_short_and_long_movements() {
    // Duration, control period, bound of f32 and of fixed point: both drift with the number of ticks.
    const MOVEMENTS: [(f64, f64, f64, f64); 4] =
        [(0.01, 1e-4, 1e-6, 2e-6), (0.15, 1e-3, 1e-6, 1e-6), (100.0, 1e-3, 5e-6, 5e-5), (600.0, 1e-3, 2e-5, 2e-4)];
    for (duration, dt, single, fixed) in MOVEMENTS {
        let options = FitOptions { cutoff: None, control_period: Some(dt), ..FitOptions::default() };
        let learned = fit(&row(duration / 2000.0, 2001), &options).unwrap();
        let exact = path::<f64>(&learned.primitive().unwrap());
        for (name, path, bound) in [
            ("f32", path::<f32>(&learned.primitive().unwrap()), single),
            ("fixed", path::<FixedPoint>(&learned.primitive().unwrap()), fixed),
        ] {
            let worst = exact.iter().zip(&path).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(worst < bound, "{name}, {duration} s: {worst:e}");
        }
    }
}

fn path<T: Scalar>(primitive: &Primitive<T, 1, 0, 50>) -> Vec<f64> {
    let mut rollout = Rollout::start(primitive, &StartState::demonstrated(primitive)).unwrap();
    let ticks = (1.2 * primitive.duration().to_f64() / primitive.control_period().to_f64()) as usize;
    let mut step =
        || rollout.step(primitive, primitive.control_period(), &Coupling::NONE).unwrap().points.x[0].to_f64();
    (0..ticks).map(|_| step()).collect()
}

#[test]
fn a_movement_in_millimetres_is_told_its_value_and_not_its_weights() {
    for ([start, goal], part) in [([0.0, 500.0], Part::Goal), ([0.0, 1e6], Part::Goal), ([-500.0, 0.0], Part::Start)] {
        let samples: Vec<f64> = minimum_jerk([start], [goal], 1001).into_iter().map(|[x]| x).collect();
        let error = fit(&Demonstration::of_row(0.002, &samples).unwrap(), &FitOptions::default()).unwrap_err();
        let place = PrimitiveError::TooLarge { part, group: Group::Points, index: 0 };
        assert_eq!(error, FitError::Primitive(place), "{error}");
    }
}

/// Distance of the plan from a goal that came through the filter, and angle to it, long after the movement.
fn missed<T: Scalar>(learned: &Learned<1, 1>) -> [f64; 2] {
    let primitive: Primitive<T, 1, 1, 50> = learned.primitive().unwrap();
    let mut rollout = Rollout::start(&primitive, &StartState::demonstrated(&primitive)).unwrap();
    rollout.set_goal_filter(Some(T::from_f64(12.5))).unwrap();
    rollout.set_goal_points([T::from_f64(10.0)]).unwrap();
    let turn = Quaternion::from_rotation_vector(&[0.2, -0.3, 0.1]);
    let goal = learned.goal.poses[0].orientation.product(&turn);
    let [w, x, y, z] = goal.to_array().map(T::from_f64);
    rollout.set_goal_orientation(&primitive, 0, Quaternion::new(w, x, y, z)).unwrap();
    let mut plan = rollout.step(&primitive, primitive.control_period(), &Coupling::NONE).unwrap();
    while plan.progress < T::from_f64(4.0) {
        plan = rollout.step(&primitive, primitive.control_period(), &Coupling::NONE).unwrap();
    }
    let [w, x, y, z] = plan.poses[0].orientation.quaternion.to_array().map(T::to_f64);
    let off = goal.conjugate().product(&Quaternion::new(w, x, y, z)).vector();
    [(plan.points.x[0].to_f64() - 10.0).abs(), 2.0 * off.iter().map(|x| x * x).sum::<f64>().sqrt()]
}

#[test]
fn a_filtered_goal_is_reached_however_slow_the_movement_is() {
    // In a movement of 25 s a tick of the filter goes 5e-4 of the way: less than the last digit of an f32 long before
    // the goal.
    let (samples, duration) = (2001, 25.0);
    let pose = turn(0.8, samples);
    let points = minimum_jerk([0.0], [1.0], samples);
    let demonstration = Demonstration::<1, 1>::new(duration / 2000.0, [pose], points).unwrap();
    for orientation_error in [OrientationError::Quaternion, OrientationError::RotationVector] {
        // Stiff: the plan shall not hide where its goal is.
        let stiffness = Stiffness::uniform(10_000.0);
        let options =
            FitOptions { cutoff: None, control_period: Some(1e-3), stiffness, orientation_error, ..Default::default() };
        let learned = fit(&demonstration, &options).unwrap();
        for (name, [value, angle]) in [
            ("f64", missed::<f64>(&learned)),
            ("f32", missed::<f32>(&learned)),
            ("fixed", missed::<FixedPoint>(&learned)),
        ] {
            assert!(value < 1e-5, "{orientation_error:?}, {name}: {value:e}");
            assert!(angle < 5e-5, "{orientation_error:?}, {name}: {angle:e}");
        }
    }
}

#[test]
fn number_types_agree_on_orientations_in_long_movements() {
    let (samples, duration) = (2001, 100.0);
    let mut pose = turn(0.8, samples);
    // About several axes, and from an orientation that is none of them.
    let start = Quaternion::from_rotation_vector(&[0.3, 0.6, 0.9]);
    for (q, [x]) in pose.orientation.iter_mut().zip(minimum_jerk([0.0], [1.0], samples)) {
        *q = start.product(q).product(&Quaternion::from_rotation_vector(&[0.9 * x, -0.4 * x, 0.7 * x * x]));
    }
    let demonstration = Demonstration::<0, 1>::new(duration / 2000.0, [pose], vec![[]; samples]).unwrap();
    for (orientation_error, single, fixed) in
        [(OrientationError::Quaternion, 5e-4, 1e-4), (OrientationError::RotationVector, 5e-6, 5e-5)]
    {
        let options =
            FitOptions { cutoff: None, control_period: Some(1e-3), orientation_error, ..FitOptions::default() };
        let learned = fit(&demonstration, &options).unwrap();
        let exact = orientations::<f64>(&learned);
        for (name, turned, bound) in
            [("f32", orientations::<f32>(&learned), single), ("fixed", orientations::<FixedPoint>(&learned), fixed)]
        {
            let off = |(a, b): (&Quaternion<f64>, &Quaternion<f64>)| {
                2.0 * a.conjugate().product(b).vector().iter().map(|x| x * x).sum::<f64>().sqrt()
            };
            let worst = exact.iter().zip(&turned).map(off).fold(0.0, f64::max);
            assert!(worst < bound, "{orientation_error:?}, {name}: {worst:e}");
        }
    }
}

fn orientations<T: Scalar>(learned: &Learned<0, 1>) -> Vec<Quaternion<f64>> {
    let primitive: Primitive<T, 0, 1, 50> = learned.primitive().unwrap();
    let mut rollout = Rollout::start(&primitive, &StartState::demonstrated(&primitive)).unwrap();
    let ticks = (1.2 * primitive.duration().to_f64() / primitive.control_period().to_f64()) as usize;
    let mut step = || {
        let plan = rollout.step(&primitive, primitive.control_period(), &Coupling::NONE).unwrap();
        let [w, x, y, z] = plan.poses[0].orientation.quaternion.to_array().map(T::to_f64);
        Quaternion::new(w, x, y, z)
    };
    (0..ticks).map(|_| step()).collect()
}

#[test]
fn a_turn_of_exactly_half_a_circle_names_the_other_error() {
    let demonstration = Demonstration::<0, 1>::new(0.01, [turn(core::f64::consts::PI, 200)], vec![[]; 200]).unwrap();
    let error = fit(&demonstration, &FitOptions::default()).unwrap_err();
    assert!(matches!(error, FitError::TurnsTooFar { .. }) && error.to_string().contains("RotationVector"), "{error}");
    let options = FitOptions { orientation_error: OrientationError::RotationVector, ..FitOptions::default() };
    assert!(fit(&demonstration, &options).unwrap().report.orientations[0].max < 1e-3);
}
