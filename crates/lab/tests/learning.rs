//! Learning: a demonstration becomes a primitive that does the same, a file that reads back as it was, and an image.

use std::path::Path;

use lab::demonstration::{Preparation, Recording};
use lab::learn::feedback::FeedbackOptions;
use lab::learn::{LearnError, LearnOptions, Learned, hand::HandMotion, learn};
use lab::primitive_file::{
    ExpectationTable, FeedbackTables, OrientationError, PrimitiveFile, PrimitiveFileError, StatisticsTable,
};

use crate::common;

/// The plan has to end this near to its goal, m: the bound of `tactus check`.
const GOAL_DISTANCE: f64 = 3e-3;

fn taught(duration: f64) -> Recording {
    let mut rows = common::rows(duration);
    // Open, as the primitive begins.
    rows.iter_mut().for_each(|row| row.telemetry.hand = [0.0; 4]);
    let text = common::text(&rows);
    Recording::parse(Path::new("demo.csv"), text.as_bytes()).unwrap()
}

fn learned(recording: &Recording, options: &LearnOptions) -> Result<Learned, LearnError> {
    learn(recording, Path::new("reach.toml"), options)
}

fn foreign(turn: f64) -> Recording {
    Recording::parse(Path::new("other.csv"), common::foreign(turn).as_bytes()).unwrap()
}

#[test]
fn a_taught_movement_is_reproduced() {
    let recording = taught(5.0);
    let learned = learned(&recording, &LearnOptions::named("reach")).unwrap();
    let report = &learned.report;
    assert!(report.position_rms_m < 5e-4, "{} m", report.position_rms_m);
    assert!(report.position_relative < 2e-3, "{}", report.position_relative);
    assert!(report.orientation_rms_rad.to_degrees() < 0.1, "{}", report.orientation_rms_rad.to_degrees());
    assert!((report.orientation_path_ratio - 1.0).abs() < 0.01, "{}", report.orientation_path_ratio);
    for row in &report.rows[6..13] {
        assert!(row.rms < 1e-3, "{row:?}");
    }
    assert_eq!(report.kernels, 50);
    assert!((report.phase.1 - 0.01).abs() < 1e-12);
    assert_eq!(report.wrench[1].mean, -0.25);
    assert!(report.warnings.is_empty(), "{:?}", report.warnings);
    // It starts and ends where the movement did, not where the recording did.
    let primitive = &learned.primitive;
    for joint in 0..7 {
        assert!((primitive.start.posture[joint] - common::START[joint]).abs() < 5e-3);
        assert!((primitive.goal.posture[joint] - common::GOAL[joint]).abs() < 5e-3);
    }
    assert!((primitive.movement.duration - 5.0).abs() < 0.5);
}

#[test]
fn the_plan_stays_at_its_goal_behind_the_end_of_the_movement() {
    let learned = learned(&taught(5.0), &LearnOptions::named("reach")).unwrap();
    let primitive = learned.primitive.to_primitive().unwrap();
    let primitive = primitive.movement();
    let mut rollout = dmp::Rollout::start(primitive, &dmp::StartState::demonstrated(primitive)).unwrap();
    for cycle in 0..12 * control::RATE_HZ {
        let plan = rollout.step(primitive, control::PERIOD, &dmp::Coupling::NONE).unwrap();
        if f64::from(cycle) / control::RATE > primitive.duration() {
            let away = (0..3)
                .map(|axis| (plan.poses[0].position.x[axis] - learned.primitive.goal.position[axis]).powi(2))
                .sum::<f64>()
                .sqrt();
            assert!(away < GOAL_DISTANCE, "{away} m at {} s", plan.time);
        }
    }
}

#[test]
fn more_kernels_fit_better() {
    let recording = taught(5.0);
    let error = |kernels| {
        let options = LearnOptions { kernels, ..LearnOptions::named("reach") };
        learned(&recording, &options).unwrap().report.position_rms_m
    };
    assert!(error(50) < 0.3 * error(15));
}

