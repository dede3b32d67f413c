//! Results that an experiment cannot go on with, and the options with which it could.

use std::io::ErrorKind;
use std::path::Path;

use experiment::header::Difference;
use experiment::log::ResultsError;
use experiment::{Cell, Grid, Mode, Scenario};
use sim::world::ObjectKind;

use super::{Cmd, ErrorCode, Failure};
use lab::quoted;

/// The command, in front of what it failed with.
pub(super) const DOING: &str = "experiment";
/// The same where it did not begin.
pub(super) const REFUSED: &str = "experiment refused";

/// Advice that loses nothing, where nothing better is known.
const ELSEWHERE: &str = "choose another folder with `--out`";

/// A change of the command line.
enum Change {
    Give(String),
    LeaveOut(&'static str),
}

/// The failure of the results in the folder that this command named.
pub(super) fn of(error: ResultsError, command: &Cmd) -> Failure {
    match &error {
        ResultsError::Exists { .. } => Failure::new(ErrorCode::ResultsExist, REFUSED, error),
        ResultsError::OtherConfiguration { differences, .. } => {
            let advice = advice(command, differences);
            Failure::new(ErrorCode::OtherExperiment, REFUSED, error).help(advice)
        }
        ResultsError::None { .. } => Failure::new(ErrorCode::NoResults, REFUSED, error),
        ResultsError::Line { .. } => Failure::new(ErrorCode::ResultsDamaged, REFUSED, error),
        ResultsError::Place(place) => {
            Failure::new(place.code(), REFUSED, error).help("choose another folder with `--out`")
        }
        ResultsError::File { cause, .. } => match cause.kind() {
            ErrorKind::ResourceBusy => Failure::new(ErrorCode::FileFailed, REFUSED, error)
                .help("wait for the other experiment in this folder, or choose another one with `--out`"),
            ErrorKind::AlreadyExists | ErrorKind::NotADirectory => {
                Failure::new(ErrorCode::OutputNotAFile, REFUSED, error).help("name a folder with `--out`")
            }
            _ => Failure::of_file(ErrorCode::ResultsNotWritten, DOING, error),
        },
    }
}

/// The failure of a mode that compares forces with what a primitive expects, which has nothing of the kind.
pub(super) fn without_expectation(file: &Path, mode: Mode) -> Failure {
    let cause = format!("{}: the primitive has no expected forces", file.display());
    Failure::new(ErrorCode::NoExpectation, format!("{REFUSED}: mode {mode}"), cause)
        .help(format!("`tactus rehearse {}`, or `--modes a` alone", quoted::path(file)))
}

/// The warning of runs at speeds at which the expectation is believed in part or not at all; `trust` says how far, 1
/// to 0. They are no error: how much that costs is what such an experiment tells.
pub(super) fn disbelieved(speeds: &[f64], trust: impl Fn(f64) -> f64) -> Option<String> {
    let told: Vec<String> = speeds
        .iter()
        .filter_map(|speed| match trust(*speed) {
            trust if trust >= 1.0 => None,
            trust if trust > 0.0 => Some(format!("at speed {speed} with {:.0} %", trust * 100.0)),
            _ => Some(format!("at speed {speed} not at all")),
        })
        .collect();
    let told = Some(told.join(", ")).filter(|told| !told.is_empty())?;
    Some(format!(
        "the expected forces were recorded at another speed and are believed {told}: the adaptation is derated"
    ))
}

/// The change of the command line after which it is one for the results that are there; another folder where there is
/// none. Nothing is ever to be removed: results may have taken days.
fn advice(command: &Cmd, differences: &[Difference]) -> String {
    if differences.iter().all(|difference| difference.name == experiment::header::CODE) {
        return format!("{ELSEWHERE}; `--figures-only` draws the results that are there");
    }
    let changes: Option<Vec<Vec<Change>>> = differences.iter().map(|difference| changes(command, difference)).collect();
    let changes: Vec<Change> = changes.unwrap_or_default().into_iter().flatten().collect();
    let (mut given, mut left_out) = (Vec::new(), Vec::new());
    for change in &changes {
        match change {
            Change::Give(option) => given.push(option.as_str()),
            Change::LeaveOut(option) => left_out.push(format!("`{option}`")),
        }
    }
    let (given, left_out) = (given.join(" "), left_out.join(", "));
    match (given.is_empty(), left_out.is_empty()) {
        (true, true) => ELSEWHERE.to_owned(),
        (false, true) => format!("give `{given}`, as for these results; or {ELSEWHERE}"),
        (true, false) => format!("leave out {left_out}, as for these results; or {ELSEWHERE}"),
        (false, false) => format!("give `{given}` and leave out {left_out}, as for these results; or {ELSEWHERE}"),
    }
}

/// The changes that undo one difference; `None` if no option does.
fn changes(command: &Cmd, Difference { name, was, is }: &Difference) -> Option<Vec<Change>> {
    let give = |option: &str| Some(vec![Change::Give(format!("{option} {was}"))]);
    let leave_out = |option| Some(vec![Change::LeaveOut(option)]);
    // The results say by themselves what figures are of: a difference is one that was asked for.
    let is_asked = command.figures_only;
    match name.as_str() {
        "cells" => cells(command, was),
        "object" if is_asked && command.object.is_some() => leave_out("--object"),
        "object" if *was == *command.scenario.object().name() => leave_out("--object"),
        "object" if was.parse::<ObjectKind>().is_ok() => give("--object"),
        "object" => Some(vec![Change::Give("--object FILE".to_owned())]),
        "plant" if is_asked => leave_out("--plant"),
        "plant" => give("--plant"),
        // Cases and sweeps vary by themselves.
        "variation" if command.scenario == Scenario::Lift || command.sweep.is_some() => None,
        "variation" if is_asked || was == experiment::header::NO_VARIATION => leave_out("--vary"),
        "variation" => give("--vary"),
        "arms" if was == "weighed" => Some(vec![Change::Give("--calibrated".to_owned())]),
        "arms" => leave_out("--calibrated"),
        "engine" => {
            let device = device(was)?;
            (Some(device) != self::device(is)).then(|| vec![Change::Give(format!("--device {device}"))])
        }
        _ => None,
    }
}

/// The changes after which the cells are these.
fn cells(command: &Cmd, words: &str) -> Option<Vec<Change>> {
    let cells: Vec<Cell> = words.split(' ').map(|cell| cell.parse().ok()).collect::<Option<_>>()?;
    let grid = Grid { cells };
    let mut changes = Vec::new();
    if command.figures_only || grid == command.scenario.grid() {
        if command.grid.is_some() {
            changes.push(Change::LeaveOut("--grid"));
        }
    } else {
        changes.push(Change::Give(format!("--grid {}", grid.option())));
    }
    let moves = [(command.rotate != 0.0, "--rotate"), (command.shift != [0.0; 2], "--shift")];
    changes.extend(moves.into_iter().filter(|(is_given, _)| *is_given).map(|(_, option)| Change::LeaveOut(option)));
    Some(changes)
}

/// The device whose engine a header describes in these words.
fn device(engine: &str) -> Option<&'static str> {
    match engine {
        "in this process" => Some("sil:"),
        under if under.ends_with("under QEMU") => Some("sim:"),
        on if on.ends_with("on the emulated board") => Some("board:"),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        command: Cmd,
    }

