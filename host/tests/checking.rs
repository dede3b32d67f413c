//! Checking: what an arm can do passes, what it cannot do is refused with the limit, the joint and the time.

use std::path::Path;

use lab::demonstration::{Preparation, Recording};
use lab::learn::{LearnOptions, learn};
use lab::primitive_file::{ExpectationTable, PrimitiveFile, PrimitiveFileError};
use lab::procedure::{Change, ChangeKind};
use link::Goal;
use tactus::check::{CheckReport, Course, Limit, check};

use crate::common;

fn reach(duration: f64) -> PrimitiveFile {
    let text = common::text(&common::rows(duration));
    let recording = Recording::parse(Path::new("demo.csv"), text.as_bytes()).unwrap();
    learn(&recording, Path::new("reach.toml"), &LearnOptions::named("reach")).unwrap().primitive
}

fn checked(primitive: &PrimitiveFile) -> CheckReport {
    check(primitive, &Course::stored(1.0), |_| {}).unwrap()
}

#[test]
fn cli_5_a_calm_movement_passes_with_every_margin_reported() {
    let mut heard = Vec::new();
    let report = check(&reach(5.0), &Course::stored(1.0), |fraction| heard.push(fraction)).unwrap();
    assert!(report.passed(), "{}", report.to_text());
    assert_eq!(report.margins.len(), 4 + 1 + 7 + 7 + 7 + 1 + 1 + 2);
    assert_eq!(report.limited_cycles, 0);
    assert!(report.tracking_max_m < 5e-3, "{}", report.tracking_max_m);
    for margin in &report.margins {
        assert!(margin.margin.is_finite() && margin.margin > 0.0, "{margin:?}");
        assert!(margin.time_s >= 0.0 && margin.time_s <= report.run_duration_s);
    }
    assert!(heard.len() > 3 && heard.is_sorted());
}

/// The change that makes it fail: the times of the plan are those of the taught speed.
#[test]
fn every_margin_is_told_at_the_time_of_the_run_at_its_speed() {
    let primitive = reach(5.0);
    let reached = |speed: f64| {
        let report = check(&primitive, &Course::stored(speed), |_| {}).unwrap();
        assert!(report.margins.iter().all(|margin| margin.time_s <= report.run_duration_s), "{}", report.to_text());
        report.margins.iter().find(|margin| margin.limit == Limit::Reach).unwrap().time_s
    };
    let (taught, twice) = (reached(1.0), reached(2.0));
    assert!(taught > 0.1 && (twice - taught / 2.0).abs() < 1e-9, "{taught} s and {twice} s");
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
        report
            .violations
            .iter()
            .any(|text| text.contains("speed") || text.contains("limiter") || text.contains("faster")),
        "{:?}",
        report.violations
    );
}

#[test]
fn h4_a_goal_that_is_changed_is_checked_with_the_run() {
    let primitive = reach(5.0);
    let [x, y, z] = primitive.goal.position;
    let to = |x: f64, y: f64, z: f64| Goal { position: Some([x, y, z].map(|part| part as f32)), orientation: None };
    let changed = |goal: Goal| {
        let changes = vec![Change { time: 1.0, kind: ChangeKind::Goal(goal) }];
        check(&primitive, &Course { changes, ..Course::stored(2.0) }, |_| {}).unwrap()
    };
    let near = changed(to(x - 0.05, y, z + 0.1));
    assert!(near.passed(), "{}", near.to_text());
    let end = near.margins.iter().find(|margin| margin.limit == Limit::GoalPosition).unwrap();
    assert!(end.value < 3e-3, "{end:?}");
    // Where the joints cannot follow, and out of reach.
    for goal in [to(0.0, 0.0, -0.2), to(1.2, 0.0, 0.0)] {
        assert!(!changed(goal).passed(), "on the way: {goal:?}");
        let course = Course { goal, ..Course::stored(2.0) };
        assert!(!check(&primitive, &course, |_| {}).unwrap().passed(), "from the start on: {goal:?}");
    }
}

