//! Checks that a wrong sign, a wrong frame or a forgotten tau cannot pass. Numbers are those of the design's list.

use crate::arm::{
    Coupling, ExpectedWrench, Feedback, Reference, Rollout, SENSORS, StartState, coupling, limits, velocity,
};
use crate::common::{ALPHA, DT, K, Plan, run};
use dmp::{
    CanonicalSystem, Hemisphere, LogMap, OrientationError, Phase, PointInput, PointState, Quaternion, Scalar,
    TransformationSystem,
};

type Sample = Reference<f64>;

fn nominal(plan: &Plan, seconds: f64) -> Vec<Sample> {
    let primitive = plan.build::<f64>();
    run(&primitive, (seconds * 300.0) as usize, DT, |_, _| Coupling::NONE)
}

fn path_length<T: Scalar>(rows: &[Reference<T>]) -> f64 {
    rows.windows(2)
        .map(|pair| {
            let (a, b) = (&pair[0].poses[0].orientation.quaternion, &pair[1].poses[0].orientation.quaternion);
            a.conjugate().product(b).angle().to_f64()
        })
        .sum()
}

#[test]
fn check_1_first_tick_is_driven_by_the_forcing_term_alone() {
    // xdd(0) = K f(1)/tau^2; the kick K (g - x0)/tau^2 of a missing start term would be 1.2 m/s^2 here.
    let plan = Plan::golden();
    let primitive = plan.build::<f64>();
    let ([f], points) = primitive.forces(1.0);
    let first = &nominal(&plan, 0.1)[0];
    println!("first tick: {:?} m/s^2, {:?} rad/s^2", first.poses[0].position.a, first.poses[0].orientation.domega);
    for i in 0..3 {
        let (expected, turning) = (K * f[i] / 25.0, K * f[3 + i] / 25.0);
        assert!((first.poses[0].position.a[i] - expected).abs() < 1e-12, "{} {expected}", first.poses[0].position.a[i]);
        assert!(
            (first.poses[0].orientation.domega[i] - turning).abs() < 1e-12,
            "{} {turning}",
            first.poses[0].orientation.domega[i]
        );
        assert_eq!(first.poses[0].position.x[i], plan.start.poses[0].position[i]);
    }
    for i in 0..4 {
        assert!((first.points.a[7 + i] - K * points[7 + i] / 25.0).abs() < 1e-12);
    }
    let kick = K * (plan.goal.poses[0].position[0] - plan.start.poses[0].position[0]) / 25.0;
    assert!(kick > 10.0 * first.poses[0].position.a[0].abs());
}

#[test]
fn check_2_goal_jump_steps_the_acceleration_by_the_open_fraction() {
    let plan = Plan::golden();
    let primitive = plan.build::<f64>();
    let quiet = nominal(&plan, 5.0);
    let mut separation = 0.0_f64;
    for tick in [150, 400, 750, 1400] {
        let jumped = run(&primitive, 1500, DT, |i, rollout| {
            if i == tick {
                rollout.set_goal_position(0, [0.65, 0.2, 0.05]).unwrap();
            }
            Coupling::NONE
        });
        let jump = jumped[tick].poses[0].position.a[0] - quiet[tick].poses[0].position.a[0];
        let expected = K * 0.1 * (1.0 - quiet[tick].phase) / 25.0;
        assert!((jump / expected - 1.0).abs() < 1e-9, "{jump} {expected}");
        // Negative control: with x0 reset to the present value the jump would be another one.
        let moved = quiet[tick].poses[0].position.x[0] - plan.start.poses[0].position[0];
        let reset = expected + K * moved * quiet[tick].phase / 25.0;
        separation = separation.max((jump / reset - 1.0).abs());
    }
    assert!(separation > 0.02, "{separation}");
}

