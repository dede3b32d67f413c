//! `tactus learn`: a primitive from a demonstration.

use std::path::PathBuf;

use clap::Args;
use control::plan::load::LONGEST_MOVEMENT;
use schemars::JsonSchema;
use serde::Serialize;

use super::{ErrorCode, Failure, Global, files};
use lab::demonstration::{DemonstrationError, Preparation, Recording, RecordingError};
use lab::learn::feedback::FeedbackOptions;
use lab::learn::hand::HandMotion;
use lab::learn::{self, LearnError, LearnOptions};
use lab::primitive_file::OrientationError;
use lab::quoted;

/// Usual cut-off of the filter, Hz.
const CUTOFF: f64 = 7.5;

/// An arm that went farther than this (m) in a recording without moving fast enough for a movement was led slowly.
const SLOW_EXTENT: f64 = 0.02;

/// Usual speed below which the arm counts as still, m/s.
const STILL_SPEED: f64 = 0.005;

/// Usual fractions of the duration between which the fingers move.
const HAND_WINDOW: [f64; 2] = [0.6, 1.0];

/// Options of `learn`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// The demonstration, CSV with a header of names and units
    #[arg(value_name = "DEMO")]
    pub demonstration: PathBuf,
    /// Where to write the primitive [default: DEMO with the ending .toml]
    #[arg(long, short, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Name of the primitive on the device [default: name of the output file]
    #[arg(long)]
    pub name: Option<String>,
    /// Kernels of each row, 2 to 100
    #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u16).range(2..=100))]
    pub kernels: u16,
    /// Cut-off of the zero-phase filter on the demonstration, Hz, below 150
    #[arg(long, default_value_t = CUTOFF, value_name = "HZ", value_parser = number, allow_hyphen_values = true)]
    pub cutoff: f64,
    /// Use the rotation vector as orientation error: for movements that turn more than 150 degrees
    #[arg(long)]
    pub rotation_vector: bool,
    /// Speed below which the arm counts as still before and behind the movement, m/s, at most 1
    #[arg(long, default_value_t = STILL_SPEED, value_name = "M_PER_S", value_parser = number, allow_hyphen_values = true)]
    pub still_speed: f64,
    /// Speed of the movement that is learned, of the one that was shown, 0.1 to 10; a dwell keeps its time
    #[arg(long, default_value_t = 1.0, value_name = "FACTOR", value_parser = number, allow_hyphen_values = true)]
    pub speed: f64,
    /// Learn the whole recording, with the time in which the arm stands still
    #[arg(long, conflicts_with = "still_speed")]
    pub no_trim: bool,
    /// Hand at the start: spread and fingers 1 to 3, rad
    #[arg(long, value_name = "S,F1,F2,F3", default_value = "0,0,0,0", value_parser = hand, allow_hyphen_values = true)]
    pub hand_start: [f64; 4],
    /// Hand at the end: spread and fingers 1 to 3, rad
    #[arg(long, value_name = "S,F1,F2,F3", default_value = "0,0,0,0", value_parser = hand, allow_hyphen_values = true)]
    pub hand_goal: [f64; 4],
    /// Rest at the goal behind the movement, at most 60 s: time for the fingers to close
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0, value_parser = number, allow_hyphen_values = true)]
    pub dwell: f64,
    /// Fractions of the duration, the dwell included, between which the fingers move [default: 0.6,1]
    #[arg(long, value_name = "BEGIN,END", value_parser = numbers::<2>, allow_hyphen_values = true)]
    pub hand_window: Option<[f64; 2]>,
    /// Spring K of the position [default: 400 for 12 s, growing with the square of the duration, at least 200]
    #[arg(long, value_name = "K", value_parser = number, allow_hyphen_values = true)]
    pub stiffness: Option<f64>,
    /// Spring K of the orientation [default: 200 for 12 s, likewise]
    #[arg(long, value_name = "K", value_parser = number, allow_hyphen_values = true)]
    pub orientation_stiffness: Option<f64>,
    /// Sensitivity K1 to forces (position, world axes) and torques (rotation, hand axes), optionally spread and fingers
    /// [default: 0.8 K in the horizontal, 3.7 K about the vertical at the goal, fingers 0.3 K]
    #[arg(long, value_name = "X,Y,Z,RX,RY,RZ[,SPREAD,F1,F2,F3]", value_parser = sensitivity, allow_hyphen_values = true)]
    pub k1: Option<Sensitivity>,
    /// Farthest that feedback may move the plan: metres, degrees, and radians of the fingers
    #[arg(long, value_name = "METRES,DEGREES,RAD", default_value = "0.25,25,0.6", value_parser = numbers::<3>, allow_hyphen_values = true)]
    pub clamp: [f64; 3],
}