#[test]
fn h4_every_change_at_one_moment_is_checked_and_not_only_the_first() {
    let primitive = reach(1.6);
    assert!(checked(&primitive).passed());
    let faster = Change { time: 0.2, kind: ChangeKind::Speed(2.0) };
    let position = Some(primitive.goal.position.map(|part| part as f32));
    let same_goal = Change { time: 0.2, kind: ChangeKind::Goal(Goal { position, orientation: None }) };
    for changes in [vec![faster], vec![same_goal, faster], vec![faster, same_goal]] {
        let report = check(&primitive, &Course { changes, ..Course::stored(1.0) }, |_| {}).unwrap();
        assert!(!report.passed(), "{}", report.to_text());
    }
}

#[test]
fn a_movement_of_more_than_a_minute_is_learned_with_gains_that_the_control_code_takes() {
    let text = common::text(&common::rows(75.0));
    let recording = Recording::parse(Path::new("demo.csv"), text.as_bytes()).unwrap();
    let preparation = Preparation { still_speed: Some(0.0005) };
    let options = LearnOptions { preparation, ..LearnOptions::named("slow") };
    let report = checked(&learn(&recording, Path::new("slow.toml"), &options).unwrap().primitive);
    assert!(report.duration_s > 60.0 && report.passed(), "{}", report.to_text());
}

#[test]
fn the_same_movement_passes_at_half_speed_and_fails_at_double() {
    let primitive = reach(1.6);
    let slow = check(&primitive, &Course::stored(0.5), |_| {}).unwrap();
    assert!(slow.passed(), "{}", slow.to_text());
    let fast = check(&primitive, &Course::stored(2.0), |_| {}).unwrap();
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
    let error = check(&primitive, &Course::stored(1.0), |_| {}).unwrap_err();
    assert!(matches!(error, PrimitiveFileError::Model { .. }), "{error}");
}

#[test]
fn a_duration_that_the_integration_cannot_follow_is_refused() {
    let mut primitive = reach(3.0);
    primitive.movement.duration = 15.0 * control::PERIOD;
    let error = check(&primitive, &Course::stored(1.0), |_| {}).unwrap_err();
    assert!(matches!(error, PrimitiveFileError::Invalid { .. }), "{error}");
}

/// The primitive with an expectation: a force (N, world axes) in three of its samples.
fn expecting(force: [f64; 3]) -> PrimitiveFile {
    let mut primitive = reach(5.0);
    let mut mean = vec![vec![0.0; 9]; 100];
    mean[60..63].iter_mut().for_each(|sample| sample[..3].copy_from_slice(&force));
    primitive.expectation = Some(ExpectationTable {
        model_hash: primitive.model_hash,
        recorded_duration: primitive.movement.duration,
        payload_mass: 0.0,
        payload_centre: [0.0; 3],
        filter_cutoff: 15.0,
        trials: 3,
        spread_floor: 0.02,
        mean,
        spread: Vec::new(),
    });
    primitive
}

/// A run would stop there as `ContactForce`. The changes that make it fail: `expected::check` is not called; the lever
/// between hand and sensor is left out.
#[test]
fn an_expectation_that_the_sensor_cannot_measure_is_told_with_its_sample_force_and_bound() {
    let calm = checked(&expecting([0.0; 3]));
    assert!(calm.passed(), "{}", calm.to_text());
    assert_eq!(calm.margins.len(), 4 + 1 + 7 + 7 + 7 + 1 + 1 + 2 + 1 + 7);
    let refused = |newton: f64| {
        let all = (0..3).map(|axis| {
            let mut force = [0.0; 3];
            force[axis] = newton;
            checked(&expecting(force))
        });
        all.filter(|report| !report.passed()).collect::<Vec<_>>()
    };
    assert!(refused(15.0).is_empty());
    let reports = refused(-45.0);
    assert!(reports.len() >= 2, "{}: only a force along the hand has no lever", reports.len());
    for report in reports {
        let told = report.violations.join("; ");
        assert!(told.contains("of 100 expects 45.0 N (") && told.contains("stop a run"), "{told}");
        assert!(report.advice().contains("`tactus rehearse`"), "{}", report.advice());
        let margin = report.margins.iter().find(|margin| margin.limit == Limit::ExpectedAtSensor).unwrap();
        assert!(margin.margin < 0.0 && (margin.bound - margin.value - margin.margin).abs() < 1e-9, "{margin:?}");
    }
}
