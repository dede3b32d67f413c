//! Bad parameters are refused with a reason; no input makes a run panic, jump or leave the numbers.

use crate::arm::{
    Configuration, Coupling, ORIGIN, Primitive, ROWS, Rollout, StartState, Tables, Velocity, configuration, coupling,
    gains,
};
use crate::common::{ALPHA, DT, Plan, run};
use dmp::{
    Entry, FixedPoint, GainError, Group, Hemisphere, OrientationError, PhaseTable, PrimitiveError, Quaternion,
    RolloutError, Scalar, TableError,
};
use proptest::prelude::*;

fn tables(weights: &[f64]) -> Tables<'_, f64> {
    Tables {
        control_period: DT,
        duration: 5.0,
        alpha: ALPHA,
        activation: 0.7,
        kernel_count: 10,
        weights,
        gains: gains([200.0; 4], [28.3, 20.0, 28.3, 28.3]),
        orientation_error: OrientationError::Quaternion,
        hemisphere: Hemisphere::Demonstrated,
        start: ORIGIN,
        goal: ORIGIN,
        start_velocity: Velocity::ZERO,
    }
}

fn refused(change: impl Fn(&mut Tables<'_, f64>)) -> PrimitiveError {
    let weights = [0.1; ROWS * 10];
    let mut tables = tables(&weights);
    change(&mut tables);
    let error = Primitive::<f64, 20>::new(&tables).unwrap_err();
    assert!(!error.to_string().is_empty());
    error
}

#[test]
fn unusable_parameters_are_refused_with_their_reason() {
    let weights = [0.1; ROWS * 10];
    assert!(Primitive::<f64, 20>::new(&tables(&weights)).is_ok());
    for period in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(refused(|t| t.control_period = period), PrimitiveError::ControlPeriod);
    }
    // A slow loop needs a long movement.
    assert_eq!(
        refused(|t| t.control_period = 90.0 * DT),
        PrimitiveError::Unstable { group: Group::Position, index: 0 }
    );
    for duration in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(refused(|t| t.duration = duration), PrimitiveError::Duration);
    }
    // alpha = 1 leaves 37 % of the phase at the end.
    for alpha in [1.0, 20.0, f64::NAN] {
        assert_eq!(refused(|t| t.alpha = alpha), PrimitiveError::Alpha);
    }
    for kernels in [0, 1, 21] {
        assert_eq!(refused(|t| t.kernel_count = kernels), PrimitiveError::KernelCount);
    }
    assert_eq!(refused(|t| t.kernel_count = 11), PrimitiveError::WeightCount);
    assert_eq!(refused(|t| t.activation = 0.99), PrimitiveError::Activation);
    assert_eq!(refused(|t| t.weights = &[f64::NAN; ROWS * 10]), PrimitiveError::Weight);
    assert_eq!(
        refused(|t| t.gains.points[4].stiffness = -1.0),
        PrimitiveError::Gains { group: Group::Points, index: 4, error: GainError::Stiffness }
    );
    assert_eq!(
        refused(|t| t.gains.poses[0].orientation.damping = f64::NAN),
        PrimitiveError::Gains { group: Group::Orientation, index: 0, error: GainError::Damping }
    );
    // The default gains need tau > 0.057 s at 300 Hz.
    assert_eq!(refused(|t| t.duration = 0.0565), PrimitiveError::Unstable { group: Group::Position, index: 0 });
    assert_eq!(refused(|t| t.start.points[6] = f64::NAN), PrimitiveError::Start);
    assert_eq!(refused(|t| t.goal.points[7] = f64::INFINITY), PrimitiveError::Goal);
    assert_eq!(refused(|t| t.start_velocity.points[7] = f64::NAN), PrimitiveError::StartVelocity);
    assert_eq!(refused(|t| t.start.poses[0].orientation.w = 0.9), PrimitiveError::StartNotUnit);
    assert_eq!(refused(|t| t.goal.poses[0].orientation.x = 0.1), PrimitiveError::GoalNotUnit);
    let far = Quaternion::from_rotation_vector(&[0.0, 3.1, 0.0]);
    assert_eq!(refused(|t| t.goal.poses[0].orientation = far), PrimitiveError::TurnsTooFar);
}

