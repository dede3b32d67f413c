//! Trajectories in fixed point against the same equations in f64, and against the golden vectors.

use control::plan::primitive::StartState;
use dmp::Scalar;
use hand::number::{Number, ONE, ZERO, from_real};
use hand::{Rollout, forcing};

use crate::common::Movement;

/// The bound of the issue, rad.
const BOUND: f64 = 5e-4;

/// Largest difference of position (rad) and velocity (rad/s) over the movement and half as long again.
fn error(movement: &Movement, speed: f64, gauges: impl Fn(f64) -> [f64; 3]) -> [f64; 2] {
    let (fixed, sensed) = (movement.fixed(), movement.exact());
    let exact = sensed.movement();
    let mut reference = dmp::Rollout::start(exact, &StartState::demonstrated(exact)).expect("a start");
    let mut rollout = Rollout::demonstrated(&fixed);
    reference.set_speed(exact, speed).expect("a speed");
    assert!(rollout.set_speed(&fixed, Number::from_f64(speed)));
    let mut worst = [0.0_f64; 2];
    let ticks = (1.5 * f64::from(movement.duration) / speed * control::RATE) as usize;
    for tick in 0..ticks {
        let measured = gauges(tick as f64 / control::RATE);
        let mut error = [0.0; 9];
        if let Some(expected) = sensed.expected() {
            let expected = expected.at(reference.progress());
            (0..3).for_each(|finger| error[6 + finger] = measured[finger] - expected[6 + finger]);
        }
        let coupling = sensed.coupling(&reference, &error).expect("its own");
        let wanted = reference.step(exact, control::PERIOD, &coupling).expect("its own");
        let zeta = rollout.feedback(&fixed, &measured.map(|torque| from_real(torque as f32)), ONE);
        let found = rollout.step(&fixed, &zeta);
        for digit in 0..4 {
            worst[0] = worst[0].max((found.q[digit].to_f64() - wanted.points.x[7 + digit]).abs());
            worst[1] = worst[1].max((found.dq[digit].to_f64() - wanted.points.v[7 + digit]).abs());
        }
    }
    worst
}

#[test]
fn trajectories_stay_within_the_bound_of_those_in_f64() {
    let mut largest = 0.0_f64;
    println!("duration kernels speed   position       velocity");
    for duration in [0.5, 2.0, 5.0, 12.0, 60.0, 120.0] {
        for kernels in [3, 20, 50, 100] {
            let speed = if kernels == 20 { 0.5 } else { 1.0 };
            let [x, v] = error(&Movement::closing(kernels, duration, 0.4), speed, |_| [0.0; 3]);
            println!("{duration:>6} s {kernels:>7} {speed:>5}   {x:.1e} rad   {v:.1e} rad/s");
            largest = largest.max(x);
        }
    }
    println!("largest {largest:.2e} rad");
    assert!(largest <= BOUND, "{largest:e}");
}

#[test]
fn feedback_bends_the_plan_as_in_f64() {
    let felt = |t: f64| {
        let push = -0.3 * (t - 1.5).clamp(0.0, 1.0);
        [push, 0.8 * push, 0.5 * push]
    };
    for (speed, duration) in [(1.0, 4.0), (0.7, 4.0), (1.4, 4.0)] {
        let movement = Movement::closing(50, duration, 0.4).feeling();
        let [x, _] = error(&movement, speed, felt);
        println!("feedback at speed {speed}: {x:.1e} rad");
        assert!(x <= BOUND, "{x:e}");
        let [free, _] = error(&Movement { k1: Vec::new(), k2: Vec::new(), ..movement }, speed, felt);
        assert!(free <= BOUND);
    }
}

#[test]
fn wide_weights_early_kernels_and_moving_starts_stay_within_the_bound() {
    let mut movement = Movement::closing(30, 3.0, 8.0);
    movement.start_velocity = [0.2, -0.5, 0.4, 0.3];
    movement.activation = 0.9;
    let [x, _] = error(&movement, 1.0, |_| [0.0; 3]);
    println!("weights up to 8 rad, activation 0.9: {x:.1e} rad");
    assert!(x <= BOUND, "{x:e}");
    movement.activation = 0.1;
    movement.alpha = 9.0;
    let [x, _] = error(&movement, 1.0, |_| [0.0; 3]);
    println!("activation 0.1, alpha 9: {x:.1e} rad");
    assert!(x <= BOUND, "{x:e}");
}

