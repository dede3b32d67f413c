//! Remembering: recordings of rehearsals become an expectation and weights, recordings of successes become statistics.

use std::path::Path;

use control::{State, flags};
use lab::demonstration::{Recording, RecordingRow};
use lab::learn::memory::{MemoryError, Payload, remember_rehearsals, remember_successes};
use lab::learn::{LearnOptions, learn};
use lab::primitive_file::{PrimitiveFile, PrimitiveFileError};
use link::Telemetry;

use crate::common;

const DURATION: f64 = 5.0;

fn primitive() -> PrimitiveFile {
    let text = common::text(&common::rows(4.0));
    let demonstration = Recording::parse(Path::new("demo.csv"), text.as_bytes()).unwrap();
    learn(&demonstration, Path::new("reach.toml"), &LearnOptions::named("reach")).unwrap().primitive
}

/// The lines of a run of [`DURATION`] with half a second of rest before and behind; the sensors measure `feel(u)`.
fn rows(alpha: f64, feel: impl Fn(f64) -> f64) -> Vec<RecordingRow> {
    let template = common::rows(3.0)[0].clone();
    (0..1800_u32)
        .map(|cycle| {
            let time = f64::from(cycle) / 300.0;
            let u = (time - 0.5) / DURATION;
            let running = (0.0..=1.0).contains(&u);
            let telemetry = Telemetry {
                cycle,
                state: if running { State::Run } else { State::Hold }.code(),
                phase: if running { (-alpha * u).exp() as f32 } else { 0.0 },
                wrench: [feel(u) as f32, 0.5, 0.0, 0.0, 0.0, 0.0],
                gauges: [0.0, -0.1, 0.0],
                hand: [0.0, u as f32, 0.5, 1.0],
                ..template.telemetry
            };
            RecordingRow { time, telemetry, ..template.clone() }
        })
        .collect()
}

fn recording(rows: &[RecordingRow]) -> Recording {
    Recording::parse(Path::new("run.csv"), common::text(rows).as_bytes()).unwrap()
}

#[test]
fn rehearsals_become_an_expectation_by_phase_with_its_marks() {
    let mut file = primitive();
    // The first half repeats itself, the second differs by up to 1 N between the runs.
    let runs: Vec<_> = [-1.0, 0.0, 1.0]
        .map(|offset| recording(&rows(file.movement.alpha, |u| 4.0 * u + if u > 0.5 { offset } else { 0.05 * offset })))
        .to_vec();
    let payload = Payload { mass: 0.3, centre: [0.0, 0.0, 0.05] };
    let summary = remember_rehearsals(&mut file, &runs, DURATION, payload, true).unwrap();
    assert_eq!((summary.trials, summary.points), (3, 128));
    let expectation = file.expectation.as_ref().unwrap();
    for (index, point) in expectation.mean.iter().enumerate() {
        let u = index as f64 / 127.0;
        assert!((point[0] - 4.0 * u).abs() < 0.05, "{index}: {point:?}");
        assert!((point[1] - 0.5).abs() < 1e-6 && (point[7] + 0.1).abs() < 1e-6, "{point:?}");
    }
    assert!((expectation.spread[100][0] - 1.0).abs() < 0.02 && expectation.spread[20][0] < 0.06);
    assert_eq!((expectation.recorded_duration, expectation.payload_mass), (DURATION, 0.3));
    assert_eq!(expectation.model_hash, control::MODEL_HASH);
    // The force counts more where it repeats itself; what never scattered counts 1.
    let k2 = &file.feedback.as_ref().unwrap().k2;
    assert_eq!(k2.len(), 16);
    assert!(k2[2][0] > 3.0 * k2[14][0] && k2[5][1] == 1.0, "{k2:?}");
    // It fits an image, reads back, and bends the plan in the right direction.
    let again = PrimitiveFile::parse(Path::new("reach.toml"), &file.to_text()).unwrap();
    assert_eq!(again.expectation, file.expectation);
    assert!(again.to_image().is_ok());

    // Fewer than three tell no spread.
    remember_rehearsals(&mut file, &runs[..2], DURATION, payload, true).unwrap();
    assert_eq!(file.feedback.as_ref().unwrap().k2, vec![vec![1.0; 9]]);
}