#[test]
fn learning_again_gives_the_same_primitive() {
    let recording = taught(3.0);
    let options = LearnOptions::named("reach");
    let first = learned(&recording, &options).unwrap().primitive;
    learned(&taught(4.0), &options).unwrap();
    let again = learned(&recording, &options).unwrap().primitive;
    assert_eq!(first, again);
}

#[test]
fn poses_alone_can_be_learned_and_a_wide_turn_is_followed_in_every_axis() {
    let turn = 2.5; // 143 degrees
    let learned = learned(&foreign(turn), &LearnOptions::named("turn")).unwrap();
    let report = &learned.report;
    assert!((report.largest_angle_rad - turn).abs() < 0.2, "{}", report.largest_angle_rad);
    assert!(report.orientation_rms_rad.to_degrees() < 0.1, "{}", report.orientation_rms_rad.to_degrees());
    assert!((report.orientation_path_ratio - 1.0).abs() < 0.01, "{}", report.orientation_path_ratio);
    assert!(report.warnings.iter().any(|warning| warning.contains("no joint angles")));
}

#[test]
fn an_outlier_or_a_wrapped_angle_is_told_with_its_line_and_is_no_turn_of_the_movement() {
    let text = common::text(&common::rows(3.0));
    let lines: Vec<&str> = text.lines().collect();
    let q7 = lines[1].split(',').position(|name| name == "q7_rad").unwrap();
    let with = |from: usize, to: usize, leap: f64| {
        let change = |(index, line): (usize, &&str)| {
            let mut fields: Vec<String> = line.split(',').map(String::from).collect();
            if (from..to).contains(&index) {
                fields[q7] = (fields[q7].parse::<f64>().unwrap() + leap).to_string();
            }
            fields.join(",") + "\n"
        };
        let text: String = lines.iter().enumerate().map(change).collect();
        Recording::parse(Path::new("demo.csv"), text.as_bytes()).unwrap()
    };
    assert!(learned(&with(0, 0, 0.0), &LearnOptions::named("reach")).is_ok());
    let cases = [
        (600, 601, 3.1),
        (600, 601, 0.3),
        (600, lines.len(), std::f64::consts::TAU),
        (600, 620, -std::f64::consts::TAU),
    ];
    for (from, to, leap) in cases {
        let error = learned(&with(from, to, leap), &LearnOptions::named("reach")).unwrap_err().to_string();
        assert!(error.contains("demo.csv: line 601, column ") && error.contains("(q7_rad)"), "{error}");
        assert_eq!(error.contains("a whole turn"), leap.abs() > 6.0, "{error}");
    }
    let degrees = |line: &&str| {
        let change = |(index, field): (usize, &str)| match field.parse::<f64>() {
            Ok(angle) if (q7 - 6..=q7).contains(&index) => angle.to_degrees().to_string(),
            _ => field.to_owned(),
        };
        line.split(',').enumerate().map(change).collect::<Vec<_>>().join(",") + "\n"
    };
    let text: String = lines.iter().map(degrees).collect();
    let recording = Recording::parse(Path::new("demo.csv"), text.as_bytes()).unwrap();
    let error = learned(&recording, &LearnOptions::named("reach")).unwrap_err().to_string();
    assert!(error.contains("are these degrees?") && error.contains("line 4, "), "{error}");
    let mut rows: Vec<String> = common::foreign(2.0).lines().map(String::from).collect();
    for (line, column, name) in [(400, 1, "px_m"), (500, 4, "qw")] {
        let before = rows.clone();
        let mut fields: Vec<String> = rows[line - 1].split(',').map(String::from).collect();
        match name {
            "qw" => fields.splice(4..8, ["0", "0", "0", "1"].map(String::from)).for_each(drop),
            _ => fields[column] = "2".to_owned(),
        }
        rows[line - 1] = fields.join(",");
        let recording = Recording::parse(Path::new("other.csv"), (rows.join("\n") + "\n").as_bytes()).unwrap();
        let error = learned(&recording, &LearnOptions::named("turn")).unwrap_err().to_string();
        assert!(error.contains(&format!("other.csv: line {line}, column ")) && error.contains(name), "{error}");
        rows = before;
    }
}

