//! Checking: what an arm can do passes, what it cannot do is refused with the limit, the joint and the time.

#[path = "../../crates/lab/tests/common/mod.rs"]
mod common;

use std::path::Path;

use lab::demonstration::Recording;
use lab::learn::{LearnOptions, learn};
use lab::primitive_file::{PrimitiveFile, PrimitiveFileError};
use tactus::check::{Asked, CheckReport, Limit, check};

fn reach(duration: f64) -> PrimitiveFile {
    let text = common::text(&common::rows(duration));
    let recording = Recording::parse(Path::new("demo.csv"), text.as_bytes()).unwrap();
    learn(&recording, Path::new("reach.toml"), &LearnOptions::named("reach")).unwrap().primitive
}

fn checked(primitive: &PrimitiveFile) -> CheckReport {
    check(primitive, Asked { speed: 1.0, ..Asked::default() }, |_| {}).unwrap()
}

#[test]
fn a_calm_movement_passes_with_every_margin_reported() {
    let mut heard = Vec::new();
    let report = check(&reach(5.0), Asked { speed: 1.0, ..Asked::default() }, |fraction| heard.push(fraction)).unwrap();
    assert!(report.passed(), "{}", report.to_text());
    assert_eq!(report.margins.len(), 4 + 1 + 7 + 7 + 7 + 1 + 2);
    assert_eq!(report.limited_cycles, 0);
    assert!(report.tracking_max_m < 5e-3, "{}", report.tracking_max_m);
    for margin in &report.margins {
        assert!(margin.margin.is_finite() && margin.margin > 0.0, "{margin:?}");
        assert!(margin.time_s >= 0.0 && margin.time_s <= report.run_duration_s);
    }
    assert!(heard.len() > 3 && heard.is_sorted());
}

#[test]
fn the_position_margin_is_the_distance_to_the_nearer_soft_limit() {
    let report = checked(&reach(5.0));
    let j4 =
        report.margins.iter().find(|margin| margin.limit == Limit::JointPosition && margin.joint == Some(4)).unwrap();
    // The elbow moves between 1.5 and 1.9 rad (and 2 % beyond by the ripples) within -0.82 to 3.09.
    assert!((j4.margin - (3.09 - 1.9)).abs() < 0.05, "{j4:?}");
    assert!(j4.time_s < 1.5);
}

#[test]
fn a_movement_that_is_too_fast_is_refused() {
    let mut primitive = reach(5.0);
    primitive.movement.duration = 0.6;
    let report = checked(&primitive);
    assert!(!report.passed(), "{}", report.to_text());
    assert!(
        report.violations.iter().any(|text| text.contains("speed") || text.contains("limiter")),
        "{:?}",
        report.violations
    );
}

#[test]
fn the_same_movement_passes_at_half_speed_and_fails_at_double() {
    let primitive = reach(1.6);
    let slow = check(&primitive, Asked { speed: 0.5, ..Asked::default() }, |_| {}).unwrap();
    assert!(slow.passed(), "{}", slow.to_text());
    let fast = check(&primitive, Asked { speed: 2.0, ..Asked::default() }, |_| {}).unwrap();
    assert!(!fast.passed(), "{}", fast.to_text());
}

#[test]
fn a_start_posture_outside_the_soft_limits_is_refused() {
    let mut primitive = reach(3.0);
    primitive.start.posture[3] = 3.12;
    let report = checked(&primitive);
    assert!(report.violations.iter().any(|text| text.contains("J4")), "{:?}", report.violations);
}

#[test]
fn a_pose_that_is_not_that_of_its_posture_is_refused() {
    let mut primitive = reach(3.0);
    primitive.start.position[0] += 0.2;
    let report = checked(&primitive);
    assert!(report.violations.iter().any(|text| text.contains("posture")), "{:?}", report.violations);
}

#[test]
fn a_plan_that_leaves_the_workspace_is_refused() {
    let mut primitive = reach(3.0);
    // A forcing term that throws the hand forward in the middle of the movement.
    for weight in &mut primitive.weights.position[0][15..25] {
        *weight += 40.0;
    }
    let report = checked(&primitive);
    let far = report.margins.iter().find(|margin| margin.limit == Limit::Reach).unwrap();
    assert!(far.margin < 0.0 && far.time_s > 0.2, "{far:?}");
    assert!(!report.passed());
}

#[test]
fn a_primitive_of_another_arm_is_refused() {
    let mut primitive = reach(3.0);
    primitive.model_hash ^= 1;
    let error = check(&primitive, Asked { speed: 1.0, ..Asked::default() }, |_| {}).unwrap_err();
    assert!(matches!(error, PrimitiveFileError::Model { .. }), "{error}");
}

#[test]
fn a_duration_that_the_integration_cannot_follow_is_refused() {
    let mut primitive = reach(3.0);
    primitive.movement.duration = 0.05;
    let error = check(&primitive, Asked { speed: 1.0, ..Asked::default() }, |_| {}).unwrap_err();
    assert!(matches!(error, PrimitiveFileError::Invalid { .. }), "{error}");
}
