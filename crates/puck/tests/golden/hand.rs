//! Hand conversions and commands against the golden vectors.

use crate::vectors::{Row, can_id, payload, rows};
use puck::hand::{HandCommander, HandError, angles, finger_counts};
use puck::{CanFrame, Counts, PropertyTable};

fn commander() -> HandCommander {
    HandCommander::new(&PropertyTable::motor(175).expect("a known firmware")).expect("a hand firmware")
}

fn frames(row: &Row) -> Vec<CanFrame> {
    let frame = |text: &str| {
        let (id, data) = text.split_once('#').expect("id#data");
        CanFrame::from_slice(can_id(id), &payload(data)).expect("a frame")
    };
    row.text("frames").split(" | ").map(frame).collect()
}

#[test]
fn every_hand_command_equals_the_vectors() {
    let commander = commander();
    for row in rows("hand_command") {
        let q: [f64; 4] = row.numbers("q", 1);
        let sent = match row.text("op") {
            "trapezoidalMove" => commander.trapezoidal_move(&q).expect("finite").to_vec(),
            "velocityMove" => commander.velocity_move(&q).expect("finite").to_vec(),
            "setPositionCommand" => commander.positions(&q).expect("finite").to_vec(),
            "setTorqueCommand" => vec![commander.torques(&q, &[20_000; 4]).expect("finite")],
            other => panic!("{}: unknown operation {other}", row.at()),
        };
        assert_eq!(sent, frames(&row), "{}", row.at());
    }
}

#[test]
fn not_a_number_never_becomes_a_hand_command() {
    let bad = [0.0, f64::NAN, 0.0, 0.0];
    assert_eq!(commander().positions(&bad), Err(HandError::NotFinite));
    assert_eq!(commander().velocity_move(&bad), Err(HandError::NotFinite));
    assert_eq!(commander().trapezoidal_move(&bad), Err(HandError::NotFinite));
    assert_eq!(commander().torques(&bad, &[20_000; 4]), Err(HandError::NotFinite));
}

/// A reply that failed often ends as 0 or -1: no torque, or one that opens where it should close.
#[test]
fn a_scale_that_is_not_positive_is_refused_with_its_digit() {
    for (digit, scale) in [(0, 0), (3, -1), (1, i32::MIN)] {
        let mut scales = [20_000; 4];
        scales[digit] = scale;
        let refused = HandError::UnitsPerNewtonMetre { digit };
        assert_eq!(commander().torques(&[0.1; 4], &scales), Err(refused));
        assert!(refused.to_string().contains("IPNM"));
    }
}

/// V has 16 bits on the puck: 403 rad/s of a finger would arrive as a velocity the other way.
#[test]
fn a_velocity_that_its_property_cannot_hold_is_refused() {
    for beyond in [403.0, -403.0, 1e30, f64::from(f32::MAX)] {
        assert_eq!(commander().velocity_move(&[0.0, 0.0, beyond, 0.0]), Err(HandError::Range), "{beyond}");
        assert_eq!(commander().velocity_move(&[0.0, 0.0, beyond as f32, 0.0]), Err(HandError::Range), "{beyond}");
    }
    assert!(commander().velocity_move(&[402.0, -402.0, 0.0, 2800.0]).is_ok());
    assert!(HandError::Range.to_string().contains("16 bits"));
}

#[test]
fn hand_angles_equal_the_vectors() {
    for row in rows("hand_position") {
        let primary = row.numbers::<i32, 4>("m", 1).map(Counts);
        let secondary = std::array::from_fn(|finger| match row.text(&format!("s{}", finger + 1)) {
            "none" => None,
            counts => Some(Counts(counts.parse().expect("counts"))),
        });
        let expected =
            (row.numbers::<f64, 3>("inner", 1), row.numbers::<f64, 3>("outer", 1), row.number::<f64>("spread"));
        let double = angles::<f64>(&primary, &secondary);
        let single = angles::<f32>(&primary, &secondary);
        let close = |got: f64, expected: f64, bound: f64| {
            assert!((got - expected).abs() <= bound, "{}: {got} is not {expected}", row.at());
        };
        for finger in 0..3 {
            close(double.inner[finger], expected.0[finger], 1e-12);
            close(double.outer[finger], expected.1[finger], 1e-12);
            close(single.inner[finger].into(), expected.0[finger], 5e-7);
            close(single.outer[finger].into(), expected.1[finger], 5e-7);
        }
        close(double.spread, expected.2, 1e-12);
        close(single.spread.into(), expected.2, 5e-7);
    }
}

#[test]
fn a_simulated_finger_reads_back_its_angle_with_a_secondary_encoder_and_without() {
    for angle in [0.1, 1.0, 2.3_f64] {
        let (motor, worm) = finger_counts(angle);
        for secondary in [Some(worm), None] {
            let read = angles::<f64>(&[motor; 4], &[secondary; 3]);
            for (inner, outer) in read.inner.into_iter().zip(read.outer) {
                assert!((inner - angle).abs() < 4e-5 && (outer - angle / 3.0).abs() < 4e-5, "{angle}: {read:?}");
            }
        }
    }
}