#[test]
fn a_turn_beyond_150_degrees_is_warned_of_and_beyond_175_refused_with_its_line() {
    let recording = foreign(2.75); // 158 degrees, a little more with the ripples
    let report = learned(&recording, &LearnOptions::named("turn")).unwrap().report;
    assert!(report.warnings.iter().any(|warning| warning.contains("rotation-vector")), "{:?}", report.warnings);

    let recording = foreign(3.3); // 189 degrees
    let error = learned(&recording, &LearnOptions::named("turn")).unwrap_err();
    assert!(matches!(error, LearnError::TurnsTooFar { rotation_vector_helps: true, .. }), "{error}");
    assert!(error.to_string().contains("other.csv: line "), "{error}");
}

#[test]
fn with_the_rotation_vector_a_turn_of_more_than_half_a_revolution_is_followed() {
    let options = LearnOptions { orientation_error: OrientationError::RotationVector, ..LearnOptions::named("turn") };
    let learned = learned(&foreign(5.0), &options).unwrap();
    let report = &learned.report;
    assert!(report.orientation_max_rad.to_degrees() < 0.5, "{}", report.orientation_max_rad.to_degrees());
    assert!((report.orientation_path_ratio - 1.0).abs() < 0.01, "{}", report.orientation_path_ratio);
}

#[test]
fn fingers_follow_their_generated_movement() {
    let options = LearnOptions {
        hand: HandMotion { start: [0.0; 4], goal: [0.0, 2.1, 2.1, 2.1], window: (0.5, 1.0) },
        ..LearnOptions::named("grasp")
    };
    let learned = learned(&taught(4.0), &options).unwrap();
    for row in &learned.report.rows[14..17] {
        assert!(row.rms < 5e-3, "{row:?}");
    }
    assert!((learned.primitive.goal.hand[2] - 2.1).abs() < 1e-3);
    let options = LearnOptions { hand: HandMotion { window: (0.8, 0.2), ..options.hand }, ..options };
    assert!(matches!(learn(&taught(4.0), Path::new("x.toml"), &options).unwrap_err(), LearnError::Option { .. }));
}

#[test]
fn a_recording_cut_out_of_a_motion_keeps_its_initial_velocity() {
    let mut rows = common::rows(4.0);
    rows.drain(..500);
    let text = common::text(&rows);
    let recording = Recording::parse(Path::new("cut.csv"), text.as_bytes()).unwrap();
    let options = LearnOptions { preparation: Preparation { still_speed: None }, ..LearnOptions::named("cut") };
    let learned = learned(&recording, &options).unwrap();
    let velocity = learned.primitive.start_velocity.posture;
    let expected = rows[0].telemetry.dq;
    for joint in 0..7 {
        assert!((velocity[joint] - f64::from(expected[joint])).abs() < 0.02, "{velocity:?} {expected:?}");
    }
    assert!(learned.report.position_relative < 0.015, "{}", learned.report.position_relative);
    assert!(learned.report.warnings[0].contains("begins in motion"), "{:?}", learned.report.warnings);
}

