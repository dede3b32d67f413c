//! `tactus check`: validates a primitive before it moves an arm.

use std::path::{Path, PathBuf};

use clap::Args;

use super::{ErrorCode, Failure, Global};
use crate::check::{self, Course};
use lab::demonstration::Recording;
use lab::primitive_file::{PrimitiveFile, PrimitiveFileError};
use lab::quoted;
use link::Goal;

/// Options of `check`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// The primitive, TOML
    #[arg(value_name = "PRIMITIVE")]
    pub primitive: PathBuf,
    /// Speed factor at which it will be run, 0.1 to 2
    #[arg(long, default_value_t = 1.0, value_parser = factor, allow_hyphen_values = true)]
    pub speed: f64,
    /// Another goal of the grasp point, world frame, m
    #[arg(long, value_name = "X,Y,Z", value_parser = super::learn::numbers::<3>, allow_hyphen_values = true)]
    pub goal: Option<[f64; 3]>,
}

/// Checks the primitive; a violation ends with exit code 6.
///
/// # Errors
/// The file is wrong, or the check found a violation.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    let output = global.output();
    let file = read(&command.primitive, "check")?;
    let bar = output.bar(100, "%", "playing the plan");
    let course = Course { goal: goal(command.goal), ..Course::stored(command.speed) };
    let report = check::check(&file, &course, |fraction| bar.set_position((fraction * 100.0) as u64))
        .map_err(|cause| failure(cause, &command.primitive, "check"))?;
    bar.finish_and_clear();
    report.warnings.iter().for_each(|warning| output.warn(warning));
    if report.passed() {
        return output.result(&report, report.to_text());
    }
    let reason = format!("{} violation(s), the first: {}", report.violations.len(), report.violations[0]);
    if !global.json {
        output.result(&report, report.to_text())?;
    }
    let failure =
        Failure::new(ErrorCode::CheckFailed, format!("check failed: {}", command.primitive.display()), reason)
            .help(report.advice());
    Err(match serde_json::to_value(&report) {
        Ok(data) => failure.data(data),
        Err(_) => failure,
    })
}

/// The primitive in a file, for a command that is `doing` something with it.
///
/// # Errors
/// It is none.
pub(super) fn read(path: &Path, doing: &str) -> Result<PrimitiveFile, Failure> {
    PrimitiveFile::read(path).map_err(|cause| failure(cause, path, doing))
}

/// The failure of a command that was `doing` something with a primitive file, which `cause` names.
pub(super) fn failure(cause: PrimitiveFileError, path: &Path, doing: &str) -> Failure {
    let refused = format!("{doing} refused");
    let code = match &cause {
        PrimitiveFileError::Model { .. } => ErrorCode::PrimitiveModel,
        PrimitiveFileError::ExpectationModel { .. }
        | PrimitiveFileError::ExpectationDuration { .. }
        | PrimitiveFileError::ExpectationFilter { .. } => {
            return Failure::new(ErrorCode::ExpectationStale, refused, cause)
                .help(format!("record it again: `tactus rehearse {}`", quoted::path(path)));
        }
        PrimitiveFileError::StatisticsAlone { .. } => {
            let help =
                format!("`tactus rehearse {}` records an expectation; then gather them again", quoted::path(path));
            return Failure::new(ErrorCode::NoExpectation, refused, cause).help(help);
        }
        PrimitiveFileError::Io { .. } if !path.exists() && path.with_extension("toml").is_file() => {
            let help = format!("there is a file {}", path.with_extension("toml").display());
            return Failure::of_file(ErrorCode::PrimitiveUnreadable, refused, cause).help(help);
        }
        PrimitiveFileError::Syntax { .. } if Recording::read(path).is_ok() => {
            let help = format!("this is a recording: `tactus learn {}` makes a primitive of it", quoted::path(path));
            return Failure::new(ErrorCode::PrimitiveUnreadable, refused, cause).help(help);
        }
        PrimitiveFileError::Schema { .. } => ErrorCode::PrimitiveSchema,
        PrimitiveFileError::Checksum { .. } => ErrorCode::PrimitiveChecksum,
        PrimitiveFileError::Image { .. } | PrimitiveFileError::Invalid { .. } => ErrorCode::PrimitiveInvalid,
        _ => ErrorCode::PrimitiveUnreadable,
    };
    Failure::of_file(code, refused, cause)
}

/// A goal of the grasp point (m), or the stored one.
pub(super) fn goal(position: Option<[f64; 3]>) -> Goal {
    Goal { position: position.map(|place| place.map(|value| value as f32)), orientation: None }
}

/// A speed factor the device takes.
pub(super) fn factor(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(factor) if (0.1..=2.0).contains(&factor) => Ok(factor),
        _ => Err("a speed factor between 0.1 and 2 is expected".to_owned()),
    }
}