#[test]
fn shortest_accepted_duration_is_stable_and_a_shorter_one_is_not() {
    let mut plan = Plan::empty();
    plan.goal.poses[0].position = [1.0; 3];
    plan.duration = 0.0575;
    let primitive = plan.build::<f64>();
    assert!((primitive.minimum_duration() - 0.0569).abs() < 1e-4);
    let rows = run(&primitive, 3000, DT, |_, _| Coupling::NONE);
    assert!((rows[2999].poses[0].position.x[0] - 1.0).abs() < 1e-6);
    // Negative control: the same equations with a step just beyond the limit blow up.
    let mut state = dmp::PointState::new(0.0, 0.0);
    let h = DT / 0.056;
    for _ in 0..3000 {
        let rhs = primitive.pose_systems()[0][0]
            .right_hand_side(&state, &dmp::PointInput { start: 0.0, goal: 1.0, s: 0.0, f: 0.0, zeta: 0.0 });
        state.step(rhs, h);
    }
    assert!(state.x().is_nan() || state.x().abs() > 1e6);
}

#[test]
fn changes_in_flight_are_refused_without_touching_the_run() {
    let plan = Plan::golden();
    let primitive = plan.build::<f64>();
    let mut rollout = Rollout::start(&primitive, &StartState::demonstrated(&primitive)).unwrap();
    rollout.step(&primitive, DT, &Coupling::NONE).unwrap();
    let before = rollout.clone();
    let nan = f64::NAN;
    assert_eq!(rollout.set_goal_position(0, [nan; 3]), Err(RolloutError::NotFinite));
    assert_eq!(rollout.set_goal_points([nan; 11]), Err(RolloutError::NotFinite));
    assert_eq!(rollout.set_goal_position(1, [0.0; 3]), Err(RolloutError::NoSuchPose));
    assert_eq!(rollout.set_goal_orientation(&primitive, 1, Quaternion::IDENTITY), Err(RolloutError::NoSuchPose));
    let half = Quaternion::new(0.5, 0.0, 0.0, 0.0);
    assert_eq!(rollout.set_goal_orientation(&primitive, 0, half), Err(RolloutError::NotUnit));
    assert_eq!(rollout.set_duration(&primitive, 0.01), Err(RolloutError::TooFast));
    assert_eq!(rollout.set_duration(&primitive, 0.0), Err(RolloutError::Negative));
    assert_eq!(rollout.set_speed(&primitive, 500.0), Err(RolloutError::TooFast));
    assert_eq!(rollout.set_speed(&primitive, -1.0), Err(RolloutError::Negative));
    assert_eq!(rollout.set_goal_filter(Some(0.0)), Err(RolloutError::Negative));
    assert_eq!(rollout.set_speed_slew(Some(nan)), Err(RolloutError::NotFinite));
    assert_eq!(rollout, before);
}

#[test]
fn frozen_time_holds_the_plan_and_resumes_on_the_same_path() {
    let primitive = Plan::golden().build::<f64>();
    let rows = run(&primitive, 2400, DT, |i, rollout| {
        match i {
            500 => rollout.freeze(),
            800 => {
                rollout.set_speed_slew(Some(2.0)).unwrap();
                rollout.resume();
            }
            _ => {}
        }
        Coupling::NONE
    });
    for row in &rows[500..800] {
        assert_eq!(row.poses[0].position.x, rows[500].poses[0].position.x);
        assert_eq!(row.poses[0].orientation.quaternion, rows[500].poses[0].orientation.quaternion);
        assert_eq!([row.poses[0].position.v, row.poses[0].position.a], [[0.0; 3]; 2]);
        assert_eq!(row.phase, rows[500].phase);
    }
    assert!((rows[799].time - 799.0 * DT).abs() < 1e-9);
    // Velocity comes back without a jump.
    let faster = rows[801..]
        .windows(2)
        .all(|pair| (0..3).all(|i| (pair[1].poses[0].position.v[i] - pair[0].poses[0].position.v[i]).abs() < 5e-3));
    assert!(faster);
    assert!((rows[2399].poses[0].position.x[0] - 0.55).abs() < 2e-3);
}