/// A primitive with everything a file can hold.
fn full() -> PrimitiveFile {
    let mut primitive = learned(&taught(3.0), &LearnOptions::named("full.1")).unwrap().primitive;
    let row = |seed: usize, size: usize| -> Vec<f64> {
        (0..size).map(|index| ((seed * 31 + index) as f64 * 0.7).sin() / 3.0).collect()
    };
    primitive.feedback = Some(FeedbackTables {
        clamp_position: 0.23,
        clamp_orientation: 0.35,
        clamp_hand: 0.1,
        k1: vec![row(1, 10).iter().map(|value| value.abs()).collect()],
        k2: (0..3).map(|point| row(point, 9).iter().map(|value| value.abs()).collect()).collect(),
    });
    primitive.expectation = Some(ExpectationTable {
        model_hash: control::MODEL_HASH,
        recorded_duration: 3.1,
        payload_mass: 0.1,
        payload_centre: [0.0, 0.01, 1e-7],
        filter_cutoff: 15.0,
        trials: 4,
        spread_floor: 0.05,
        mean: (0..50).map(|point| row(point, 9)).collect(),
        spread: (0..50).map(|point| row(point + 7, 9).iter().map(|value| value.abs()).collect()).collect(),
    });
    primitive.statistics = Some(StatisticsTable {
        trials: 5,
        mean: (0..64).map(|point| row(point, 12)).collect(),
        spread: (0..64).map(|point| row(point, 12).iter().map(|value| value.abs() + 0.01).collect()).collect(),
    });
    primitive
}

#[test]
fn a_file_reads_back_bit_for_bit() {
    let mut primitive = full();
    primitive.weights.position[0][0] = f64::MIN_POSITIVE;
    primitive.weights.position[1][1] = 0.1 + 0.2;
    primitive.weights.position[2][2] = -1e300;
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("reach.toml");
    primitive.write(&file).unwrap();
    let again = PrimitiveFile::read(&file).unwrap();
    primitive.file = file;
    assert_eq!(primitive, again);
    for (a, b) in primitive.weights.rows().flatten().zip(again.weights.rows().flatten()) {
        assert_eq!(a.to_bits(), b.to_bits());
    }
}

#[test]
fn a_file_written_by_an_earlier_version_is_read_and_means_the_same() {
    let text = include_str!("data/primitive.toml");
    let primitive = PrimitiveFile::parse(Path::new("reach.toml"), text).unwrap();
    assert_eq!(
        (primitive.name.as_str(), primitive.model_hash, primitive.checksum()),
        ("full.1", 0x9de7_b4e2, 0xb323_5ff7)
    );
    assert_eq!((primitive.movement.duration, primitive.movement.kernels), (3.446_666_666_666_666_8, 5));
    assert_eq!((primitive.weights.position[0][0], primitive.weights.position[2][2]), (f64::MIN_POSITIVE, -1e300));
    assert_eq!(primitive.gains.orientation.damping, 20.0);
    assert_eq!(primitive.expectation.as_ref().unwrap().payload_centre, [0.0, 0.01, 1e-7]);
    assert_eq!(primitive.provenance.as_ref().unwrap().demonstration, "demo.csv");
    assert_eq!(PrimitiveFile::parse(Path::new("reach.toml"), &primitive.to_text()).unwrap(), primitive);
}

#[test]
fn comments_may_be_changed_but_a_number_may_not() {
    let text = full().to_text();
    let parse = |text: &str| PrimitiveFile::parse(Path::new("reach.toml"), text);
    let commented = text.replace("# Movement primitive of Tactus.", "# My reach.\n# With a note.");
    assert!(parse(&commented).is_ok());
    let position = text.find("stiffness = 200.0").unwrap();
    let mut changed = text.clone();
    changed.replace_range(position..position + 17, "stiffness = 200.1");
    assert!(matches!(parse(&changed).unwrap_err(), PrimitiveFileError::Checksum { .. }));
    let renamed = text.replace("name = \"full.1\"", "name = \"other\"");
    assert!(matches!(parse(&renamed).unwrap_err(), PrimitiveFileError::Checksum { .. }));
}