#[test]
fn check_3_path_does_not_depend_on_the_course_of_tau() {
    let plan = Plan::golden();
    let primitive = plan.build::<f64>();
    // A fine step, so that only a wrong law and not the integrator could separate the paths.
    let dt = DT / 16.0;
    let ticks = 16 * 1800;
    let reference = run(&primitive, ticks, dt, |_, _| Coupling::NONE);
    let varied = run(&primitive, 2 * ticks, dt, |i, rollout| {
        rollout.set_speed_slew(Some(3.0)).unwrap();
        match i % 4000 {
            0 => rollout.set_duration(&primitive, 9.0).unwrap(),
            1500 => rollout.set_speed(&primitive, 1.3).unwrap(),
            2500 => rollout.pause(),
            3000 => rollout.resume(),
            _ => {}
        }
        Coupling::NONE
    });
    let mut compared = 0;
    let (mut worst, mut worst_turn) = (0.0_f64, 0.0_f64);
    let mut left = 0;
    for row in varied.iter().filter(|row| row.progress < 1.0) {
        while reference[left + 1].progress <= row.progress {
            left += 1;
        }
        let (a, b) = (&reference[left], &reference[left + 1]);
        let w = (row.progress - a.progress) / (b.progress - a.progress);
        for i in 0..3 {
            let x = a.poses[0].position.x[i] + (b.poses[0].position.x[i] - a.poses[0].position.x[i]) * w;
            worst = worst.max((row.poses[0].position.x[i] - x).abs());
        }
        let (q, next) = (&a.poses[0].orientation.quaternion, &b.poses[0].orientation.quaternion);
        let way = q.conjugate().product(next).rotation_vector().map(|r| r * w);
        let planned = q.product(&Quaternion::from_rotation_vector(&way));
        let turned = row.poses[0].orientation.quaternion.conjugate().product(&planned).rotation_vector();
        worst_turn = turned.iter().fold(worst_turn, |worst, r| worst.max(r.abs()));
        compared += 1;
    }
    println!("path over {compared} ticks of varying tau: {worst:.1e} m, {worst_turn:.1e} rad");
    assert!(compared > 20_000);
    // The integrator's own error at this step; what a wrong law does is shown by the negative control below.
    assert!(worst < 2e-5, "{worst:.1e} m");
    assert!(worst_turn < 2e-5, "{worst_turn:.1e} rad");
    // The phase never runs backwards.
    assert!(varied.windows(2).all(|pair| pair[1].phase <= pair[0].phase));
}

/// Where one unforced row with 1 m to go is at half of the progress when tau goes from 5 s to 10 s on the way.
/// `carry` makes the scaled velocity after the change from the one before and the ratio of the two tau.
fn half_way_through_a_slowdown(change: bool, carry: fn(f64, f64) -> f64) -> f64 {
    let canonical = CanonicalSystem::new(ALPHA).unwrap();
    let system = TransformationSystem::<f64>::critically_damped(K).unwrap();
    let (mut phase, mut state) = (Phase::START, PointState::new(0.0, 0.0));
    let dt = DT / 64.0;
    let mut tau = 5.0;
    while phase.progress() < 0.5 {
        if change && tau < 10.0 && phase.progress() >= 0.2 {
            tau = 10.0;
            state = PointState::new(state.x(), carry(state.v(), 2.0));
        }
        let input = PointInput { start: 0.0, goal: 1.0, s: phase.s(), f: 0.0, zeta: 0.0 };
        let rhs = system.right_hand_side(&state, &input);
        state.step(rhs, dt / tau);
        phase.step(&canonical, dt / tau);
    }
    state.x()
}

#[test]
fn check_3_negative_control_rescaled_velocity_leaves_the_path() {
    let undisturbed = half_way_through_a_slowdown(false, |v, _| v);
    let kept = half_way_through_a_slowdown(true, |v, _| v) - undisturbed;
    // v = tau xd: who keeps the physical velocity instead scales v by the ratio of the durations.
    let rescaled = half_way_through_a_slowdown(true, |v, ratio| v * ratio) - undisturbed;
    println!("tau doubled on the way: v kept {kept:.1e} m, v rescaled {rescaled:.1e} m");
    assert!(kept.abs() < 2e-4, "{kept:.1e}");
    assert!(rescaled.abs() > 5e-3, "{rescaled:.1e}");
}

