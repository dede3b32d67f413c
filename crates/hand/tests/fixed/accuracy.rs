//! Trajectories in fixed point against the same equations in f64, and against the golden vectors.

use control::plan::primitive::StartState;
use dmp::Scalar;
use hand::number::{Number, ZERO, from_real};

use crate::common::{Movement, demonstrated, step};

/// The bound of the issue, rad.
const BOUND: f64 = 5e-4;

/// Control rate of the golden vectors (Hz), whatever that of the device is.
const GOLDEN_RATE: f64 = 300.0;

/// Largest difference of position (rad) and velocity (rad/s) over the movement and half as long again.
fn error(movement: &Movement, speed: f64, gauges: impl Fn(f64) -> [f64; 3]) -> [f64; 2] {
    let (fixed, sensed) = (movement.fixed(), movement.exact());
    let exact = sensed.movement();
    let mut reference = dmp::Rollout::start(exact, &StartState::demonstrated(exact)).expect("a start");
    let mut rollout = demonstrated(fixed.movement());
    reference.set_speed(exact, speed).expect("a speed");
    rollout.set_speed(fixed.movement(), Number::from_f64(speed)).expect("a speed");
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
        let found = step(&fixed, &mut rollout, &measured.map(|torque| from_real(torque as f32)));
        for digit in 0..4 {
            worst[0] = worst[0].max((found.x[digit].to_f64() - wanted.points.x[7 + digit]).abs());
            worst[1] = worst[1].max((found.v[digit].to_f64() - wanted.points.v[7 + digit]).abs());
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
    let measured = |t: f64| {
        let push = -0.3 * (t - 1.5).clamp(0.0, 1.0);
        [push, 0.8 * push, 0.5 * push]
    };
    for (speed, duration) in [(1.0, 4.0), (0.7, 4.0), (1.4, 4.0)] {
        let movement = Movement::closing(50, duration, 0.4).feeling();
        let [x, _] = error(&movement, speed, measured);
        println!("feedback at speed {speed}: {x:.1e} rad");
        assert!(x <= BOUND, "{x:e}");
        let [free, _] = error(&Movement { k1: Vec::new(), k2: Vec::new(), ..movement }, speed, measured);
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
            ((number(time) * GOLDEN_RATE).round() as usize, places.map(number))
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
    let period = Number::constant(1.0 / GOLDEN_RATE);
    let movement = movement.fixed_at(period);
    let forces = golden("dmp_coupling_force", ["z7", "z8", "z9"]);
    for (name, coupled) in [("dmp_nocoupling", false), ("dmp_coupling", true)] {
        let wanted = golden(name, ["f1_e", "f2_e", "f3_e"]);
        let mut rollout = demonstrated(&movement);
        let (mut tick, mut worst) = (0, 0.0_f64);
        for (at, angles) in wanted {
            loop {
                let zeta = match forces.get(tick).filter(|_| coupled) {
                    Some((_, [z1, z2, z3])) => [0.0, *z1, *z2, *z3].map(Number::from_f64),
                    None => [ZERO; 4],
                };
                let coupling = dmp::Coupling { poses: [], points: zeta };
                let plan = rollout.step(&movement, period, &coupling).expect("its own").points;
                tick += 1;
                if tick > at {
                    for (q, angle) in plan.x.iter().skip(1).zip(angles) {
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
        let mut rollout = demonstrated(primitive.movement());
        for _ in 0..900 {
            step(&primitive, &mut rollout, &[Number::from_f64(sign * 0.2); 3]);
        }
        step(&primitive, &mut rollout, &[ZERO; 3]).x[1].to_f64()
    };
    assert!((run(1.0) - run(-1.0)).abs() > 100.0 * BOUND);
    assert!(run(1.0) > run(-1.0), "a torque that opens less lets the plan close further");
}