#[test]
fn a_wrong_file_is_refused_with_the_reason() {
    let text = full().to_text();
    let refused = |text: &str| PrimitiveFile::parse(Path::new("reach.toml"), text).unwrap_err();
    let replaced = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        refused(&text.replacen(from, to, 1))
    };
    assert!(matches!(replaced("tactus-primitive/1", "tactus-primitive/9"), PrimitiveFileError::Schema { .. }));
    assert!(matches!(replaced("kernels = 50", "kernels = 40"), PrimitiveFileError::Shape { .. }));
    assert!(matches!(replaced("clamp_hand_rad = 0.1", "clamp_hand_rad = nan"), PrimitiveFileError::NotFinite { .. }));
    assert!(matches!(replaced("\"demonstrated\"", "\"far\""), PrimitiveFileError::Syntax { .. }));
    assert!(matches!(replaced("\"full.1\"", "\"a name\""), PrimitiveFileError::Syntax { .. }));
    let error = replaced("duration_s = ", "duration_s = ten # ");
    assert!(matches!(error, PrimitiveFileError::Syntax { .. }));
    let line = 1 + text.lines().position(|line| line.starts_with("duration_s")).unwrap();
    assert!(error.to_string().contains(&format!("line {line},")), "{error}");
    let error = replaced("[goal]", "[target]").to_string();
    assert!(error.contains("target") || error.contains("goal"), "{error}");
    assert!(matches!(refused(&text[..text.len() / 2]), PrimitiveFileError::Syntax { .. }));
    assert!(matches!(refused(""), PrimitiveFileError::Syntax { .. }));
}

#[test]
fn what_is_not_finite_is_not_written() {
    let mut primitive = full();
    primitive.weights.orientation[1][3] = f64::NAN;
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("reach.toml");
    let error = primitive.write(&file).unwrap_err();
    assert!(error.to_string().contains("weights.orientation, row 2: entry 4"), "{error}");
    assert!(!file.exists());
}

#[test]
fn the_image_holds_the_same_primitive_in_single_precision() {
    let primitive = full();
    let bytes = primitive.to_image().unwrap();
    let image = link::PrimitiveImage::parse(&bytes).unwrap();
    assert_eq!(image.name().as_str(), "full.1");
    let content = image.content();
    assert_eq!(content.model_hash, control::MODEL_HASH);
    assert_eq!(content.kernels, 50);
    assert_eq!(content.duration, primitive.movement.duration as f32);
    assert_eq!(content.goal.orientation, primitive.goal.orientation.map(|value| value as f32));
    for (index, weight) in primitive.weights.rows().flatten().enumerate() {
        assert_eq!(content.weights.get(index), Some(*weight as f32));
    }
    assert_eq!(content.expected_mean.len(), 50 * 9);
    assert_eq!(content.clamps.position, 0.23);
    assert_eq!((content.statistics_trials, content.statistics_mean.len()), (5, 64 * 12));
    let statistics = primitive.statistics.unwrap();
    for (index, value) in statistics.spread.concat().iter().enumerate() {
        assert_eq!(content.statistics_spread.get(index), Some(*value as f32));
    }
}

#[test]
fn statistics_under_the_name_of_earlier_versions_are_read() {
    let old = full().to_text().replace("[statistics]", "[experience]");
    let read = PrimitiveFile::parse(Path::new("reach.toml"), &old).unwrap();
    assert!(read.statistics.is_some());
    assert_eq!(read.to_text(), full().to_text());
}

