//! Learning at another speed than the movement was shown at.

use std::path::Path;

use lab::demonstration::Recording;
use lab::learn::{LearnError, LearnOptions, Learned, learn};

use crate::common;

fn taught(duration: f64) -> Recording {
    let text = common::text(&common::rows(duration));
    Recording::parse(Path::new("demo.csv"), text.as_bytes()).unwrap()
}

fn learned(recording: &Recording, options: &LearnOptions) -> Result<Learned, LearnError> {
    learn(recording, Path::new("reach.toml"), options)
}

/// The change that makes it fail: the fingers' dwell is hastened as well, or the cut-off is not.
#[test]
fn a_movement_can_be_learned_at_another_speed_than_it_was_shown_and_goes_the_same_way() {
    let at = |speed: f64, dwell: f64| {
        let options = LearnOptions { speed, dwell, ..LearnOptions::named("reach") };
        learned(&taught(6.0), &options).expect("learns")
    };
    let plain = at(1.0, 0.0);
    let way = |learned: &Learned| -> f64 {
        let distance =
            |pair: &[[f64; 3]]| (0..3).map(|axis| (pair[1][axis] - pair[0][axis]).powi(2)).sum::<f64>().sqrt();
        learned.demonstration.position.windows(2).map(distance).sum()
    };
    for speed in [0.5, 1.8, 3.5] {
        let other = at(speed, 2.0);
        let movement = other.primitive.movement.duration - 2.0;
        assert!(
            (movement - plain.primitive.movement.duration / speed).abs() <= control::PERIOD,
            "{speed}: {movement} s"
        );
        assert!((way(&other) / way(&plain) - 1.0).abs() < 1e-3, "{speed}");
        assert!(other.report.position_max_m < 3e-3, "{speed}: {} m", other.report.position_max_m);
        // The springs follow the duration, so that a force bends the plan as fast and as far.
        let ends = |learned: &Learned| (learned.primitive.start.position, learned.primitive.goal.position);
        for (one, two) in [(ends(&other).0, ends(&plain).0), (ends(&other).1, ends(&plain).1)] {
            assert!((0..3).all(|axis| (one[axis] - two[axis]).abs() < 1e-3), "{speed}: {one:?} {two:?}");
        }
    }
    for speed in [0.0, -1.0, 0.09, 10.1, f64::NAN, f64::INFINITY] {
        let options = LearnOptions { speed, ..LearnOptions::named("x") };
        assert!(matches!(learned(&taught(4.0), &options).unwrap_err(), LearnError::Option { option: "--speed", .. }));
    }
    // What trembles is filtered as it was shown: the cut-off belongs to the demonstration, and has to stay one.
    let options = LearnOptions { speed: 10.0, cutoff: 16.0, ..LearnOptions::named("x") };
    assert!(matches!(learned(&taught(4.0), &options).unwrap_err(), LearnError::Option { option: "--cutoff", .. }));
}