#[test]
fn check_5_antipodal_goal_turns_half_a_radian_and_no_more() {
    let mut plan = Plan::empty();
    plan.goal.poses[0].orientation = Quaternion::from_rotation_vector(&[0.0, 0.0, 0.5]).negated();
    for error in [OrientationError::Quaternion, OrientationError::RotationVector] {
        plan.orientation_error = error;
        let rows = nominal(&plan, 20.0);
        let end = rows.last().unwrap().poses[0].orientation.quaternion;
        let target = Quaternion::from_rotation_vector(&[0.0, 0.0, 0.5]);
        let (missed, path) = (end.aligned_with(&target).conjugate().product(&target).angle(), path_length(&rows));
        println!("{error:?}: path {path:.4} rad, missed by {missed:.1e} rad");
        assert!(missed < 1e-6, "{error:?}: {missed} rad from the goal after {path} rad");
        assert!((path - 0.5).abs() < 1e-3, "{error:?}: path of {path} rad");
    }
    // Negative control: told that the far sign was demonstrated, it goes the long way round.
    plan.orientation_error = OrientationError::RotationVector;
    plan.hemisphere = Hemisphere::Demonstrated;
    assert!(path_length(&nominal(&plan, 20.0)) > 5.0);
}

#[test]
fn check_6_constant_feedback_settles_where_it_should() {
    let mut plan = Plan::empty();
    plan.goal.poses[0].position = [0.1, 0.0, 0.0];
    let primitive = plan.build::<f64>();
    let mut coupling = coupling([10.0, -5.0, 2.0], [20.0, 0.0, 0.0], [0.0, 4.0, 4.0, 4.0]);
    coupling.points[3] = 6.0;
    let rows = run(&primitive, 9000, DT, |_, _| coupling);
    let end = rows.last().unwrap();
    for (i, zeta) in coupling.poses[0].position.iter().enumerate() {
        let settled = plan.goal.poses[0].position[i] + zeta / K;
        assert!((end.poses[0].position.x[i] - settled).abs() < 1e-9, "{} {settled}", end.poses[0].position.x[i]);
    }
    // A finger, and a joint of the posture: every row can be bent.
    assert!((end.points.x[8] - 4.0 / K).abs() < 1e-9, "{}", end.points.x[8]);
    assert!((end.points.x[3] - 6.0 / K).abs() < 1e-9, "{}", end.points.x[3]);
    let turned = end.poses[0].orientation.quaternion.rotation_vector();
    assert!((turned[0] - 2.0 * (20.0_f64 / K).asin()).abs() < 1e-9, "{turned:?}");
    // Negative control: 20/K, the answer for a position row, is half of it.
    assert!((turned[0] - 20.0 / K).abs() > 0.05);
    // No memory: the plan returns when the force vanishes.
    let rows = run(&primitive, 12_000, DT, |i, _| if i < 3000 { coupling } else { Coupling::NONE });
    assert!((rows.last().unwrap().poses[0].position.x[0] - 0.1).abs() < 1e-9);

    // In rotation-vector coordinates the angle is zeta/K itself.
    plan.orientation_error = OrientationError::RotationVector;
    let primitive = plan.build::<f64>();
    let rows = run(&primitive, 9000, DT, |_, _| coupling);
    let turned = rows.last().unwrap().poses[0].orientation.quaternion.rotation_vector();
    assert!((turned[0] - 0.1).abs() < 1e-9, "{turned:?}");
}

#[test]
fn check_6_feedback_on_rotation_vectors_does_the_work_of_the_moment() {
    // A moment zeta (body frame) on the coordinates y: its power is zeta . omega = (J^T zeta) . dy for every motion dy.
    let ends = [[0.3, -0.8, 0.5], [-0.4, 0.2, 0.9]].map(|r| Quaternion::<f64>::from_rotation_vector(&r));
    let chart = LogMap::between(&ends[0], &ends[1]);
    let zeta = [20.0, -7.0, 11.0];
    let dot = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    for y in [[0.0, 0.0, 0.2], [0.9, -0.5, 1.1], [-1.5, 1.2, 0.4]] {
        let mut separation = 0.0_f64;
        for dy in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] {
            // The rate of the orientation itself, from two orientations: independent of the chart's own Jacobian.
            let step = 1e-5;
            let beside = |sign: f64| chart.orientation(&std::array::from_fn(|i| y[i] + sign * step * dy[i]));
            let turn = beside(-1.0).conjugate().product(&beside(1.0)).rotation_vector();
            let power = dot(&zeta, &turn) / (2.0 * step);
            let along = dot(&chart.generalised(&y, &zeta), &dy);
            assert!((power - along).abs() < 1e-6, "at {y:?} along {dy:?}: {power} {along}");
            // Negative control: the Jacobian where its transpose belongs does another work.
            separation = separation.max((dot(&chart.omega(&y, &zeta), &dy) - power).abs());
        }
        assert!(separation > 0.5, "{separation}");
    }
}

