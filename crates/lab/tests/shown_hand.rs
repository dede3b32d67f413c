//! `learn` tells of a hand that was shown otherwise than the primitive holds it.

use std::path::Path;

use lab::demonstration::Recording;
use lab::learn::{LearnOptions, hand::HandMotion, learn};

use crate::common;

/// The change that makes it fail: what the recording tells of the hand is passed over, as its fingers are not learned.
#[test]
fn a_hand_that_was_shown_otherwise_than_the_primitive_holds_it_is_told_of() {
    let shown = |hand: &dyn Fn(f64) -> f32| {
        let mut rows = common::rows(4.0);
        for row in &mut rows {
            row.telemetry.hand = [0.0, hand(row.time), hand(row.time), hand(row.time)];
        }
        Recording::parse(Path::new("demo.csv"), common::text(&rows).as_bytes()).unwrap()
    };
    let told = |recording: &Recording, start: f64, goal: f64| {
        let [start, goal] = [start, goal].map(|angle| [0.0, angle, angle, angle]);
        let hand = HandMotion { start, goal, ..HandMotion::default() };
        let warnings =
            learn(recording, Path::new("reach.toml"), &LearnOptions { hand, ..LearnOptions::named("reach") })
                .unwrap()
                .report
                .warnings;
        warnings.into_iter().filter(|warning| warning.contains("hand-")).collect::<Vec<_>>().join("; ")
    };
    let holding = shown(&|_| 2.2);
    assert!(
        told(&holding, 0.0, 0.0).contains("--hand-goal 0.00,2.20,2.20,2.20` begins"),
        "{}",
        told(&holding, 0.0, 0.0)
    );
    assert_eq!(told(&holding, 2.1, 2.1), "");
    // A gripper that closes and opens again is not shown by where it begins and ends.
    let twice = shown(&|time| if (1.5..2.5).contains(&time) { 2.0 } else { 0.1 });
    assert!(told(&twice, 0.0, 0.0).contains("moved by up to 1.90 rad"), "{}", told(&twice, 0.0, 0.0));
    assert_eq!(told(&twice, 0.0, 2.3), "", "who says how the fingers go has been told");
    assert_eq!(told(&shown(&|_| 0.1), 0.0, 0.0), "");
}
