//! The page about runs: what a stranger reads in it, and that it needs nothing but itself.

use std::path::{Path, PathBuf};

use control::{Fault, State, flags};
use lab::demonstration::Recording;
use lab::learn::{LearnOptions, learn};
use lab::outcome::Outcome;
use lab::primitive_file::{ExpectationTable, PrimitiveFile};
use lab::report::{ReportedRun, page};

use crate::common;

/// A run of 4 s between two rests; what comes behind its samples is in this state, with this fault.
fn recorded(folder: &Path, name: &str, end: Option<(State, Fault)>) -> PathBuf {
    let mut rows = common::rows(4.0);
    let alpha = 4.605_170_185_988_091;
    for (at, row) in rows.iter_mut().enumerate() {
        let progress = (at as f64 / control::RATE - 0.5) / 4.0;
        let (state, fault) = match (progress, end) {
            (..0.0, _) => (State::Hold, Fault::None),
            (0.6.., Some(end)) => end,
            (1.0.., None) => (State::Hold, Fault::None),
            _ => (State::Run, Fault::None),
        };
        row.telemetry.state = state.code();
        row.telemetry.fault = fault.code();
        row.telemetry.phase = if state == State::Run { (-alpha * progress).exp() as f32 } else { 0.0 };
        row.telemetry.wrench[2] = if (0.4..0.5).contains(&progress) { 31.0 } else { 1.0 };
        row.telemetry.flags = if (0.45..0.5).contains(&progress) { flags::SURPRISE } else { 0 };
    }
    let file = folder.join(name);
    std::fs::write(&file, common::text(&rows)).unwrap();
    file
}

/// The primitive learned from the movement; it expects 2 N along z with a spread of 3 N.
fn primitive(folder: &Path) -> PrimitiveFile {
    let recording = Recording::read(&common::demonstration(folder, 4.0)).unwrap();
    let mut learned = learn(&recording, Path::new("reach.toml"), &LearnOptions::named("reach")).unwrap().primitive;
    let table = |value: f64| vec![(0..9).map(|row| if row == 2 { value } else { 0.0 }).collect(); 16];
    learned.expectation = Some(ExpectationTable {
        model_hash: learned.model_hash,
        recorded_duration: learned.movement.duration,
        payload_mass: 0.0,
        payload_centre: [0.0; 3],
        filter_cutoff: 7.5,
        trials: 3,
        spread_floor: 0.05,
        mean: table(2.0),
        spread: table(3.0),
    });
    learned
}

#[test]
fn the_end_of_a_run_is_told_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let outcome = |name, end| ReportedRun::read(&recorded(folder.path(), name, end), None).unwrap().outcome;
    assert_eq!(outcome("a.csv", None), Outcome::ArrivedUnlike);
    assert_eq!(outcome("b.csv", Some((State::SoftStop, Fault::ContactForce))), Outcome::Faulted(Fault::ContactForce));
    assert_eq!(outcome("c.csv", Some((State::SoftStop, Fault::None))), Outcome::Stopped);
    assert_eq!(outcome("d.csv", Some((State::Run, Fault::None))), Outcome::Unfinished);
    let still = ReportedRun::read(&common::demonstration(folder.path(), 3.0), None).unwrap();
    assert_eq!(still.outcome, Outcome::NeverBegan);
    assert!(page("still", &[still], None).contains("no movement was played"));
}

#[test]
fn the_end_of_a_run_is_what_came_right_behind_it_whatever_else_was_recorded() {
    let folder = tempfile::tempdir().unwrap();
    // The recording begins with a fault that somebody clears, and goes on after the run.
    let outcome = |end: Option<(State, Fault)>, afterwards: State| {
        let text = std::fs::read_to_string(recorded(folder.path(), "run.csv", end)).unwrap();
        let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
        let first = lines.iter().position(|line| line.starts_with("cycle,")).unwrap() + 1;
        let count = lines.len();
        for (at, line) in lines.iter_mut().enumerate().skip(first) {
            let mut fields: Vec<&str> = line.split(',').collect();
            if at < first + 50 {
                (fields[2], fields[3]) = ("fault", "1");
            } else if at + 50 > count {
                (fields[2], fields[3]) = (afterwards.name(), "0");
            }
            *line = fields.join(",");
        }
        let file = folder.path().join("changed.csv");
        std::fs::write(&file, lines.join("\n") + "\n").unwrap();
        ReportedRun::read(&file, None).unwrap().outcome
    };
    assert_eq!(outcome(None, State::Hold), Outcome::ArrivedUnlike);
    assert_eq!(outcome(None, State::Gravity), Outcome::ArrivedUnlike);
    // A run that was stopped has not arrived because the arm was told to hold afterwards.
    assert_eq!(outcome(Some((State::SoftStop, Fault::None)), State::Hold), Outcome::Stopped);
    let touched = Some((State::SoftStop, Fault::ContactForce));
    assert_eq!(outcome(touched, State::Hold), Outcome::Faulted(Fault::ContactForce));
}