#[test]
fn pushes_of_the_environment_move_the_plan_along_and_are_clamped() {
    let k1 = [3.0, 3.0, 2.0, 20.0, 20.0, 15.0, 9.0, 40.0, 40.0, 40.0];
    let feedback = Feedback::<f64>::new(k1, [1.0; SENSORS], limits(0.23, 0.4, 0.3)).unwrap();
    let feedback =
        Feedback { expected: ExpectedWrench::new(&[[0.0; SENSORS], [1.0; SENSORS]], 5.0).unwrap(), ..feedback };
    let mut plan = Plan::empty();
    plan.goal.poses[0].position = [0.1, 0.0, 0.0];
    let primitive = plan.build();
    let push = [4.0, 0.0, 0.0, 0.0, 0.0, 0.3, 0.5, 0.0, 0.0];
    let run = Rollout::start(&primitive, &StartState::demonstrated(&primitive)).unwrap();
    let zeta = feedback.coupling(&run, &primitive, &push).unwrap();
    // The spread has no gauge.
    assert_eq!(zeta, coupling([12.0, 0.0, 0.0], [0.0, 0.0, 4.5], [0.0, 20.0, 0.0, 0.0]));
    // A blow, an infinite and an undefined value stay bounded.
    for blow in [1e6, -1e30, f64::INFINITY, f64::NAN] {
        let zeta = feedback.coupling(&run, &primitive, &[blow; SENSORS]).unwrap();
        let norm = |a: &[f64]| a.iter().map(|a| a * a).sum::<f64>().sqrt();
        assert!(norm(&zeta.poses[0].position) <= K * 0.23 * (1.0 + 1e-12));
        assert!(norm(&zeta.poses[0].orientation) <= K * 0.2_f64.sin() * (1.0 + 1e-12));
        assert!(zeta.points.iter().all(|z| z.abs() <= K * 0.3));
    }
}

#[test]
fn feedback_fades_when_the_speed_differs_from_the_recording() {
    let expected = ExpectedWrench::new(&[[0.0_f64; SENSORS]], 5.0).unwrap();
    assert_eq!(expected.trust(1.0), 1.0);
    assert_eq!(expected.trust(1.0 / 1.05), 1.0);
    assert!((expected.trust(1.0 / 1.3) - 0.5).abs() < 1e-9);
    for speed in [0.0, 0.5, 3.0] {
        assert_eq!(expected.trust(speed), 0.0);
    }
}

fn norm_after_a_million_ticks<T: Scalar>(error: OrientationError) -> f64 {
    let mut plan = Plan::golden();
    plan.orientation_error = error;
    plan.duration = 3000.0;
    let primitive = plan.build::<T>();
    let mut rollout = Rollout::start(&primitive, &StartState::demonstrated(&primitive)).unwrap();
    let dt = T::from_f64(DT);
    // A feedback beyond the equilibrium keeps the orientation spinning all the time.
    let spin = coupling([T::ZERO; 3], [300_000.0, 200_000.0, -100_000.0].map(T::from_f64), [T::ZERO; 4]);
    let mut worst = 0.0_f64;
    for _ in 0..1_000_000 {
        let q = rollout.step(&primitive, dt, &spin).unwrap().poses[0].orientation.quaternion;
        worst = worst.max((q.dot(&q).to_f64().sqrt() - 1.0).abs());
    }
    worst
}