#[test]
fn forcing_term_matches_f64_everywhere() {
    for (kernels, alpha, activation) in
        [(100, 4.605, 0.7), (50, 2.3, 0.95), (7, 13.82, 0.5), (100, 6.9, 0.05), (4, 4.605, 0.7), (2, 4.605, 0.7)]
    {
        let canonical = dmp::CanonicalSystem::new(alpha).expect("alpha");
        let exact = dmp::Basis::<f64, 100>::new(&canonical, kernels, activation).expect("a basis");
        let Some(basis) = forcing::Basis::new(kernels, alpha, activation) else {
            panic!("{kernels} kernels, alpha {alpha}, activation {activation}: refused");
        };
        let rows: Vec<f32> = (0..4 * kernels).map(|i| (0.9 * i as f32).sin()).collect();
        let mut weights = [[0; 4]; 100];
        for (i, value) in rows.iter().enumerate() {
            weights[i % kernels][i / kernels] = forcing::weight(*value).expect("small");
        }
        let mut doubles = vec![0.0; 0];
        doubles.extend(rows.iter().map(|value| f64::from(*value)));
        let term = dmp::ForcingTerm::<f64, 4, 100>::new(exact, &doubles).expect("weights");
        let mut worst = 0.0_f64;
        for step in 0..3000 {
            let u = step as f64 / 2000.0;
            let wanted = term.evaluate(canonical.phase_at(u));
            let found = forcing::evaluate(&basis, &weights, Number::from_f64(u));
            for row in 0..4 {
                worst = worst.max((found[row].to_f64() - wanted[row]).abs());
            }
        }
        println!("f(s), {kernels} kernels, alpha {alpha}, activation {activation}: {worst:.1e}");
        assert!(worst < 2e-5, "{worst:e}");
    }
}

#[test]
fn bases_that_the_integers_cannot_hold_are_refused() {
    assert!(forcing::Basis::new(2, 13.8, 0.7).is_none(), "kernels that reach farther than a ratio can tell");
    assert!(forcing::Basis::new(101, 4.6, 0.7).is_none());
    assert!(forcing::Basis::new(1, 4.6, 0.7).is_none());
    assert!(forcing::Basis::new(50, f64::NAN, 0.7).is_none());
}

/// Columns of a golden table.
fn golden<const D: usize>(name: &str, columns: [&str; D]) -> Vec<(usize, [f64; D])> {
    let path = format!(concat!(env!("CARGO_MANIFEST_DIR"), "/../dmp/tests/vectors/{}.csv"), name);
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_path(path).expect("a golden table");
    let header = reader.headers().expect("a header").clone();
    let place = |column: &str| header.iter().position(|name| name == column).unwrap_or_else(|| panic!("no {column}"));
    let (time, places) = (place("t"), columns.map(place));
    reader
        .records()
        .map(|record| {
            let record = record.expect("a row");
            let number = |at: usize| record[at].parse::<f64>().unwrap_or(f64::NAN);
            ((number(time) * 300.0).round() as usize, places.map(number))
        })
        .collect()
}

#[test]
fn golden_finger_rows_are_followed() {
    let mut movement = Movement::closing(50, 5.0, 0.0);
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../dmp/tests/vectors/dmp_theta.csv");
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_path(path).expect("weights");
    let rows: Vec<Vec<f32>> = reader
        .records()
        .map(Result::unwrap)
        .filter(|record| &record[0] == "fing")
        .map(|record| record.iter().skip(2).map(|value| value.parse().expect("a weight")).collect())
        .collect();
    assert_eq!(rows.len(), 4, "one row per digit");
    movement.weights = std::array::from_fn(|row| rows[row].clone());
    movement.start = [0.0; 4];
    movement.goal = [0.3, 2.1, 2.1, 2.1];
    let primitive = movement.fixed();
    let forces = golden("dmp_coupling_force", ["z7", "z8", "z9"]);
    for (name, coupled) in [("dmp_nocoupling", false), ("dmp_coupling", true)] {
        let wanted = golden(name, ["f1_e", "f2_e", "f3_e"]);
        let mut rollout = Rollout::demonstrated(&primitive);
        let (mut tick, mut worst) = (0, 0.0_f64);
        for (at, angles) in wanted {
            loop {
                let zeta = match forces.get(tick).filter(|_| coupled) {
                    Some((_, zeta)) => zeta.map(Number::from_f64),
                    None => [ZERO; 3],
                };
                let plan = rollout.step(&primitive, &zeta);
                tick += 1;
                if tick > at {
                    for (q, angle) in plan.q.iter().skip(1).zip(angles) {
                        worst = worst.max((q.to_f64() - angle).abs());
                    }
                    break;
                }
            }
        }
        println!("{name}: {worst:.1e} rad");
        assert!(worst <= 1e-5, "{worst:e}");
    }
}

#[test]
fn a_flipped_sign_of_the_feedback_is_seen() {
    // Negative control of the comparison above: it is not so coarse that a wrong sign would pass.
    let movement = Movement::closing(50, 4.0, 0.4).feeling();
    let primitive = movement.fixed();
    let run = |sign: f64| {
        let mut rollout = Rollout::demonstrated(&primitive);
        for _ in 0..900 {
            let zeta = rollout.feedback(&primitive, &[Number::from_f64(sign * 0.2); 3], ONE);
            rollout.step(&primitive, &zeta);
        }
        rollout.step(&primitive, &[ZERO; 3]).q[1].to_f64()
    };
    assert!((run(1.0) - run(-1.0)).abs() > 100.0 * BOUND);
    assert!(run(1.0) > run(-1.0), "a torque that opens less lets the plan close further");
}