/// The change that makes it fail: the velocities are those of the step before.
#[test]
fn a_run_tells_the_velocity_of_its_next_step_before_it() {
    let primitive = Plan::golden().build::<f64>();
    let mut rollout = Rollout::start(&primitive, &StartState::demonstrated(&primitive)).unwrap();
    rollout.set_speed(&primitive, 1.7).unwrap();
    for _ in 0..400 {
        let [told] = rollout.scaled_velocities();
        let plan = rollout.step(&primitive, DT, &Coupling::NONE).unwrap();
        assert_eq!(plan.poses[0].position.v, told.map(|v| v * plan.rate));
    }
}

#[test]
fn a_late_tick_is_an_error_and_a_senseless_one_moves_nothing() {
    let primitive = Plan::golden().build::<f64>();
    let mut rollout = Rollout::start(&primitive, &StartState::demonstrated(&primitive)).unwrap();
    rollout.step(&primitive, DT, &Coupling::NONE).unwrap();
    let before = rollout.clone();
    for late in [1.001 * DT, 0.5, f64::INFINITY] {
        assert_eq!(rollout.step(&primitive, late, &Coupling::NONE).err(), Some(RolloutError::PeriodTooLong));
        assert_eq!(rollout, before);
    }
    let next = rollout.clone().step(&primitive, DT, &Coupling::NONE).unwrap();
    for dt in [0.0, -1.0, f64::NAN] {
        rollout.step(&primitive, dt, &Coupling::NONE).unwrap();
    }
    assert_eq!([rollout.progress(), rollout.phase()], [before.progress(), before.phase()]);
    let after = rollout.step(&primitive, DT, &Coupling::NONE).unwrap();
    assert_eq!((after.poses, after.points, after.time), (next.poses, next.points, next.time));
}

#[test]
fn goal_filter_turns_the_jump_into_a_ramp() {
    let primitive = Plan::golden().build::<f64>();
    let turned = Quaternion::from_rotation_vector(&[0.4, -0.5, 1.0]);
    let jump = |filter: Option<f64>| {
        let rows = run(&primitive, 6000, DT, |i, rollout| {
            if i == 900 {
                rollout.set_goal_filter(filter).unwrap();
                rollout.set_goal_position(0, [0.65, 0.2, 0.05]).unwrap();
                rollout.set_goal_orientation(&primitive, 0, turned).unwrap();
            }
            Coupling::NONE
        });
        let end = rows[5999];
        assert!((end.poses[0].position.x[0] - 0.65).abs() < 1e-6);
        let miss = end.poses[0].orientation.quaternion.aligned_with(&turned).conjugate().product(&turned);
        assert!(miss.angle() < 1e-4, "{}", miss.angle());
        (rows[900].poses[0].position.a[0] - rows[899].poses[0].position.a[0]).abs()
    };
    assert!(jump(None) > 0.5);
    assert!(jump(Some(12.5)) < 0.05);
}

/// Guards what is documented of a filter in f32: it reaches its goal while it goes 1e-5 of its way in a tick.
#[test]
fn a_goal_filter_reaches_its_goal_down_to_the_documented_share_of_a_tick() {
    let system = dmp::Gain { stiffness: 1e4_f32, damping: 200.0 };
    let end = dmp::Configuration::<f32, 1, 0> { poses: [], points: [10.0] };
    for (duration, reached) in [(190.0, true), (250.0, false)] {
        let tables = dmp::PrimitiveTables {
            control_period: 1e-3,
            duration,
            alpha: 4.6,
            activation: 0.7,
            kernel_count: 2,
            weights: &[0.0; 2],
            gains: dmp::Gains { poses: [], points: [system] },
            orientation_error: OrientationError::Quaternion,
            hemisphere: Hemisphere::Nearest,
            start: end,
            goal: end,
            start_velocity: dmp::Velocity::ZERO,
        };
        let primitive = dmp::Primitive::<f32, 1, 0, 2>::new(&tables).unwrap();
        let mut rollout = dmp::Rollout::start(&primitive, &dmp::StartState::at_rest(end)).unwrap();
        rollout.set_goal_filter(Some(2.0)).unwrap();
        rollout.set_goal_points([10.04]).unwrap();
        let mut value = 0.0;
        while rollout.progress() < 2.0 {
            value = rollout.step(&primitive, 1e-3, &dmp::Coupling::NONE).unwrap().points.x[0];
        }
        assert_eq!((value - 10.04).abs() < 1e-4, reached, "in {duration} s: {value}");
    }
}