#[test]
fn check_9_quaternion_stays_unit_over_a_million_ticks() {
    let (double, single) = (
        norm_after_a_million_ticks::<f64>(OrientationError::Quaternion),
        norm_after_a_million_ticks::<f32>(OrientationError::Quaternion),
    );
    println!("norm after 1e6 ticks: f64 {double:.1e}, f32 {single:.1e}");
    assert!(double < 1e-14, "f64 {double:.1e}");
    assert!(single < 2e-7, "f32 {single:.1e}");
}

#[test]
fn check_9_negative_control_the_norm_runs_away_where_the_step_is_another() {
    // The turn of the check above per tick, in single precision, by two steps that are not the library's.
    let turn = [0.016_f32, 0.01, -0.005];
    let exact = Quaternion::from_rotation_vector(&turn);
    // Explicit Euler: q + q (x) (0, turn)/2.
    let euler = Quaternion::from_parts(1.0, turn.map(|r| 0.5 * r));
    let largest_error = |factor: &Quaternion<f32>, ticks: usize| {
        let mut q = Quaternion::<f32>::from_rotation_vector(&[0.3, -0.2, 0.5]);
        let mut worst = 0.0_f32;
        for _ in 0..ticks {
            q = q.product(factor);
            worst = worst.max((q.dot(&q).sqrt() - 1.0).abs());
        }
        worst
    };
    let (drift, growth) = (largest_error(&exact, 1_000_000), largest_error(&euler, 10_000));
    println!("norm in f32: not renormalised {drift:.1e} after 1e6 ticks, explicit Euler {growth:.1e} after 1e4");
    assert!(drift > 1e-5, "{drift:.1e}");
    assert!(growth > 0.1, "{growth:.1e}");
}

#[test]
fn check_10_reported_rates_are_the_derivatives_of_the_reported_path() {
    // tau = 2.7 and varying, both orientation systems, everything moving.
    for error in [OrientationError::Quaternion, OrientationError::RotationVector] {
        let mut plan = Plan::golden();
        plan.duration = 2.7;
        plan.orientation_error = error;
        plan.start_velocity = velocity([0.1, -0.05, 0.02], [0.2, 0.1, -0.3], [0.0; 7], [0.0; 4]);
        let primitive = plan.build::<f64>();
        let dt = DT / 64.0;
        let rows = run(&primitive, 64 * 900, dt, |i, rollout| {
            rollout.set_speed_slew(Some(0.5)).unwrap();
            if i == 64 * 200 {
                rollout.set_duration(&primitive, 4.0).unwrap();
            }
            Coupling::NONE
        });
        assert_eq!(rows[0].poses[0].position.v, plan.start_velocity.poses[0].linear);
        for i in 0..3 {
            let w = rows[0].poses[0].orientation.omega[i] - plan.start_velocity.poses[0].angular[i];
            assert!(w.abs() < 1e-12, "{error:?}: {w}");
        }
        let (mut v, mut a, mut w, mut dw) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
        for k in 1..rows.len() - 1 {
            let (before, now, after) = (&rows[k - 1], &rows[k], &rows[k + 1]);
            // Where the slewing of the speed begins or ends the velocity has a corner and no derivative.
            if (after.rate - 2.0 * now.rate + before.rate).abs() > 1e-12 {
                continue;
            }
            for i in 0..3 {
                let x = |row: &Sample| row.poses[0].position.x[i];
                let rate = |row: &Sample| row.poses[0].position.v[i];
                v = v.max(((x(after) - x(before)) / (2.0 * dt) - rate(now)).abs());
                a = a.max(((rate(after) - rate(before)) / (2.0 * dt) - now.poses[0].position.a[i]).abs());
                let omega = |row: &Sample| row.poses[0].orientation.omega[i];
                dw = dw.max(((omega(after) - omega(before)) / (2.0 * dt) - now.poses[0].orientation.domega[i]).abs());
            }
            let (q0, q1) = (before.poses[0].orientation.quaternion, after.poses[0].orientation.quaternion);
            let turn = q0.conjugate().product(&q1).rotation_vector();
            for (turn, omega) in turn.iter().zip(&now.poses[0].orientation.omega) {
                w = w.max((turn / (2.0 * dt) - omega).abs());
            }
        }
        println!("{error:?}: dx {v:.1e} m/s, dv {a:.1e} m/s^2, dq {w:.1e} rad/s, domega {dw:.1e} rad/s^2");
        assert!(v < 2e-4 && w < 5e-4, "{v} {w}");
        assert!(a < 0.02 && dw < 0.02, "{a} {dw}");
    }
}