/// The change that makes it fail: whoever holds after a run has arrived.
#[test]
fn an_arm_that_holds_away_from_its_goal_has_not_arrived() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(recorded(folder.path(), "run.csv", None)).unwrap();
    let names: Vec<&str> = text.lines().find(|line| line.starts_with("cycle,")).unwrap().split(',').collect();
    let x = names.iter().position(|name| *name == "x_m").unwrap();
    let held_up = |metres: f64| {
        let moved = |line: &str| {
            let mut fields: Vec<String> = line.split(',').map(str::to_owned).collect();
            if let Some(Ok(value)) = fields.get(x).map(|field| field.parse::<f64>()) {
                fields[x] = (value + metres).to_string();
            }
            fields.join(",")
        };
        let file = folder.path().join("moved.csv");
        std::fs::write(&file, text.lines().map(moved).collect::<Vec<_>>().join("\n") + "\n").unwrap();
        ReportedRun::read(&file, None).unwrap().outcome
    };
    assert_eq!(held_up(0.04), Outcome::ArrivedUnlike);
    let missed = held_up(0.06);
    assert!(matches!(missed, Outcome::Missed(_)) && !missed.is_good(), "{missed:?}");
    assert!(missed.words().contains("60 mm and 0 degrees away"), "{}", missed.words());
}

#[test]
fn a_failed_run_says_what_happened_when_and_how_far_it_came() {
    let folder = tempfile::tempdir().unwrap();
    let file = recorded(folder.path(), "run.csv", Some((State::SoftStop, Fault::ContactForce)));
    let run = ReportedRun::read(&file, None).unwrap();
    let (force, at) = run.largest_force().unwrap();
    assert!((force - 31.0).abs() < 0.1 && (0.39..0.51).contains(&at), "{force} N at {at}");
    let surprise = run.happenings.iter().find(|happening| happening.words.contains("successful")).unwrap();
    assert!((surprise.progress - 0.45).abs() < 0.01 && (surprise.time - 1.8).abs() < 0.01, "{surprise:?}");
    assert!(surprise.words.ends_with("for 0.20 s"), "{surprise:?}");
    let html = page("A <failed> run", &[run], None);
    for words in ["A &lt;failed&gt; run", "Recorded by nobody, for tests.", "stopped by a fault (ContactForce)", "60 %"]
    {
        assert!(html.contains(words), "{words}");
    }
}

#[test]
fn the_page_needs_no_other_file_and_draws_several_runs_over_one_another() {
    let folder = tempfile::tempdir().unwrap();
    let file = primitive(folder.path());
    let good = recorded(folder.path(), "good.csv", None);
    let bad = recorded(folder.path(), "bad.csv", Some((State::SoftStop, Fault::ContactForce)));
    let runs = [good, bad].map(|run| ReportedRun::read(&run, Some(&file)).unwrap());
    let html = page("reach", &runs, Some(&file));
    let alone = page("reach", &runs[..1], None);
    for words in [
        "Finger F1",
        "Gauge of F3",
        "Surprise",
        "Plan beside the taught one",
        "expected, \u{b1}",
        "good.csv",
        "bad.csv",
    ] {
        assert!(html.contains(words), "{words}");
    }
    assert!(!alone.contains("expected, \u{b1}") && !alone.contains("Plan beside"), "of a primitive that is not given");
    // No network: but for the name of SVG itself there is no address, nor anything that loads one.
    assert!(!html.replace("http://www.w3.org/2000/svg", "").contains("://"));
    assert!(!html.contains("<script") && !html.contains("<link") && !html.contains("url("));
    assert!(html.len() < 2_000_000, "{} bytes", html.len());
    // The band goes from 2 N - 2 x 3 N to 2 N + 2 x 3 N, and the axis shows all of it and the 31 N measured.
    assert_eq!(html.matches("<svg").count(), html.matches("viewBox").count());
}

#[test]
fn every_run_is_named_in_the_legend_beside_its_look() {
    let folder = tempfile::tempdir().unwrap();
    let names = ["1.csv", "2.csv", "3.csv", "4.csv", "5.csv", "6.csv"];
    let runs = names.map(|name| ReportedRun::read(&recorded(folder.path(), name, None), None).unwrap());
    let html = page("reach", &runs, None);
    assert!(html.contains(">1.csv, 5.csv<") && html.contains(">2.csv, 6.csv<") && html.contains(">3.csv<"));
}