#[test]
fn start_turned_past_a_full_turn_still_goes_the_demonstrated_way() {
    // Demonstrated: 350 degrees about z. Started 20 degrees further back, in either sign.
    let mut plan = Plan::empty();
    plan.orientation_error = OrientationError::RotationVector;
    plan.hemisphere = Hemisphere::Demonstrated;
    let about_z = |degrees: f64| Quaternion::from_rotation_vector(&[0.0, 0.0, degrees.to_radians()]);
    plan.start.poses[0].orientation = Quaternion::IDENTITY;
    plan.goal.poses[0].orientation = about_z(350.0);
    let primitive = plan.build::<f64>();
    for from in [about_z(-20.0), about_z(-20.0).negated(), about_z(15.0)] {
        let start = StartState::at_rest(configuration([0.0; 3], from, [0.0; 7], [0.0; 4]));
        let mut rollout = Rollout::start(&primitive, &start).unwrap();
        let mut turned = 0.0;
        let mut last = from;
        for _ in 0..9000 {
            let q = rollout.step(&primitive, DT, &Coupling::NONE).unwrap().poses[0].orientation.quaternion;
            turned += last.conjugate().product(&q.aligned_with(&last)).rotation_vector()[2];
            last = q;
        }
        let expected = (about_z(350.0).rotation_vector()[2]
            - from.aligned_with(&Quaternion::IDENTITY).rotation_vector()[2])
            .to_degrees();
        assert!((turned.to_degrees() - expected).abs() < 0.5, "{} {expected}", turned.to_degrees());
    }
}

/// Guards what is documented of rotation vectors without a demonstration: the stored start and goal tell the way round.
#[test]
fn rotation_vectors_without_a_demonstration_go_the_way_of_the_stored_start_and_goal() {
    let about_z = |degrees: f64| Quaternion::from_rotation_vector(&[0.0, 0.0, degrees.to_radians()]);
    let at = |degrees: f64| StartState::at_rest(configuration([0.0; 3], about_z(degrees), [0.0; 7], [0.0; 4]));
    let mut plan = Plan::empty();
    plan.goal.poses[0].orientation = about_z(170.0);
    let cases = [(-20.0, None, 190.0, -170.0), (0.0, Some(190.0), 190.0, -170.0), (0.0, Some(-100.0), 260.0, -100.0)];
    for (from, goal, by_vectors, by_quaternions) in cases {
        let errors = [OrientationError::RotationVector, OrientationError::Quaternion];
        for (error, expected) in errors.into_iter().zip([by_vectors, by_quaternions]) {
            plan.orientation_error = error;
            let primitive = plan.build::<f64>();
            let mut rollout = Rollout::start(&primitive, &at(from)).unwrap();
            if let Some(goal) = goal {
                rollout.set_goal_orientation(&primitive, 0, about_z(goal)).unwrap();
            }
            let (mut turned, mut last) = (0.0, about_z(from));
            for _ in 0..9000 {
                let q = rollout.step(&primitive, DT, &Coupling::NONE).unwrap().poses[0].orientation.quaternion;
                turned += last.conjugate().product(&q.aligned_with(&last)).rotation_vector()[2].to_degrees();
                last = q;
            }
            assert!((turned - expected).abs() < 0.5, "{error:?} from {from} to {goal:?}: {turned}");
        }
    }
}