#[test]
fn world_rates_turn_with_the_hand() {
    let rows = nominal(&Plan::golden(), 4.0);
    let dt = DT;
    for k in (100..1000).step_by(50) {
        let (a, b) = (&rows[k - 1].poses[0].orientation.quaternion, &rows[k + 1].poses[0].orientation.quaternion);
        // World rates from q(t): log(b (x) conj(a)).
        let world = b.product(&a.conjugate()).rotation_vector().map(|r| r / (2.0 * dt));
        let reported = rows[k].poses[0].orientation.omega_world();
        for i in 0..3 {
            assert!((world[i] - reported[i]).abs() < 5e-3, "{world:?} {reported:?}");
        }
    }
    // Negative control: the body rates are another vector.
    let row = &rows[600].poses[0].orientation;
    let difference: f64 = row.omega.iter().zip(row.omega_world()).map(|(a, b)| (a - b).abs()).sum();
    assert!(difference > 0.05);
}

#[test]
fn a_plan_that_settles_stays_where_its_feedback_has_bent_it() {
    for error in [OrientationError::Quaternion, OrientationError::RotationVector] {
        // Without forcing: at rest at its end, as a fitted plan is.
        let (start, goal) = (Plan::golden().start, Plan::golden().goal);
        let primitive = Plan { orientation_error: error, start, goal, ..Plan::empty() }.build::<f64>();
        let bent = coupling([6.0, -4.0, 3.0], [20.0, 10.0, -15.0], [0.0, 40.0, 40.0, 40.0]);
        let ticks = (primitive.duration() * 300.0) as usize;
        let play = |settles: bool| {
            run(&primitive, 4 * ticks, DT, |tick, rollout| {
                if settles && tick == ticks {
                    rollout.settle();
                }
                if tick < ticks { bent } else { Coupling::NONE }
            })
        };
        let (kept, freed) = (play(true), play(false));
        let (at_end, settled, sprung) = (&kept[ticks], &kept[4 * ticks - 1], &freed[4 * ticks - 1]);
        let apart = |a: &Sample, b: &Sample| {
            let way = (0..3).map(|i| (a.poses[0].position.x[i] - b.poses[0].position.x[i]).powi(2)).sum::<f64>().sqrt();
            let turn =
                a.poses[0].orientation.quaternion.conjugate().product(&b.poses[0].orientation.quaternion).angle();
            (way, turn, (a.points.x[8] - b.points.x[8]).abs())
        };
        let (way, turn, finger) = apart(at_end, settled);
        assert!(way < 1e-3 && turn < 1e-2 && finger < 1e-3, "{error:?}: {way} m, {turn} rad, {finger} rad");
        // Negative control: without it the plan springs back to its goal.
        let (way, turn, finger) = apart(at_end, sprung);
        assert!(way > 0.03 && turn > 0.05 && finger > 0.1, "{error:?}: {way} m, {turn} rad, {finger} rad");
    }
}

#[test]
fn b10_the_progress_of_a_day_of_ticks_is_exact_to_the_last_place() {
    // 24 h at 300 Hz as one movement. A plain sum in f32 goes up to a third faster or slower than the clock on the way.
    const HOUR: u32 = 3600 * 300;
    let system = CanonicalSystem::new(4.605_f32).unwrap();
    let h = 1.0 / (24 * HOUR) as f32;
    let mut phase = Phase::START;
    for hour in 1..=24 {
        for _ in 0..HOUR {
            phase.step(&system, h);
        }
        let off = (f64::from(phase.progress()) - f64::from(h) * f64::from(hour * HOUR)).abs();
        assert!(off <= f64::from(f32::EPSILON), "after {hour} h: {off:e}");
    }
}
