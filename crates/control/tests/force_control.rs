//! Eq (12): golden vectors, the two sign checks, and what they look like with the wrong sign.

use control::Real;
use control::law::ForceController;
use control::units::Vector6;
use pinned_init::InPlaceWrite;

const AXES: [&str; 6] = ["fx", "fy", "fz", "tx", "ty", "tz"];

/// Period of the vectors (s): they are of 300 Hz.
const PERIOD: f64 = 1.0 / 300.0;

/// A controller with an empty window of 60 control periods.
fn controller<R: Real>() -> Box<ForceController<R>> {
    let Ok(controller) = Box::new_uninit().write_init(ForceController::init(60));
    controller
}

/// Largest deviation of the command and of the joint torques from the golden vectors, relative to their peaks.
fn deviation<R: Real>() -> (f64, f64)
where
    f64: From<R>,
{
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/vectors/dmp_force_pi.csv");
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_path(path).expect("golden vectors exist");
    let header = reader.headers().expect("a header").clone();
    let column = |name: String| header.iter().position(|field| field == name).expect("a column");
    let columns = |prefix: &str| AXES.map(|axis| column(format!("{prefix}_{axis}")));
    let (expected, measured, command) = (columns("Fdes"), columns("F"), columns("u"));
    let torque = [0, 1, 2, 3, 4, 5, 6].map(|joint| column(format!("tau{joint}")));
    // J[a][b] = c_a sin(0.7 a + 1.3 b + 0.2), as the file's header gives it.
    let jacobian = control::model::Jacobian(nalgebra::SMatrix::<R, 6, 7>::from_fn(|a, b| {
        let scale = if a < 3 { 0.6 } else { 1.0 };
        R::constant(scale * (0.7 * a as f64 + 1.3 * b as f64 + 0.2).sin())
    }));
    let mut controller = controller::<R>();
    let (mut worst, mut peak) = ([0.0f64; 2], [0.0f64; 2]);
    let mut rows = 0;
    for record in reader.records() {
        let record = record.expect("a row");
        let number = |index: usize| record[index].parse::<f64>().expect("a number");
        let error =
            Vector6::from_fn(|axis, _| R::constant(number(expected[axis])) - R::constant(number(measured[axis])));
        let u = controller.command(&error, R::constant(1.0), R::constant(2.0), R::constant(PERIOD), false);
        let tau = jacobian.transpose_times(&u);
        let mut compare = |which: usize, computed: f64, golden: f64| {
            worst[which] = worst[which].max((computed - golden).abs());
            peak[which] = peak[which].max(golden.abs());
        };
        for axis in 0..6 {
            compare(0, u[axis].into(), number(command[axis]));
        }
        for (computed, column) in tau.iter().zip(torque) {
            compare(1, (*computed).into(), number(column));
        }
        rows += 1;
    }
    assert_eq!(rows, 900);
    (worst[0] / peak[0], worst[1] / peak[1])
}

#[test]
fn golden_force_pi_in_both_precisions() {
    let (command, torque) = deviation::<f64>();
    println!("f64: command {command:e}, torque {torque:e} of the peak");
    assert!(command <= 1e-12 && torque <= 1e-12);
    let (command, torque) = deviation::<f32>();
    println!("f32: command {command:e}, torque {torque:e} of the peak");
    assert!(command <= 2e-5 && torque <= 2e-5);
}

#[test]
fn check_8_unit_step_starts_at_one_step_of_the_integral_ramps_and_stays() {
    let mut controller = controller::<f64>();
    let step = Vector6::from([1.0; 6]);
    let integral = 2.0;
    for tick in 0..200 {
        let u = controller.command(&step, 1.0, integral, PERIOD, false)[0];
        let expected = -(1.0 + integral * PERIOD * f64::min(f64::from(tick + 1), 60.0));
        assert!((u - expected).abs() < 1e-12, "tick {tick}: {u} {expected}");
    }
    // Frozen, the window stays; the proportional part does not.
    let u = controller.command(&Vector6::zeros(), 1.0, integral, PERIOD, true)[0];
    assert!((u + integral * 0.2).abs() < 1e-12, "{u}");
}

/// A mass that may touch a wall of 5 kN/m at x = 0, moved by Eq (12) alone with the mandatory filter on F (one pole,
/// coefficient 0.5). Returns force (environment on robot) and position after 10 s.
fn against_the_wall(sign: f64) -> (f64, f64) {
    let (mass, damping, wall, expected) = (3.0, 60.0, 5000.0, -10.0);
    let mut controller = controller::<f64>();
    let (mut x, mut v, mut measured) = (1e-3, 0.0, 0.0);
    for _ in 0..3000 {
        let force = if x > 0.0 { -wall * x } else { 0.0 };
        measured += 0.5 * (force - measured);
        let error = Vector6::new(expected - measured, 0.0, 0.0, 0.0, 0.0, 0.0);
        let command = sign * controller.command(&error, 1.0, 2.0, PERIOD, false)[0];
        for _ in 0..20 {
            let dt = PERIOD / 20.0;
            let force = if x > 0.0 { -wall * x } else { 0.0 };
            v += dt * (command + force - damping * v) / mass;
            x += dt * v;
        }
    }
    (if x > 0.0 { -wall * x } else { 0.0 }, x)
}

#[test]
fn check_7_contact_with_a_wall_settles_at_the_share_the_window_allows() {
    let (force, _) = against_the_wall(1.0);
    let gain = 1.0 + 2.0 * 0.2;
    let expected = -10.0 * gain / (1.0 + gain);
    assert!((force - expected).abs() < 1e-3, "{force} {expected}");
    assert!((force + 5.833).abs() < 1e-3);
}

#[test]
fn check_7_negative_control_a_flipped_sign_leaves_the_wall_for_good() {
    let (force, x) = against_the_wall(-1.0);
    assert!(force == 0.0 && x < -0.5, "{force} {x}");
}

#[test]
fn the_window_does_not_drift_over_an_hour() {
    let mut controller = controller::<f32>();
    let mut state = 1u32;
    for _ in 0..300 * 3600 {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let error = (state >> 8) as f32 / 16_777_216.0 * 100.0 - 50.0;
        controller.command(&Vector6::from([error; 6]), 1.0, 2.0, PERIOD as f32, false);
    }
    let mut u = 0.0;
    for _ in 0..60 {
        u = controller.command(&Vector6::zeros(), 1.0, 2.0, PERIOD as f32, false)[0];
    }
    assert!(u.abs() < 1e-5, "{u}");
}