/// Guards the words about kernels that fixed point cannot hold, though their activation is within its bounds.
#[test]
fn kernels_that_fixed_point_cannot_hold_are_not_blamed_on_their_activation_alone() {
    let f = FixedPoint::from_f64;
    for (count, alpha, activation) in [(1000, ALPHA, 0.7), (2, 8.8, 0.45)] {
        let (plain, weights) = (tables(&[]), vec![0; ROWS * count]);
        let fixed = Tables::<FixedPoint> {
            control_period: f(DT),
            duration: f(5.0),
            alpha: f(alpha),
            activation: f(activation),
            kernel_count: count,
            weights: &weights,
            gains: plain.gains.cast(),
            orientation_error: plain.orientation_error,
            hemisphere: plain.hemisphere,
            start: plain.start.cast(),
            goal: plain.goal.cast(),
            start_velocity: plain.start_velocity.cast(),
        };
        let words = Primitive::<FixedPoint, 1000>::new(&fixed).unwrap_err().to_string();
        assert!(words.contains("the number type cannot hold so many or so few kernels"), "{count}: {words}");
        let weights = vec![0.0; ROWS * count];
        let double = Tables { kernel_count: count, alpha, activation, weights: &weights, ..tables(&[]) };
        assert!(Primitive::<f64, 1000>::new(&double).is_ok(), "f64 holds {count} kernels");
    }
}

#[test]
fn tables_interpolate_and_hold_outside() {
    let table = PhaseTable::<f64, 1, 4>::new(&[[1.0], [3.0], [2.0]]).unwrap();
    for (u, value) in [(-1.0, 1.0), (0.0, 1.0), (0.25, 2.0), (0.5, 3.0), (0.75, 2.5), (1.0, 2.0), (9.0, 2.0)] {
        assert!((table.at(u)[0] - value).abs() < 1e-12);
    }
    assert_eq!(table.at(f64::NAN), [1.0]);
    assert_eq!(PhaseTable::<f64, 1, 4>::new(&[]), Err(TableError::Empty));
    assert_eq!(PhaseTable::<f64, 1, 4>::new(&[[0.0]; 5]), Err(TableError::TooMany));
    assert_eq!(PhaseTable::<f64, 1, 4>::new(&[[f64::NAN]]), Err(TableError::NotFinite));
}

/// Guards what is documented of recorded values that are refused: too large ones, and a spread that stays too small.
#[test]
fn recorded_values_that_no_sensor_has_and_a_spread_of_almost_nothing_are_refused() {
    let run = |value: f64| [(0.0, [value]), (1.0, [value])];
    let expected = dmp::fit::expected_sensors::<1, 2>(&run(2e5), 2, 1.0).unwrap_err();
    assert_eq!(expected, TableError::TooLarge(Entry::Expected { point: 0, column: 0 }));
    let statistics = |value: f64, floor: f64| {
        let trials = [run(value), run(value)];
        dmp::fit::sensor_statistics::<1, 2>(&trials.each_ref().map(|run| run.as_slice()), 2, &[floor], &[false])
    };
    assert_eq!(statistics(2e5, 1.0).unwrap_err(), TableError::TooLarge(Entry::Mean { point: 0, column: 0 }));
    assert_eq!(statistics(1.0, 1e-9).unwrap_err(), TableError::Spread);
    assert!(statistics(1.0, 1e-3).is_ok());
}

#[test]
fn recorded_sensor_values_become_an_expectation_by_phase() {
    let samples: Vec<_> = (0..1500)
        .map(|k| {
            let u = k as f64 / 1499.0;
            (u, std::array::from_fn(|i| (3.0 * u + i as f64).sin()))
        })
        .collect();
    let expected = dmp::fit::expected_sensors::<9, 128>(&samples, 101, 5.0).unwrap();
    for u in [0.0, 0.123, 0.5, 0.871, 1.0] {
        for (i, value) in expected.at(u).iter().enumerate() {
            assert!((value - (3.0 * u + i as f64).sin()).abs() < 0.02);
        }
    }
    assert_eq!(dmp::fit::expected_sensors::<9, 128>(&[], 101, 5.0), Err(TableError::Empty));
}