    fn command(line: &str) -> Cmd {
        Line::try_parse_from(["experiment"].into_iter().chain(line.split_whitespace())).unwrap().command
    }

    fn told(line: &str, differences: &[(&str, &str, &str)]) -> String {
        let command = command(line);
        let difference = |(name, was, is): &(&str, &str, &str)| Difference {
            name: (*name).to_owned(),
            was: (*was).to_owned(),
            is: (*is).to_owned(),
        };
        advice(&command, &differences.iter().map(difference).collect::<Vec<_>>())
    }

    /// The change that makes it fail: advice to remove the folder, with its results and the primitive that was taught.
    #[test]
    fn whoever_forgets_an_option_is_told_it_and_nothing_is_to_be_removed() {
        let all = "-24:8 -20:8";
        for (line, differences, words) in [
            ("flashlight --resume", &[("cells", "-24:0 4:0", all)][..], "give `--grid 2x1`, as"),
            ("cup --resume", &[("cells", "-2.9:13.7 0:0", all)], "give `--grid -2.9:13.7,0:0`, as"),
            (
                "flashlight --resume --rotate 30",
                &[("cells", "-24:0 4:0", all), ("plant", "ideal", "perturbed")],
                "give `--grid 2x1 --plant ideal` and leave out `--rotate`, as",
            ),
            ("lift --grid 0:4 --resume", &[("cells", "0:0", "0:4")], "leave out `--grid`, as"),
            ("cup --resume", &[("variation", "mass=1.3", "none")], "give `--vary mass=1.3`, as"),
            ("cup --resume --vary mass=2", &[("variation", "none", "mass=2")], "leave out `--vary`, as"),
            ("cup --resume", &[("object", "weight", "cup")], "give `--object weight`, as"),
            ("cup --resume", &[("object", "mug 0x12345678", "cup")], "give `--object FILE`, as"),
            ("cup --resume", &[("arms", "weighed", "-")], "give `--calibrated`, as"),
            ("cup --resume", &[("engine", "firmware 0x1 under QEMU", "in this process")], "give `--device sim:`, as"),
            ("cup --figures-only --plant ideal", &[("plant", "perturbed", "ideal")], "leave out `--plant`, as"),
            ("cup --figures-only --grid 4x3", &[("cells", "0:0", all)], "leave out `--grid`, as"),
            ("cup --resume", &[("code", "0x1", "0x2")], "`--figures-only` draws"),
        ] {
            let advice = told(line, differences);
            assert!(advice.contains(words) && advice.contains("`--out`"), "{line}: {advice}");
            assert!(!advice.contains("remove"), "{advice}");
        }
        for name in ["primitive", "model", "program", "the experiment"] {
            let other = [("cells", "0:0", all), (name, "a", "b")];
            assert_eq!(told("cup --resume", &other), ELSEWHERE, "{name}");
        }
    }

