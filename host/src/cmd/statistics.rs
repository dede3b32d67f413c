//! `tactus statistics`: makes the statistics of successful runs, by which the device watches the next runs.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;

use super::{ErrorCode, Failure, Global, files, rehearse, upload};
use lab::demonstration::Recording;
use lab::learn::memory::remember_successes;
use lab::outcome::Outcome;

/// Options of `statistics`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// The primitive, TOML
    #[arg(value_name = "PRIMITIVE")]
    pub primitive: PathBuf,
    /// Recordings of runs that succeeded, all at the same speed, CSV
    #[arg(value_name = "RECORDING", required_unless_present = "forget")]
    pub recordings: Vec<PathBuf>,
    /// Where the primitive with the statistics goes [default: back into PRIMITIVE]
    #[arg(long, short, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Take the statistics out: runs are then not watched
    #[arg(long, conflicts_with = "recordings")]
    pub forget: bool,
}

/// Gathers statistics.
///
/// # Errors
/// A file is wrong, or the recordings do not fit the primitive.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "statistics";
    let output = global.output();
    let mut file = upload::read(&command.primitive, DOING)?;
    let target = command.output.clone().unwrap_or_else(|| command.primitive.clone());
    let inputs: Vec<&Path> = command.recordings.iter().map(PathBuf::as_path).collect();
    let output_file = rehearse::memory_target(&target, &command.primitive, &inputs, global, DOING)?;
    if command.forget {
        file.statistics = None;
        rehearse::write(&file, output_file, &target, DOING)?;
        let checksum = format!("0x{:08x}", file.checksum());
        return output.result(
            &Known { name: &file.name, file: files::text(&target), checksum: &checksum, statistics: None },
            format!("{}: without statistics; content {checksum}", file.name),
        );
    }
    let bar = output.bar(command.recordings.len() as u64, "files", "reading");
    let mut recordings = Vec::new();
    for path in &command.recordings {
        let recording = Recording::read(path)
            .map_err(|cause| Failure::of_file(ErrorCode::RecordingInvalid, "statistics refused", cause))?;
        recordings.push(recording);
        bar.inc(1);
    }
    bar.finish_and_clear();
    for recording in recordings.iter().filter(|recording| recording.origin.primitive.is_none()) {
        output.warn(format!("{} does not name its movement", recording.file.display()));
    }
    recordings.iter().try_for_each(success)?;
    let modes: BTreeSet<&str> = recordings.iter().filter_map(|recording| recording.origin.mode.as_deref()).collect();
    if modes.len() > 1 {
        let modes = modes.into_iter().collect::<Vec<_>>().join(", ");
        output.warn(format!(
            "the runs are of several modes ({modes}): the differences between these are taken for usual"
        ));
    }
    let summary = remember_successes(&mut file, &recordings)
        .map_err(|cause| rehearse::memory_failure(cause, "statistics: nothing was remembered"))?;
    rehearse::write(&file, output_file, &target, DOING)?;
    output.say(format!("wrote {}", target.display()));
    if recordings.len() < dmp::fit::FEWEST_TRIALS {
        output.warn("the spread of fewer than 3 runs is chance: the watch will go by its smallest spread");
    }
    if summary.empty_hand.is_some_and(|share| share < 1.0) {
        output.warn("by these runs a hand that closes on nothing cannot be told from one that holds something");
    }
    let checksum = format!("0x{:08x}", file.checksum());
    output.result(
        &Known { name: &file.name, file: files::text(&target), checksum: &checksum, statistics: Some(&summary) },
        format!(
            "{}: {} run(s) of {:.2} s, {} points; content {checksum}\n\n{}",
            file.name,
            summary.trials,
            summary.duration_s,
            summary.points,
            rehearse::memory_table(&summary)
        ),
    )
}

/// Refuses a run that is known not to have come to its goal. One whose recording ends with the movement may have.
fn success(recording: &Recording) -> Result<(), Failure> {
    let outcome = Outcome::of(recording);
    match outcome {
        Outcome::Arrived | Outcome::ArrivedUnlike | Outcome::Unfinished => return Ok(()),
        Outcome::NeverBegan
        | Outcome::FaultedBefore(_)
        | Outcome::Missed(_)
        | Outcome::Faulted(_)
        | Outcome::Stopped => {}
    }
    let cause = format!("{}: {}", recording.file.display(), outcome.words());
    Err(Failure::new(ErrorCode::NotRemembered, "statistics: nothing was remembered", cause)
        .help("statistics are of runs that succeeded: leave this one out"))
}

/// Data of `tactus --json statistics`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Known<'a> {
    /// Name of the primitive.
    pub name: &'a str,
    /// The file that was written.
    pub file: String,
    /// Check sum of its content, hexadecimal.
    pub checksum: &'a str,
    /// Summary of the successful runs; `null`: forgotten.
    pub statistics: Option<&'a lab::learn::memory::MemorySummary>,
}
