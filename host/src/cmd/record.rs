//! `tactus record`: writes down what the arm does, without asking it to do anything.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;

use super::files::{self, RecordingFile};
use super::{Failure, Global, connection, teach};
use lab::procedure::{ProcedureError, Recorder};

/// Options of `record`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// Where the recording goes, CSV (see docs/recording-format.md)
    #[arg(long, short, value_name = "FILE", default_value = "recording.csv")]
    pub output: PathBuf,
    /// Duration, 0.2 to 3600 s
    #[arg(
        long,
        value_name = "SECONDS",
        default_value = "10",
        value_parser = teach::recorded,
        allow_hyphen_values = true
    )]
    pub duration: f64,
}

/// Records telemetry of every control cycle.
///
/// # Errors
/// The device cannot be reached, or the file cannot be written.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "record";
    let output = global.output();
    let mut file = RecordingFile::create(&command.output, global, &[], DOING)?;
    let started = Instant::now();
    let mut client = if global.is_simulated_here() {
        // It has just been switched on: without this there would be nothing to see.
        let mut client = connection::open(global, DOING, |_| {})?;
        connection::ready(&mut client, false, output, DOING)?;
        client
    } else {
        connection::observe(global, DOING)?
    };
    let wanted = (command.duration * lab::demonstration::RATE).round() as usize;
    let bar = output.bar(command.duration.ceil() as u64, "s", "recording");
    let notes = format!("Tactus recording, {} Hz\n{}", control::RATE_HZ, files::origin(&client, None));
    file.expect_notes(&notes);
    let mut record = || -> Result<usize, ProcedureError> {
        let mut recorder = Recorder::start(&mut client, &mut file.file, &notes)?;
        while recorder.rows() < wanted {
            recorder.take(&mut client)?;
            bar.set_position((recorder.rows() as f64 / lab::demonstration::RATE) as u64);
        }
        let rows = recorder.rows();
        recorder.finish(&mut client)?;
        Ok(rows)
    };
    let recorded = record();
    bar.finish_and_clear();
    let gaps = client.gaps().telemetry;
    connection::tell_speed(&client, started, output);
    let rows = file.end(recorded.map_err(|error| connection::failed(&mut client, error, DOING)), output)?;
    output.result(
        &Recorded { file: files::text(&command.output), samples: rows, gaps },
        format!("{rows} samples, {gaps} lost"),
    )
}

/// Data of `tactus --json record`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Recorded {
    /// The file that was written.
    pub file: String,
    /// Cycles in it.
    pub samples: usize,
    /// Cycles that were lost on the way.
    pub gaps: u32,
}