    /// The change that makes it fail: the name goes into the command as it is.
    #[test]
    fn a_primitive_without_expectation_is_told_with_a_command_that_can_be_typed() {
        let failure = without_expectation(Path::new("my cup.toml"), Mode::Adaptive);
        assert_eq!(failure.code.to_string(), "E635");
        assert_eq!(failure.help.as_deref(), Some("`tactus rehearse 'my cup.toml'`, or `--modes a` alone"));
    }

    /// The changes that make it fail: a trust of 0 or of less than 1 is none to be told of.
    #[test]
    fn speeds_at_which_the_expectation_is_not_believed_are_told() {
        let trust = |speed: f64| (2.0 - speed).clamp(0.0, 1.0);
        assert_eq!(disbelieved(&[0.9, 1.0], trust), None);
        let told = disbelieved(&[1.0, 1.75, 2.0], trust).unwrap_or_default();
        assert!(told.contains("believed at speed 1.75 with 25 %, at speed 2 not at all:"), "{told}");
    }

    /// The change that makes it fail: one code for all, E124, which is that of a defect.
    #[test]
    fn what_the_user_can_mend_is_no_internal_error() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let refused = |folder: &std::path::Path| {
            let header = experiment::header::Header {
                experiment: "cup".to_owned(),
                configuration: String::new(),
                described: std::collections::BTreeMap::new(),
            };
            let opened = experiment::log::Log::open(folder, &header, true);
            opened.map_err(|error| of(error, &command("cup --resume")))
        };
        std::fs::write(at("file"), "").unwrap();
        std::fs::create_dir_all(at("nest/results.jsonl")).unwrap();
        std::fs::create_dir(at("other")).unwrap();
        std::fs::write(at("other/results.jsonl"), b"\xff\n").unwrap();
        let (log, _) = refused(&at("used")).unwrap();
        for (name, code, exit, help) in [
            ("file", "E231", 2, "name a folder"),
            ("file/below", "E231", 2, "name a folder"),
            ("nest", "E231", 2, "another folder"),
            ("other", "E661", 6, "another folder"),
            ("used", "E236", 2, "wait for the other experiment"),
        ] {
            let failure = refused(&at(name)).err().unwrap();
            assert_eq!((failure.code.to_string(), failure.code.exit() as u8), (code.to_owned(), exit), "{failure}");
            assert!(failure.help.as_ref().is_some_and(|advice| advice.contains(help)), "{failure}");
        }
        drop(log);
        let cause = ErrorKind::PermissionDenied.into();
        let failure = of(ResultsError::File { file: at("locked"), cause }, &command("cup"));
        assert_eq!(failure.code.to_string(), "E234");
    }
}
