//! `tactus check`: validates a primitive before it moves an arm.

use std::path::{Path, PathBuf};

use clap::Args;

use super::{Exit, Failure, Global};
use crate::check;
use lab::primitive_file::{PrimitiveFile, PrimitiveFileError};

/// Options of `check`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// The primitive, TOML
    #[arg(value_name = "PRIMITIVE")]
    pub primitive: PathBuf,
    /// Speed factor at which it will be run, 0.1 to 2
    #[arg(long, default_value_t = 1.0, value_parser = factor)]
    pub speed: f64,
}

/// Checks the primitive; a violation ends with exit code 6.
///
/// # Errors
/// The file is wrong, or the check found a violation.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    let output = global.output();
    let file = PrimitiveFile::read(&command.primitive).map_err(|cause| failure(cause, &command.primitive, "check"))?;
    let bar = output.bar(100, "playing the plan");
    let report = check::check(&file, command.speed, |fraction| bar.set_position((fraction * 100.0) as u64))
        .map_err(|cause| failure(cause, &command.primitive, "check"))?;
    bar.finish_and_clear();
    if report.passed() {
        return output.result(&report, report.to_text());
    }
    let reason = format!("{} violation(s), the first: {}", report.violations.len(), report.violations[0]);
    if !global.json {
        output.result(&report, report.to_text())?;
    }
    let failure = Failure::new(Exit::Invalid, "E631", format!("check failed: {}", command.primitive.display()), reason)
        .help("run it more slowly (`--speed 0.5`), or show the movement farther from the limits and learn it again");
    Err(match serde_json::to_value(&report) {
        Ok(data) => failure.data(data),
        Err(_) => failure,
    })
}

/// The failure of a command that was `doing` something with a primitive file.
pub(super) fn failure(cause: PrimitiveFileError, path: &Path, doing: &str) -> Failure {
    let (exit, code, help) = match &cause {
        PrimitiveFileError::Model { .. } => (Exit::Incompatible, "E430", "learn the primitive again with this version"),
        PrimitiveFileError::ExpectationModel { .. } | PrimitiveFileError::ExpectationDuration { .. } => {
            let help = format!("record it again: `tactus rehearse {}`", path.display());
            return Failure::new(Exit::Invalid, "E634", format!("{doing} refused {}", path.display()), cause)
                .help(help);
        }
        PrimitiveFileError::Schema { .. } => {
            (Exit::Incompatible, "E431", "learn the primitive again with this version")
        }
        PrimitiveFileError::Checksum { .. } => {
            (Exit::Invalid, "E632", "the file was changed or damaged: learn the primitive again from its demonstration")
        }
        PrimitiveFileError::Image { .. } | PrimitiveFileError::Invalid { .. } => {
            (Exit::Invalid, "E633", "learn the primitive again, see `tactus learn --help`")
        }
        _ => (Exit::Invalid, "E630", "`tactus learn DEMO -o FILE` writes a primitive"),
    };
    Failure::new(exit, code, format!("{doing} refused {}", path.display()), cause).help(help)
}

/// A speed factor the device takes.
pub(super) fn factor(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(factor) if (0.1..=2.0).contains(&factor) => Ok(factor),
        _ => Err("a speed factor between 0.1 and 2 is expected".to_owned()),
    }
}