/// Two recordings as one: a program that looked on wrote both runs, with a second of rest between them.
fn joined(folder: &Path, first: &Path, second: &Path) -> PathBuf {
    let text = |file: &Path| std::fs::read_to_string(file).unwrap();
    let (first, second) = (text(first), text(second));
    let last = first.lines().last().unwrap();
    let cycle = |line: &str| line.split(',').next().and_then(|field| field.parse::<u32>().ok());
    let mut lines: Vec<String> = first.lines().map(str::to_owned).collect();
    let next = cycle(last).unwrap() + 1;
    for (next, line) in (next..).zip(second.lines().filter(|line| cycle(line).is_some())) {
        let mut fields: Vec<String> = line.split(',').map(str::to_owned).collect();
        fields[0] = next.to_string();
        // The first cycle of a recording is number 1000.
        fields[1] = (f64::from(next - 1000) / control::RATE).to_string();
        lines.push(fields.join(","));
    }
    let file = folder.join("joined.csv");
    std::fs::write(&file, lines.join("\n") + "\n").unwrap();
    file
}

/// The change that makes it fail: all that was played counts as one run, whatever the arm did in between.
#[test]
fn of_two_runs_in_one_recording_the_last_is_told_and_the_way_back_is_no_gap() {
    let folder = tempfile::tempdir().unwrap();
    let failed = recorded(folder.path(), "first.csv", Some((State::SoftStop, Fault::ContactForce)));
    let good = recorded(folder.path(), "second.csv", None);
    let alone = ReportedRun::read(&good, None).unwrap();
    let run = ReportedRun::read(&joined(folder.path(), &failed, &good), None).unwrap();
    assert_eq!(run.missing, 0);
    assert!((run.duration() - alone.duration()).abs() < 1e-6, "{} s, {} s", run.duration(), alone.duration());
    assert_eq!(run.tracking, alone.tracking);
    let surprise = |run: &ReportedRun| {
        let found = run.happenings.iter().rfind(|happening| happening.words.contains("successful"));
        found.map(|happening| (happening.time * control::RATE).round())
    };
    assert_eq!(surprise(&run), surprise(&alone), "times count from the beginning of the run that is told");
    let html = page("joined", &[run], None);
    assert!(html.contains("the last of 2 runs in the recording"), "a stranger has to know of the other one");
    assert!(!page("alone", &[alone], None).contains("runs in the recording"));
}

/// The change that makes it fail: state `coast` alone is taken for a run.
#[test]
fn a_lost_reply_before_or_behind_a_run_is_no_part_of_it() {
    let folder = tempfile::tempdir().unwrap();
    let coasting = |end: Option<(State, Fault)>| {
        let text = std::fs::read_to_string(recorded(folder.path(), "run.csv", end)).unwrap();
        let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
        let first = lines.iter().position(|line| line.starts_with("cycle,")).unwrap() + 1;
        let count = lines.len();
        for (at, line) in lines.iter_mut().enumerate().skip(first) {
            let mut fields: Vec<&str> = line.split(',').collect();
            if at == first + 10 || at == count - 20 {
                fields[2] = State::Coast.name();
            } else if at + 40 > count {
                // A person has cleared the fault.
                (fields[2], fields[3]) = (State::Hold.name(), "0");
            }
            *line = fields.join(",");
        }
        let file = folder.path().join("coasting.csv");
        std::fs::write(&file, lines.join("\n") + "\n").unwrap();
        ReportedRun::read(&file, None).unwrap()
    };
    let touched = coasting(Some((State::SoftStop, Fault::ContactForce)));
    assert_eq!(touched.outcome, Outcome::Faulted(Fault::ContactForce));
    let arrived = coasting(None);
    assert_eq!(arrived.outcome, Outcome::ArrivedUnlike);
    assert!((arrived.duration() - 4.0).abs() < 0.01, "{} s", arrived.duration());
    assert_eq!(arrived.missing, 0);
}

/// The change that makes it fail: state `coast` without a run is taken for a run.
#[test]
fn a_fault_on_the_way_to_the_start_is_named_and_all_that_was_recorded_is_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let mut rows = common::rows(4.0);
    let last = rows.len() - 1;
    for (at, row) in rows.iter_mut().enumerate() {
        let state = match last - at {
            0 => State::SoftStop,
            1..6 => State::Coast,
            _ => State::Approach,
        };
        row.telemetry.state = state.code();
        row.telemetry.fault = if at == last { Fault::RepliesLost.code() } else { 0 };
        row.telemetry.phase = 0.0;
    }
    let file = folder.path().join("fault.csv");
    std::fs::write(&file, common::text(&rows)).unwrap();
    assert!(Recording::read(&file).unwrap().runs().is_empty());
    let run = ReportedRun::read(&file, None).unwrap();
    assert_eq!(run.outcome, Outcome::FaultedBefore(Fault::RepliesLost));
    assert!(run.duration() > 4.0, "{} s of {} samples", run.duration(), rows.len());
    let shown = page("fault", &[run], None);
    assert!(shown.contains("RepliesLost") && !shown.contains("came to"));
    assert!(shown.contains("time (s)") && !shown.contains("progress of the movement (%)"));
}
