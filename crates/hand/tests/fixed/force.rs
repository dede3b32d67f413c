//! Eq (14) from counts to torque in fixed point against the arm's code in f64.

use control::HandSample;
use control::law::{Gains, HandController as ExactController};
use control::plan::HandReference as ExactReference;
use control::sense::HandEstimator as ExactEstimator;
use dmp::Scalar;
use hand::controller::{HandController, HandReference};
use hand::estimate::{HandEstimator, gauge_torque};
use hand::number::{Number, from_real};
use pinned_init::InPlaceWrite;
use puck::Counts;

use crate::common::Random;

/// Full scale of a finger's drive, N m.
const FULL_SCALE: f64 = control::model::FINGER_TORQUE_MAX;

#[test]
fn gauge_curve_matches_f64_for_every_reading() {
    let worst = (0..=4095_u16)
        .map(|counts| {
            let exact: f64 = -puck::gauge::torque(f64::from(counts));
            (gauge_torque(counts).to_f64() - exact).abs()
        })
        .fold(0.0, f64::max);
    println!("gauge: {worst:.1e} N m");
    assert!(worst < 1e-8, "{worst:e}");
}

/// The hand as its pucks tell it, closing on something.
fn sample(tick: i32, random: &mut Random) -> HandSample {
    let closed = f64::from(tick.min(900)) / 900.0;
    let motor = (closed * 150_000.0) as i32;
    let grip = (2000.0 + 900.0 * (closed - 0.6).max(0.0) / 0.4 + 6.0 * random.unit()) as u16;
    let lost = random.bits().is_multiple_of(50);
    let primary = [motor, motor + 37, motor - 90, motor / 9].map(|counts| (!lost).then_some(Counts(counts).wrapped()));
    let secondary = [motor * 2 / 5, motor * 2 / 5 + 11, motor * 2 / 5 - 30];
    HandSample {
        primary,
        secondary: secondary.map(|counts| (!lost).then_some(Counts(counts).wrapped())),
        gauges: [Some(grip), Some(grip + 40), (!random.bits().is_multiple_of(40)).then_some(grip - 25)],
    }
}

#[test]
fn force_and_position_control_are_within_one_percent_of_full_scale_of_f64() {
    let gains = Gains::<f64>::tuned().hand;
    let mut exact_estimator = ExactEstimator::<f64>::new();
    let Ok(mut exact) = Box::new_uninit().write_init(ExactController::init(&gains));
    let mut estimator = HandEstimator::new();
    let mut controller = HandController::new();
    let mut random = Random(7);
    let (mut worst, mut worst_angle, mut worst_force) = (0.0_f64, 0.0_f64, 0.0_f64);
    for tick in 0..3000 {
        let told = sample(tick, &mut random);
        let (Some(wanted), Some(found)) = (exact_estimator.update(Some(&told)), estimator.update(Some(&told))) else {
            continue;
        };
        if tick == 100 {
            exact_estimator.tare();
            estimator.tare();
        }
        let plan = 1.9 * (f64::from(tick) / 900.0).min(1.0);
        let speed = if tick < 900 { 1.9 / 3.0 } else { 0.0 };
        let exact_reference = ExactReference { q: [0.2, plan, plan, plan], dq: [0.0, speed, speed, speed] };
        let reference =
            HandReference { q: exact_reference.q.map(Number::from_f64), dq: exact_reference.dq.map(Number::from_f64) };
        let expected = [-0.2, -0.25, -0.3];
        let frozen = tick % 70 == 0;
        let torque = exact.torque(&gains, &wanted, &exact_reference, Some(&expected), frozen);
        let fixed = controller.torque(&found, &reference, Some(&expected.map(|e| from_real(e as f32))), frozen);
        for digit in 0..4 {
            worst = worst.max((fixed[digit].to_f64() - torque[digit]).abs());
            worst_angle = worst_angle.max((found.q[digit].to_f64() - wanted.q[digit]).abs());
        }
        for finger in 0..3 {
            worst_force = worst_force.max((found.gauges[finger].to_f64() - wanted.gauges[finger]).abs());
        }
    }
    println!(
        "against f64 over 10 s: torque {worst:.1e} N m ({:.5} % of full scale), angle {worst_angle:.1e} rad, gauge {worst_force:.1e} N m",
        100.0 * worst / FULL_SCALE
    );
    assert!(worst <= 0.01 * FULL_SCALE, "{worst:e}");
    assert!(worst <= 1e-5, "what is measured is a thousand times better than the bound: {worst:e}");
}