#[test]
fn successes_become_statistics_that_end_with_the_next_rehearsal() {
    let mut file = primitive();
    let runs: Vec<_> =
        [-0.6, 0.0, 0.6].map(|offset| recording(&rows(file.movement.alpha, |u| 2.0 * u + offset))).to_vec();
    let summary = remember_successes(&mut file, &runs).unwrap();
    assert!((summary.duration_s - DURATION).abs() < 0.01, "{}", summary.duration_s);
    let statistics = file.statistics.as_ref().unwrap();
    assert_eq!((statistics.trials, statistics.mean.len()), (3, 64));
    // A third of the others' band is what each outer run is beyond it: that fits in the room that is left.
    assert!((statistics.mean[30][0] - 2.0 * 30.0 / 63.0).abs() < 0.02, "{:?}", statistics.mean[30]);
    assert_eq!((statistics.spread[30][0], statistics.spread[30][4]), (0.5, 0.06));
    let finger = statistics.mean[32][9];
    assert!((finger - 32.0 / 63.0).abs() < 0.01, "{finger}");
    // No device takes them alone.
    assert!(matches!(file.to_image(), Err(PrimitiveFileError::StatisticsAlone { .. })));
    remember_rehearsals(&mut file, &runs, DURATION, Payload::default(), true).unwrap();
    assert!(file.statistics.is_none());
    remember_successes(&mut file, &runs).unwrap();
    assert!(file.to_image().is_ok());
}

/// The largest statistic of the device's watch over a recording, judged by the statistics of a primitive.
fn watched(file: &PrimitiveFile, recording: &Recording) -> f64 {
    let primitive = file.to_primitive().unwrap();
    let mut watch = control::guard::Watch::<f64>::new();
    let run = recording.running();
    let (phase, wrench, gauges, hand) =
        (run.phase.unwrap(), run.wrench.unwrap(), run.gauges.unwrap(), run.hand.unwrap());
    let mut largest = 0.0_f64;
    for index in 0..phase.len() {
        let mut values = [0.0; control::plan::primitive::STATISTICS_CHANNELS];
        values[..6].copy_from_slice(&wrench[index]);
        values[6..9].copy_from_slice(&gauges[index]);
        values[9..].copy_from_slice(&hand[index][1..]);
        watch.step(primitive.statistics().unwrap(), -phase[index].ln() / file.movement.alpha, &values, true);
        largest = largest.max(watch.statistic());
    }
    largest
}

#[test]
fn every_success_is_within_two_thirds_of_the_limit_and_so_is_the_next_one_like_them() {
    let mut file = primitive();
    // One in eight is far from the others, in its force and in the moment of contact.
    let run =
        |offset: f64, touch: f64| recording(&rows(file.movement.alpha, |u| if u > touch { 2.0 + offset } else { 0.0 }));
    let runs: Vec<_> =
        (0..8).map(|k| run(if k == 7 { 6.0 } else { 0.1 * f64::from(k) }, 0.4 + 0.05 * f64::from(k))).collect();
    let next = run(5.5, 0.72);
    let summary = remember_successes(&mut file, &runs).unwrap();
    assert_eq!(summary.trials, 8);
    for recording in runs.iter().chain([&next]) {
        let largest = watched(&file, recording);
        assert!(largest < 0.67, "{largest}");
    }
    let far = recording(&rows(file.movement.alpha, |u| if u > 0.5 { 40.0 } else { 0.0 }));
    assert!(watched(&file, &far) > 1.0);
}