fn scalar_functions<T: Scalar>(absolute: f64) {
    let close = |a: T, b: f64, scale: f64| {
        let a = a.to_f64();
        assert!((a - b).abs() <= absolute * scale.max(1.0), "{a} {b}");
    };
    for i in -400..=400 {
        let x = f64::from(i) * 0.05;
        let t = T::from_f64(x);
        let x = t.to_f64();
        close(T::exp(t), x.exp(), x.exp() * 20.0);
        close(T::sin_cos(t).0, x.sin(), 1.0);
        close(T::sin_cos(t).1, x.cos(), 1.0);
        if i >= 0 {
            close(T::sqrt(t), x.sqrt(), x);
            if x <= T::NEGLIGIBLE_EXPONENT.to_f64() {
                close(T::kernel(t), (-x).exp(), 1.0);
            }
        }
        for j in [-3.0, -0.4, 0.0, 1e-3, 2.0] {
            close(T::atan2(t, T::from_f64(j)), x.atan2(T::from_f64(j).to_f64()), 1.0);
        }
    }
}

#[test]
fn elementary_functions_are_exact_in_every_number_type() {
    scalar_functions::<f64>(2e-15);
    scalar_functions::<f32>(4e-7);
    scalar_functions::<FixedPoint>(2e-9);
}

#[test]
fn fixed_point_saturates_and_never_wraps() {
    let (max, one) = (FixedPoint::MAX, FixedPoint::ONE);
    assert_eq!(max + one, max);
    assert_eq!(max * max, max);
    assert_eq!(one / FixedPoint::ZERO, max);
    assert!((-max) - max < FixedPoint::ZERO);
    assert_eq!(FixedPoint::from_f64(1e300), max);
    assert_eq!(FixedPoint::from_f64(f64::NAN), FixedPoint::ZERO);
    assert_eq!(Scalar::exp(FixedPoint::from_f64(30.0)), max);
    assert_eq!(Scalar::exp(-max), FixedPoint::ZERO);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_tables_are_refused_or_run(
        values in prop::collection::vec(prop::num::f64::ANY, 40),
        weights in prop::collection::vec(-1e6..1e6_f64, ROWS * 3),
        plausible in any::<bool>(),
        kernels in 0_usize..6,
    ) {
        let v = |i: usize| if plausible { values[i].clamp(-10.0, 10.0) } else { values[i] };
        let ends = |at: usize| -> Configuration<f64> {
            let orientation = if plausible {
                Quaternion::IDENTITY
            } else {
                Quaternion::new(v(at), v(at + 1), v(at + 2), v(at + 3))
            };
            configuration([v(at), v(at + 1), v(at + 2)], orientation, [v(at + 4); 7], [v(at + 5); 4])
        };
        let tables = Tables {
            control_period: DT,
            duration: if plausible { 3.0 } else { v(30) },
            alpha: if plausible { 4.6 } else { v(31) },
            activation: if plausible { 0.7 } else { v(32) },
            kernel_count: if plausible { 3 } else { kernels },
            weights: &weights,
            gains: gains([200.0; 4], [28.0; 4]),
            orientation_error: OrientationError::RotationVector,
            hemisphere: Hemisphere::Nearest,
            start: ends(0),
            goal: ends(10),
            start_velocity: Velocity::ZERO,
        };
        if let Ok(primitive) = Primitive::<f64, 4>::new(&tables) {
            let start = StartState::demonstrated(&primitive);
            let mut rollout = Rollout::start(&primitive, &start).unwrap();
            for i in 0..200 {
                let zeta = coupling([values[i % 40]; 3], [0.0; 3], [0.0; 4]);
                let Ok(row) = rollout.step(&primitive, values[(i * 7) % 40].min(DT), &zeta) else {
                    return Err(TestCaseError::fail("a step within the control period was refused"));
                };
                prop_assert!(row.phase > 0.0 && row.phase <= 1.0);
            }
        }
    }
}