#[test]
fn statistics_that_are_changed_cut_or_impossible_are_refused() {
    let text = full().to_text();
    let parse = |text: &str| PrimitiveFile::parse(Path::new("reach.toml"), text);
    let section = text.find("[statistics]").unwrap();
    let (head, tail) = text.split_at(section);
    let changed = format!("{head}{}", tail.replacen("trials = 5", "trials = 6", 1));
    assert!(matches!(parse(&changed).unwrap_err(), PrimitiveFileError::Checksum { .. }));
    let unknown = format!("{head}{}", tail.replacen("trials = 5", "runs = 5", 1));
    let error = parse(&unknown).unwrap_err().to_string();
    assert!(error.contains("line ") && error.contains("runs"), "{error}");

    let mut short = full();
    short.statistics.as_mut().unwrap().spread.pop();
    let error = PrimitiveFile::parse(Path::new("reach.toml"), &short.to_text()).unwrap_err();
    assert!(error.to_string().contains("statistics.spread"), "{error}");
    let mut narrow = full();
    narrow.statistics.as_mut().unwrap().mean[3].pop();
    let error = PrimitiveFile::parse(Path::new("reach.toml"), &narrow.to_text()).unwrap_err();
    assert!(error.to_string().contains("statistics.mean"), "{error}");
    let mut certain = full();
    certain.statistics.as_mut().unwrap().spread[10][2] = 0.0;
    let error = certain.to_primitive().unwrap_err();
    assert!(error.to_string().contains("a spread is not at least 1e-6"), "{error}");
}

#[test]
fn an_expectation_of_another_speed_or_another_model_is_refused() {
    let mut slow = full();
    slow.expectation.as_mut().unwrap().recorded_duration = slow.movement.duration / 1.51;
    for error in [slow.to_primitive().map(|_| ()).unwrap_err(), slow.to_image().map(|_| ()).unwrap_err()] {
        assert!(matches!(error, PrimitiveFileError::ExpectationDuration { .. }), "{error}");
        assert!(error.to_string().contains("more than 50 % apart"), "{error}");
    }
    slow.expectation.as_mut().unwrap().recorded_duration = slow.movement.duration / 1.45;
    assert!(slow.to_image().is_ok());
    let mut foreign = full();
    foreign.expectation.as_mut().unwrap().model_hash ^= 1;
    let error = foreign.to_image().unwrap_err();
    assert!(matches!(error, PrimitiveFileError::ExpectationModel { .. }), "{error}");
    // Such a file can still be read, so that it can be rehearsed again.
    let again = PrimitiveFile::parse(Path::new("reach.toml"), &foreign.to_text()).unwrap();
    assert!(again.without_memory().to_image().is_ok());
}

#[test]
fn a_dwell_makes_the_movement_longer_by_exactly_that_and_rests_at_the_goal() {
    let plain = learned(&taught(4.0), &LearnOptions::named("reach")).unwrap();
    let options = LearnOptions {
        dwell: 2.5,
        hand: HandMotion { start: [0.0; 4], goal: [0.0, 2.0, 2.0, 2.0], window: (0.65, 0.95) },
        ..LearnOptions::named("grasp")
    };
    let grasp = learned(&taught(4.0), &options).unwrap();
    assert!((grasp.primitive.movement.duration - plain.primitive.movement.duration - 2.5).abs() < 1e-12);
    assert_eq!(grasp.demonstration.len(), plain.demonstration.len() + usize::from(control::time::periods(2.5)));
    let primitive = grasp.primitive.to_primitive().unwrap();
    let primitive = primitive.movement();
    let mut rollout = dmp::Rollout::start(primitive, &dmp::StartState::demonstrated(primitive)).unwrap();
    loop {
        let plan = rollout.step(primitive, control::PERIOD, &dmp::Coupling::NONE).unwrap();
        if plan.time > plain.primitive.movement.duration + 0.3 {
            let away = (0..3).map(|axis| plan.poses[0].position.x[axis] - grasp.primitive.goal.position[axis]);
            assert!(away.map(|e| e * e).sum::<f64>().sqrt() < 3e-3, "at {} s", plan.time);
        }
        if plan.time > grasp.primitive.movement.duration {
            assert!((plan.points.x[8] - 2.0).abs() < 0.02, "{:?}", plan.points.x);
            break;
        }
    }
    for dwell in [-1.0, f64::NAN, 1e9] {
        let options = LearnOptions { dwell, ..LearnOptions::named("x") };
        assert!(matches!(learned(&taught(4.0), &options).unwrap_err(), LearnError::Option { option: "--dwell", .. }));
    }
}

