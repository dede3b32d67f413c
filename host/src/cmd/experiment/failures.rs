//! The failures of an experiment: code, cause, and what to do next.

use std::path::Path;

use super::refusal::{self, DOING, REFUSED};
use super::{Cmd, ErrorCode, Failure};
use crate::cmd::connection;
use experiment::ExperimentError;
use experiment::preparation::PreparationError;
use experiment::trial::TrialError;

/// The failure of results that cannot be written.
pub(super) fn unwritable(file: &Path, cause: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Failure {
    let doing = format!("{DOING}: {} cannot be written", file.display());
    Failure::of_file(ErrorCode::ResultsNotWritten, doing, cause)
}

/// The failure of an experiment that this command asked for.
pub(super) fn failure(error: ExperimentError, command: &Cmd) -> Failure {
    match error {
        ExperimentError::OutOfReach(_) => Failure::new(ErrorCode::OutOfReach, REFUSED, error),
        ExperimentError::Results(error) => refusal::of(error, command),
        ExperimentError::Interrupted { .. } => {
            let help = match command.figures_only {
                true => "the same command once more makes the figures",
                false => "`--resume` goes on from here",
            };
            Failure::new(ErrorCode::Interrupted, DOING, error).help(help)
        }
        ExperimentError::Primitive(cause) => trial_failure(cause),
        ExperimentError::Trial { .. } => Failure::new(ErrorCode::TrialFailed, DOING, error),
        ExperimentError::File { .. } => Failure::of_file(ErrorCode::ResultsNotWritten, DOING, error),
    }
}

/// The failure of a trial.
pub(super) fn trial_failure(error: TrialError) -> Failure {
    match error {
        TrialError::Simulation(error) => connection::simulation_failure(error, DOING),
        TrialError::Procedure(error) => connection::failure(error, DOING),
        error @ (TrialError::Primitive(_) | TrialError::Movement(_)) => {
            Failure::new(ErrorCode::CheckFailed, REFUSED, error)
                .help("`tactus check` tells what is wrong with a primitive")
        }
    }
}

/// The failure of teaching, learning or rehearsing.
pub(super) fn preparation_failure(error: PreparationError) -> Failure {
    match error {
        PreparationError::Trial(error) => match trial_failure(error) {
            failure if failure.code != ErrorCode::Interrupted => failure,
            interrupted => interrupted.help("the same command goes on with what was taught, if it was"),
        },
        PreparationError::File(error) => Failure::of_file(ErrorCode::NotTaught, DOING, error),
        error => Failure::new(ErrorCode::NotTaught, "experiment: no primitive was made", error),
    }
}