#[test]
fn recordings_that_tell_nothing_are_refused_and_nothing_is_changed() {
    let mut file = primitive();
    let before = file.clone();
    let good = rows(file.movement.alpha, |_| 1.0);
    let mut refused = |recordings: &[Recording]| {
        let error = remember_rehearsals(&mut file, recordings, DURATION, Payload::default(), true).unwrap_err();
        assert_eq!(file, before);
        error
    };
    let broken = |change: &dyn Fn(&mut Vec<RecordingRow>)| {
        let mut rows = good.clone();
        change(&mut rows);
        recording(&rows)
    };
    assert!(matches!(refused(&[]), MemoryError::None));
    let cut = broken(&|rows| rows.truncate(1200));
    let incomplete = refused(&[cut]);
    assert!(matches!(incomplete, MemoryError::Incomplete { .. }));
    assert!(incomplete.to_string().contains(" from 0 % to "), "{incomplete}");
    let saturated = broken(&|rows| rows[700].telemetry.flags = flags::SENSOR_SATURATED);
    assert!(matches!(refused(&[saturated]), MemoryError::Saturated { samples: 1, .. }));
    let stale = broken(&|rows| rows[400..500].iter_mut().for_each(|row| row.telemetry.flags = flags::WRENCH_STALE));
    assert!(matches!(refused(&[stale]), MemoryError::Stale { samples: 100, .. }));
    let slow = broken(&|rows| rows.iter_mut().for_each(|row| row.time *= 1.1));
    assert!(matches!(refused(&[slow]), MemoryError::Duration { .. }));
    let whole = recording(&good);
    let old = Recording { gauges: None, ..whole.clone() };
    assert!(refused(&[old]).to_string().contains("gauge1_Nm"));
    let still = Recording { phase: None, ..whole };
    assert!(refused(&[still]).to_string().contains("phase"));
}

#[test]
fn a_recording_of_two_runs_is_not_taken_for_one() {
    let mut file = primitive();
    let before = file.clone();
    let one = rows(file.movement.alpha, |_| 1.0);
    let mut two = one.clone();
    two.extend(one.into_iter().map(|mut row| {
        row.telemetry.cycle += 1800;
        row.time += 6.0;
        row
    }));
    let refused = remember_successes(&mut file, &[recording(&two)]).unwrap_err();
    assert!(matches!(refused, MemoryError::Several { line: 1953, .. }), "{refused}");
    assert_eq!(file, before);
}

#[test]
fn a_run_of_an_hour_and_a_half_is_a_time_in_milliseconds_and_no_success() {
    let mut file = primitive();
    let mut rows = rows(file.movement.alpha, |_| 1.0);
    rows.iter_mut().for_each(|row| row.time *= 1000.0);
    let refused = remember_successes(&mut file, &[recording(&rows)]).unwrap_err();
    assert!(matches!(refused, MemoryError::Duration { .. }), "{refused}");
}

#[test]
fn the_report_of_a_grasp_on_nothing_says_which_finger_nothing_stopped_and_is_not_called_good() {
    let mut file = primitive();
    let runs: Vec<_> =
        [-0.6, 0.0, 0.6].map(|offset| recording(&rows(file.movement.alpha, |u| 2.0 * u + offset))).to_vec();
    remember_successes(&mut file, &runs).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let report = |name: &str, rows: &[RecordingRow]| {
        let path = folder.path().join(name);
        std::fs::write(&path, common::text(rows)).unwrap();
        lab::report::ReportedRun::read(&path, Some(&file)).unwrap()
    };
    let usual = rows(file.movement.alpha, |u| 2.0 * u);
    let good = report("good.csv", &usual);
    assert!(good.outcome.is_good() && !good.happenings.iter().any(|event| event.words.contains("successful")));

    let mut empty = usual;
    for row in &mut empty {
        let u = (row.time - 0.5) / DURATION;
        if (0.6..=1.0).contains(&u) {
            row.telemetry.hand[1] += 1.0;
            row.telemetry.flags |= flags::SURPRISE;
        }
    }
    let missed = report("missed.csv", &empty);
    assert!(!missed.outcome.is_good(), "{}", missed.outcome.words());
    let said: Vec<_> =
        missed.happenings.iter().filter(|event| event.words.contains("finger F1 closed farther")).collect();
    assert_eq!(said.len(), 1, "{:?}", missed.happenings);
    assert!((said[0].progress - 0.6).abs() < 0.05 && (said[0].time - 3.0).abs() < 0.25, "{:?}", said[0]);
}
