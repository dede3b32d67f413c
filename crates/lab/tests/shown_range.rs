//! `learn` tells of joints that were shown where the arm may not be.

use std::f32::consts::TAU;
use std::path::Path;

use lab::demonstration::Recording;
use lab::learn::{LearnOptions, learn};

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