/// K1 of the ten rows that force can bend.
pub type Sensitivity = [f64; 10];

/// Learns and writes the primitive.
///
/// # Errors
/// The demonstration or an option is wrong, or the file cannot be written.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    let output = global.output();
    if command.demonstration.is_dir() {
        let cause = std::io::Error::from(std::io::ErrorKind::IsADirectory);
        let doing = format!("learn refused {}", command.demonstration.display());
        return Err(Failure::of_file(ErrorCode::RecordingInvalid, doing, cause).help("name a recording in this folder"));
    }
    let file = command.output.clone().unwrap_or_else(|| command.demonstration.with_extension("toml"));
    let name = match &command.name {
        Some(name) => name.clone(),
        None => file.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default(),
    };
    if let Err(error) = super::rename::new_name(&name) {
        if command.name.is_none() {
            // A place that is none for a file has no name to give either.
            drop(files::create(&file, global, &[&command.demonstration], "learn")?);
        }
        return Err(Failure::new(ErrorCode::NameInvalid, format!("learn: the name `{name}`"), error));
    }
    if command.hand_window.is_some() && command.hand_start == command.hand_goal {
        let cause = "--hand-window: the fingers do not move, from `--hand-start` to `--hand-goal` there is no way";
        return Err(Failure::new(ErrorCode::LearnOption, "learn refused", cause)
            .help("give the fingers another end with `--hand-goal`, or leave `--hand-window` out"));
    }
    let options = LearnOptions {
        name,
        kernels: usize::from(command.kernels),
        cutoff: command.cutoff,
        preparation: Preparation { still_speed: (!command.no_trim).then_some(command.still_speed) },
        speed: command.speed,
        orientation_error: if command.rotation_vector {
            OrientationError::RotationVector
        } else {
            OrientationError::Quaternion
        },
        dwell: command.dwell,
        hand: HandMotion {
            start: command.hand_start,
            goal: command.hand_goal,
            window: command.hand_window.unwrap_or(HAND_WINDOW).into(),
        },
        feedback: FeedbackOptions {
            stiffness: command.stiffness,
            orientation_stiffness: command.orientation_stiffness,
            hand_stiffness: None,
            sensitivity: command.k1,
            limits: Some(command.clamp),
        },
    };
    let target = files::create(&file, global, &[&command.demonstration], "learn")?;
    let spinner = output.spinner("learning");
    let recording = Recording::read(&command.demonstration)
        .map_err(|cause| Failure::of_file(ErrorCode::RecordingInvalid, "learn refused", cause))?;
    let learned = learn::learn(&recording, &file, &options).map_err(|error| failure(error, command))?;
    let text = learned.primitive.checked_text().map_err(|cause| super::check::failure(cause, &file, "learn"))?;
    files::fill(target, text.as_bytes(), "learn: the primitive cannot be written")?;
    spinner.finish_and_clear();
    for warning in &learned.report.warnings {
        output.warn(warning);
    }
    output.say(format!("wrote {}", file.display()));
    output.result(
        &Fitted {
            file: files::text(&file),
            checksum: format!("0x{:08x}", learned.primitive.checksum()),
            fit: &learned.report,
        },
        learned.report.to_text(),
    )
}