/// The taught movement of an arm that stands still for half a second and then creeps away for another half: nobody
/// holds it any more, and it weighs otherwise than its model. J7 accelerates by twice `speed`, rad/s^2.
fn let_go(speed: f64) -> Recording {
    let_go_for(speed, 150)
}

/// The same, recorded for so many samples.
fn let_go_for(speed: f64, samples: u32) -> Recording {
    let mut rows = common::rows(4.0);
    let at_rest = rows.last().unwrap().clone();
    let mut last = at_rest.telemetry.q;
    for k in 1..=samples {
        let time = f64::from(k) / control::RATE;
        last[6] = at_rest.telemetry.q[6] + (speed * time * time) as f32;
        let (position, orientation) = lab::arm::tool_pose(&last.map(f64::from));
        let mut row = at_rest.clone();
        row.time += time;
        row.telemetry.cycle += k;
        row.telemetry.q = last;
        row.pose[..3].copy_from_slice(&position);
        row.pose[3..].copy_from_slice(&orientation);
        rows.push(row);
    }
    Recording::parse(Path::new("demo.csv"), common::text(&rows).as_bytes()).unwrap()
}

#[test]
fn an_arm_that_creeps_away_once_it_is_let_go_is_cut_off_there_and_that_is_said() {
    let options = LearnOptions { dwell: 2.5, ..LearnOptions::named("grasp") };
    let plain = learned(&taught(4.0), &options).unwrap();
    let crept = learned(&let_go(0.3), &options).unwrap();
    let away = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    let (goal, taught) = (crept.primitive.goal.position, plain.primitive.goal.position);
    assert!(away(&goal, &taught) < 1e-3, "{goal:?} instead of {taught:?}");
    let words = crept.report.warnings.join("\n");
    assert!(words.contains("crept away by") && words.contains("let go"), "{words}");
    assert!(!plain.report.warnings.iter().any(|warning| warning.contains("crept")));
    // A tenth of a millimetre is cut off as well, and nothing to warn of.
    for samples in (10..50).step_by(4) {
        let barely = learned(&let_go_for(0.3, samples), &options).unwrap().report.warnings;
        assert!(!barely.iter().any(|warning| warning.contains("by 0 mm")), "{samples}: {barely:?}");
    }
    // Half a metre per second is no creeping: who ends in motion is told so, as before.
    let fast = learned(&let_go(5.0), &options).unwrap_err();
    assert!(matches!(fast, LearnError::Option { option: "--dwell", .. }), "{fast}");
}

#[test]
fn gains_that_the_user_gives_are_taken_and_explained_and_a_heavy_plan_is_warned_of() {
    let feedback = |k1: [f64; 10], stiffness: f64| LearnOptions {
        feedback: FeedbackOptions {
            stiffness: Some(stiffness),
            orientation_stiffness: None,
            hand_stiffness: None,
            sensitivity: Some(k1),
            limits: Some([0.2, 30.0, 0.5]),
        },
        ..LearnOptions::named("reach")
    };
    let mut k1 = [0.0; 10];
    (k1[0], k1[5]) = (5.0, 100.0);
    let soft = learned(&taught(5.0), &feedback(k1, 300.0)).unwrap();
    let tables = soft.primitive.feedback.as_ref().unwrap();
    assert_eq!((tables.k1[0].as_slice(), tables.k2[0].as_slice()), (k1.as_slice(), [1.0; 9].as_slice()));
    assert_eq!(tables.clamp_orientation, 30_f64.to_radians());
    assert_eq!(soft.primitive.gains.position.stiffness, 300.0);
    assert!((soft.primitive.gains.position.damping - 2.0 * 300_f64.sqrt()).abs() < 1e-12);
    let report = soft.report.feedback.as_ref().unwrap();
    let row = report.rows[0];
    // 0.2 m against a spring of K/K1 = 60 N/m; tau^2/K1.
    assert!((row.load_at_limit - 12.0).abs() < 1e-9, "{row:?}");
    assert!((row.inertia - soft.primitive.movement.duration.powi(2) / 5.0).abs() < 1e-9, "{row:?}");
    assert_eq!((report.rows.len(), report.rows[1].row), (2, "rotation z"));
    assert!(soft.report.warnings.iter().any(|warning| warning.contains("2 kg")), "{:?}", soft.report.warnings);
    k1[1] = -1.0;
    let error = learned(&taught(5.0), &feedback(k1, 300.0)).unwrap_err();
    assert!(matches!(error, LearnError::Option { option: "--k1", .. }), "{error}");
    let error = learned(&taught(5.0), &feedback([1.0; 10], f64::NAN)).unwrap_err();
    assert!(matches!(error, LearnError::Option { option: "--stiffness", .. }), "{error}");
}

