//! `tactus record`: writes down what the arm does, without asking it to do anything.

use std::fs::File;
use std::io::BufWriter;
use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use serde_json::json;

use super::{Failure, Global, connection, teach};
use lab::procedure::{ProcedureError, Recorder};

/// Options of `record`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// Where the recording goes, CSV (see docs/recording-format.md)
    #[arg(long, short, value_name = "FILE", default_value = "recording.csv")]
    pub output: PathBuf,
    /// Duration, s
    #[arg(long, value_name = "SECONDS", default_value = "10", value_parser = teach::duration)]
    pub duration: f64,
}

/// Records telemetry of every control cycle.
///
/// # Errors
/// The device cannot be reached, or the file cannot be written.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "record";
    let output = global.output();
    let started = Instant::now();
    let mut client = if global.is_simulated_here() {
        // It has just been switched on: without this there would be nothing to see.
        let mut client = connection::open(global, DOING, |_| {})?;
        connection::ready(&mut client, false, output, DOING)?;
        client
    } else {
        connection::observe(global, DOING)?
    };
    let failed = |error| connection::failure(error, DOING);
    let file = File::create(&command.output).map_err(|cause| failed(ProcedureError::Recording(cause)))?;
    let wanted = (command.duration * lab::demonstration::RATE).round() as usize;
    let bar = output.bar(wanted as u64, "recording");
    let notes = format!("Tactus recording, {} Hz", control::RATE_HZ);
    let mut recorder = Recorder::start(&mut client, BufWriter::new(file), &notes).map_err(failed)?;
    while recorder.rows() < wanted {
        recorder.take(&mut client).map_err(failed)?;
        bar.set_position(recorder.rows() as u64);
    }
    bar.finish_and_clear();
    let rows = recorder.rows();
    recorder.finish(&mut client).map_err(failed)?;
    let gaps = client.gaps().telemetry;
    connection::tell_speed(&client, started, output);
    output.say(format!("wrote {}", command.output.display()));
    output.result(
        &json!({ "file": command.output, "samples": rows, "gaps": gaps }),
        format!("{rows} samples, {gaps} lost"),
    )
}