/// Data of `tactus --json learn`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Fitted<'a> {
    /// The file that was written.
    pub file: String,
    /// Check sum of its content, hexadecimal.
    pub checksum: String,
    /// Errors of the primitive against the demonstration.
    pub fit: &'a lab::learn::report::FitReport,
}

fn failure(error: LearnError, command: &Cmd) -> Failure {
    let help = match &error {
        LearnError::TurnsTooFar { rotation_vector_helps: true, .. } => Some(again("--rotation-vector")),
        LearnError::Demonstration(DemonstrationError::Still { .. }) if command.still_speed > STILL_SPEED => {
            Some(format!("a lower `--still-speed` ({STILL_SPEED} m/s is usual)"))
        }
        LearnError::Poor { .. } | LearnError::Fit { .. } if command.cutoff < CUTOFF => {
            Some(format!("a higher `--cutoff` ({CUTOFF} Hz is usual): the filter takes the movement away"))
        }
        LearnError::Demonstration(DemonstrationError::Still { extent, duration, .. }) if *extent > SLOW_EXTENT => {
            let is_playable = duration / command.speed + command.dwell <= LONGEST_MOVEMENT;
            Some(if is_playable { again_whole() } else { "show it faster, or in parts".to_owned() })
        }
        LearnError::Demonstration(DemonstrationError::Recording(RecordingError::NoRadians { .. })) => {
            Some("convert the joint angles to radians".to_owned())
        }
        LearnError::Demonstration(DemonstrationError::Recording(RecordingError::NoSeconds { .. })) => {
            Some("convert the times to seconds".to_owned())
        }
        LearnError::Demonstration(DemonstrationError::Duration { duration, .. }) => Some(
            if *duration < LONGEST_MOVEMENT { "show it more slowly" } else { "show it faster, or in parts" }.to_owned(),
        ),
        _ => None,
    };
    let code = match &error {
        LearnError::Option { .. } => ErrorCode::LearnOption,
        LearnError::Demonstration(_) => ErrorCode::NoDemonstration,
        LearnError::TurnsTooFar { .. } => ErrorCode::TurnsTooFar,
        LearnError::Fit { .. } => ErrorCode::FitFailed,
        LearnError::Poor { .. } => ErrorCode::FitPoor,
        LearnError::Primitive(_) => ErrorCode::LearnedInvalid,
    };
    let failure = Failure::new(code, "learn refused", error);
    match help {
        Some(help) => failure.help(help),
        None => failure,
    }
}

/// The words of this command line.
fn given() -> Vec<String> {
    std::env::args_os().skip(1).map(|word| word.to_string_lossy().into_owned()).collect()
}

/// The command line once more, with another option: all that was asked for beside it, wherever it stands, must not be
/// lost.
fn again(option: &str) -> String {
    again_with(given(), option)
}

/// The command line once more for the whole recording, of which no speed says any more what belongs to the movement.
fn again_whole() -> String {
    again_with(without(given(), "--still-speed"), "--no-trim")
}

/// These words without an option and its value.
fn without(mut words: Vec<String>, option: &str) -> Vec<String> {
    let end = words.iter().position(|word| word == "--").unwrap_or(words.len());
    let joined = |word: &str| word.strip_prefix(option).is_some_and(|rest| rest.starts_with('='));
    if let Some(at) = words[..end].iter().position(|word| word == option) {
        words.drain(at..end.min(at + 2));
    } else if let Some(at) = words[..end].iter().position(|word| joined(word)) {
        words.remove(at);
    }
    words
}

/// These words with another option, which stands before a `--`: behind it nothing is one.
fn again_with(mut words: Vec<String>, option: &str) -> String {
    let end = words.iter().position(|word| word == "--").unwrap_or(words.len());
    words.insert(end, option.to_owned());
    let words: Vec<String> = words.iter().map(|word| quoted::text(word)).collect();
    format!("tactus {}", words.join(" "))
}

