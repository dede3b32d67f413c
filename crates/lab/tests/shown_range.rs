//! `learn` tells of joints that were shown where the arm may not be, and of times that leave no movement.

use std::f32::consts::TAU;
use std::path::Path;

use lab::demonstration::{DemonstrationError, Preparation, Recording};
use lab::learn::{LearnError, LearnOptions, learn};

use crate::common;

/// The change that makes it fail: `learn` without the warnings of the joints' range. Only `check` refused it then.
#[test]
fn a_joint_that_was_counted_once_round_is_told_of() {
    let told = |turned: f32| {
        let mut rows = common::rows(4.0);
        for row in &mut rows {
            row.telemetry.q[6] += turned;
        }
        let recording = Recording::parse(Path::new("demo.csv"), common::text(&rows).as_bytes()).unwrap();
        let warnings =
            learn(&recording, Path::new("reach.toml"), &LearnOptions::named("reach")).unwrap().report.warnings;
        warnings.into_iter().filter(|warning| warning.starts_with("J7")).collect::<Vec<_>>().join("; ")
    };
    assert!(told(TAU).contains("1 times round"), "{}", told(TAU));
    assert_eq!(told(0.0), "");
}

/// The change that makes it fail: samples that all lie within one control period are put on a grid of one point.
#[test]
fn a_recording_shorter_than_a_control_period_is_refused_for_its_duration() {
    let text = common::foreign(0.5);
    let lines = text.lines().filter(|line| !line.starts_with('#')).take(81).enumerate();
    // A clock of another unit: the first column is the time.
    let squeezed = lines.map(|(number, line)| match (number, line.split_once(',')) {
        (1.., Some((_, rest))) => format!("{number}e-6,{rest}\n"),
        _ => format!("{line}\n"),
    });
    let recording = Recording::parse(Path::new("demo.csv"), squeezed.collect::<String>().as_bytes()).unwrap();
    for still_speed in [Some(0.005), None] {
        let options = LearnOptions { preparation: Preparation { still_speed }, ..LearnOptions::named("reach") };
        let error = learn(&recording, Path::new("reach.toml"), &options).unwrap_err();
        assert!(matches!(error, LearnError::Demonstration(DemonstrationError::Duration { .. })), "{error}");
    }
}
