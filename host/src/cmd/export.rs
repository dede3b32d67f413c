//! `tactus export`: a recording for the viewers of others.

use std::path::PathBuf;

use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;

use super::{ErrorCode, Failure, Global, files};
use lab::demonstration::Recording;
use lab::export;

/// Options of `export`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// A recording of `tactus teach`, `record` or `run --record`, CSV
    #[arg(value_name = "RECORDING")]
    pub recording: PathBuf,
    /// Where the file goes, MCAP
    #[arg(long, short, value_name = "FILE", default_value = "run.mcap")]
    pub output: PathBuf,
}

/// Data of `tactus --json export`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Exported {
    /// The file that was written.
    pub file: String,
    /// Cycles in it.
    pub samples: usize,
    /// Duration, s.
    pub duration_s: f64,
}

/// Exports.
///
/// # Errors
/// The recording cannot be read, or the file is there already or cannot be written.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "export";
    let file = files::create(&command.output, global, &[&command.recording], DOING)?;
    let recording =
        Recording::read(&command.recording).map_err(|cause| Failure::of_file(ErrorCode::ExportInput, DOING, cause))?;
    let bytes = export::mcap(&recording).map_err(|cause| Failure::new(ErrorCode::ExportInput, DOING, cause))?;
    files::fill(file, &bytes, DOING)?;
    let duration_s = recording.time.last().copied().unwrap_or_default() - recording.time[0];
    let exported = Exported { file: files::text(&command.output), samples: recording.time.len(), duration_s };
    let text = format!("wrote {}: {} cycles, {duration_s:.1} s", exported.file, exported.samples);
    global.output().result(&exported, text)
}