/// Six or ten gains; without the last four force does not bend the fingers.
fn sensitivity(text: &str) -> Result<Sensitivity, String> {
    if text.split(',').count() == 6 {
        let arm = numbers::<6>(text)?;
        return Ok(std::array::from_fn(|row| arm.get(row).copied().unwrap_or(0.0)));
    }
    numbers::<10>(text).map_err(|reason| format!("{reason}, or only the first 6"))
}

/// Two turns, rad: no digit goes half as far, but an angle in degrees is mostly larger.
const NO_RADIANS: f64 = 4.0 * std::f64::consts::PI;

/// Spread and fingers 1 to 3, rad. The check of the primitive says how far they can go.
fn hand(text: &str) -> Result<[f64; 4], String> {
    let angles = numbers::<4>(text)?;
    match angles.into_iter().find(|angle| angle.abs() > NO_RADIANS) {
        Some(angle) => Err(format!("no digit turns as far as {angle} rad: are these degrees? Radians are expected")),
        None => Ok(angles),
    }
}

/// A number. Whoever writes a comma in it is told; the learner says which numbers will do.
fn number(text: &str) -> Result<f64, String> {
    text.parse().map_err(|_| format!("`{text}` is not a number, such as 7.5 with a point"))
}

/// Numbers separated by commas.
pub(super) fn numbers<const COUNT: usize>(text: &str) -> Result<[f64; COUNT], String> {
    let values: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse::<f64>()).collect();
    let values = values.map_err(|_| format!("`{text}` is not a list of numbers separated by commas"))?;
    if values.iter().any(|value| !value.is_finite()) {
        return Err("every number must be finite".to_owned());
    }
    let found = values.len();
    values.try_into().map_err(|_| format!("{COUNT} numbers are expected, {found} are given"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The change that makes it fail: the option is put where `learn` stands, and what stands before that is left out.
    #[test]
    fn a_command_line_is_repeated_with_all_that_was_asked_for() {
        let again = |line: &str| again_with(line.split(' ').map(str::to_owned).collect(), "--no-trim");
        assert_eq!(again("--force learn a.csv"), "tactus --force learn a.csv --no-trim");
        assert_eq!(again("--device learn learn -- -a.csv"), "tactus --device learn learn --no-trim -- -a.csv");
        assert_eq!(again_with(vec!["learn".to_owned(), "my a.csv".to_owned()], "-x"), "tactus learn 'my a.csv' -x");
    }

    /// The change that makes it fail: an option without a parser of its own, of which is told: invalid float literal.
    #[test]
    fn a_number_with_a_comma_is_told_to_have_none() {
        #[derive(Debug, clap::Parser)]
        struct Line {
            #[command(flatten)]
            command: Cmd,
        }
        for option in ["cutoff", "still-speed", "speed", "dwell", "stiffness", "orientation-stiffness"] {
            let line = ["learn", "a.csv", &format!("--{option}"), "0,5"];
            let told = <Line as clap::Parser>::try_parse_from(line).unwrap_err().to_string();
            assert!(told.contains("`0,5` is not a number, such as 7.5 with a point"), "{option}: {told}");
        }
        assert_eq!(number("0.5"), Ok(0.5));
    }

    #[test]
    fn an_option_is_left_out_with_its_value_and_a_file_of_its_name_is_none() {
        let rest = |line: &str| without(line.split(' ').map(str::to_owned).collect(), "--still-speed").join(" ");
        assert_eq!(rest("learn --still-speed 0.001 a.csv"), "learn a.csv");
        assert_eq!(rest("learn a.csv --still-speed=0.001 -o b.toml"), "learn a.csv -o b.toml");
        assert_eq!(rest("learn -- --still-speed"), "learn -- --still-speed");
    }
}