#[test]
fn more_kernels_than_a_device_holds_are_refused() {
    let mut primitive = full();
    let weights = &mut primitive.weights;
    for row in
        weights.position.iter_mut().chain(&mut weights.orientation).chain(&mut weights.posture).chain(&mut weights.hand)
    {
        row.resize(101, 0.0);
    }
    assert!(matches!(primitive.to_image().unwrap_err(), PrimitiveFileError::Image { .. }));
    assert!(matches!(primitive.to_primitive().unwrap_err(), PrimitiveFileError::Invalid { .. }));
}

/// A movement whose last stretch was led with the greatest care: another 10 s, in which the hand sinks by 30 mm.
fn careful() -> Recording {
    let mut rows = common::rows(4.0);
    let at_rest = rows.last().unwrap().clone();
    for k in 1..=3300_u32 {
        let mut row = at_rest.clone();
        row.time += f64::from(k) / control::RATE;
        row.telemetry.cycle += k;
        row.telemetry.q[1] += 0.005 * k.min(3000) as f32 / control::RATE as f32;
        let (position, orientation) = lab::arm::tool_pose(&row.telemetry.q.map(f64::from));
        row.pose[..3].copy_from_slice(&position);
        row.pose[3..].copy_from_slice(&orientation);
        rows.push(row);
    }
    Recording::parse(Path::new("demo.csv"), common::text(&rows).as_bytes()).unwrap()
}

#[test]
fn an_approach_so_slow_that_it_counts_as_rest_is_not_left_out_in_silence() {
    let options = LearnOptions::named("reach");
    let short = learned(&careful(), &options).unwrap();
    let words = short.report.warnings.join("\n");
    assert!(
        words.contains("behind the movement the arm moved by another") && words.contains("--still-speed"),
        "{words}"
    );
    // What it advises helps: the primitive ends where the hand was led.
    let preparation = Preparation { still_speed: Some(0.001) };
    let whole = learned(&careful(), &LearnOptions { preparation, ..options }).unwrap();
    assert!((whole.primitive.goal.posture[1] - common::GOAL[1] - 0.05).abs() < 2e-3);
    assert!(whole.report.warnings.iter().all(|warning| !warning.contains("left out")), "{:?}", whole.report.warnings);
}

#[test]
fn a_file_says_truly_which_of_its_numbers_are_guarded() {
    let text = learned(&taught(3.0), &LearnOptions::named("reach")).unwrap().primitive.to_text();
    let changed = |from: &str, to: &str| {
        let line = text.lines().find(|line| line.starts_with(from)).unwrap();
        PrimitiveFile::parse(Path::new("reach.toml"), &text.replace(line, to))
    };
    assert!(matches!(changed("alpha = ", "alpha = 4.0"), Err(PrimitiveFileError::Checksum { .. })));
    // Where it comes from is no part of the movement.
    assert!(changed("samples = ", "samples = 7").is_ok());
    assert!(text.contains("every number\n# but those of [provenance]."), "{}", &text[..300]);
}
