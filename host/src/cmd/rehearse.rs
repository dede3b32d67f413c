//! `tactus rehearse`: plays a primitive without feedback, and remembers what the sensors measured.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Args, ValueEnum};
use control::plan::bounds;
use link::image::stored_crc;
use link::{Listing, RunOptions};
use serde::Serialize;

use super::files::{self, RecordingFile};
use super::{ErrorCode, Failure, Global, Output, Table, connection, upload};
use crate::check::Course;
use lab::client::Client;
use lab::demonstration::{Origin, RATE, Recording};
use lab::device::Device;
use lab::input_file;
use lab::learn::memory::{MemoryError, MemorySummary, Payload, remember_rehearsals};
use lab::output_file::OutputFile;
use lab::primitive_file::{LARGEST_DURATION_DEVIATION, PrimitiveFile};
use lab::procedure::{self, CHANNELS, FlagCounts, Mode, ProcedureError, recording_text};
use lab::quoted;
use lab::simulation::WorldKind;
use lab::tracking::Tracking;

const DOING: &str = "rehearse";

/// Options of `rehearse`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// The primitive, TOML
    #[arg(value_name = "PRIMITIVE")]
    pub primitive: PathBuf,
    /// Repetitions, 1 to 50; from 3 on the spread weighs the sensors (K2)
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u8).range(1..=50))]
    pub trials: u8,
    /// Speed relative to the taught one, 0.1 to 2
    #[arg(long, default_value_t = 1.0, value_parser = super::check::factor, allow_hyphen_values = true)]
    pub speed: f64,
    /// Where the primitive with its expectation goes, without statistics [default: back into PRIMITIVE]
    #[arg(long, short, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Keep the recordings in this folder, as NAME-1.csv and so on
    #[arg(long, value_name = "FOLDER")]
    pub record_dir: Option<PathBuf>,
    /// Load in the hand from the beginning: its mass, at most 4 kg, and its centre in the tool frame, m
    #[arg(long, value_name = "KG[,X,Y,Z]", value_parser = payload, allow_hyphen_values = true)]
    pub payload: Option<Payload>,
    /// Leave all sensors the same weight (K2 = 1), whatever their spread
    #[arg(long)]
    pub equal_weights: bool,
    /// I have brought the arm to its home pose: zero it there if need be
    #[arg(long)]
    pub at_home: bool,
    /// Surroundings of a simulated arm [default: table]
    #[arg(long, value_enum)]
    pub surroundings: Option<Surroundings>,
}

/// Surroundings of a simulated arm while it rehearses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum Surroundings {
    /// The table without the object: what is expected is then the movement alone
    #[default]
    Table,
    /// Neither table nor object, for movements that shall give way to the table
    Nothing,
    /// Table and object
    Object,
}

/// The result of a rehearsal.
#[derive(Debug, Clone, Serialize, schemars::JsonSchema)]
pub struct Report {
    /// Name of the primitive.
    pub name: String,
    /// The file that was written.
    pub file: String,
    /// Its check sum.
    pub checksum: String,
    /// The measured wrench and gauges.
    pub expectation: MemorySummary,
    /// True if K2 came from the spread.
    pub weighted: bool,
    /// True if the primitive had statistics: they were gathered with another expectation, and were dropped.
    pub statistics_dropped: bool,
    /// Irregularities, trial by trial.
    pub flags: Vec<FlagCounts>,
    /// Telemetry messages lost.
    pub gaps: u32,
}

/// Rehearses a primitive.
///
/// # Errors
/// The primitive is wrong, the device refuses, a run ends early, or what was recorded cannot be used.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    let output = global.output();
    let (mut file, before) = upload::read_with_text(&command.primitive, DOING)?;
    let movement = file.without_memory();
    keepable(&movement, command.speed)?;
    upload::precheck(&movement, &Course::stored(command.speed), output, DOING)?;
    if let Some(folder) = &command.record_dir {
        files::create_folder(folder, DOING)?;
    }
    let target = command.output.clone().unwrap_or_else(|| command.primitive.clone());
    let output_file = memory_target(&target, &command.primitive, &[], global, DOING)?;
    let mut records = record_files(command, &file.name, global)?.into_iter();
    let started = Instant::now();
    let mut client = open(command, global)?;
    // The file keeps what it remembers; of any other version the device may have the only copy.
    let other = upload::other_version(&mut client, &movement, DOING)?;
    if let Some(old) = other.filter(|old| !is_image_of(&file, old)) {
        upload::say_replaced(&old, output);
    }
    upload::send(&mut client, &movement, output, DOING)?;
    connection::ready(&mut client, command.at_home, output, DOING)?;
    let origin = Origin {
        speed: Some(command.speed),
        mode: Some(Mode::OpenLoop.name().to_owned()),
        ..files::origin(&client, Some(&movement))
    };
    let notes = format!("Tactus recording of a rehearsal of '{}', {} Hz\n{origin}", movement.name, control::RATE_HZ);
    // The same gains and the same pose feedback as in the runs that will compare themselves with this one.
    let options = RunOptions { speed: command.speed as f32, ..Mode::OpenLoop.options() };
    let (mut recordings, mut flags) = (Vec::new(), Vec::new());
    for trial in 1..=command.trials {
        let bar = output.bar((file.movement.duration / command.speed).ceil() as u64, "s", "to the start");
        let once = Trial { movement: &movement, options, notes: &notes, path: path_of(command, &file.name, trial) };
        let played = once.play(&mut client, records.next(), output, &mut |samples| {
            bar.set_message(format!("rehearsal {trial} of {}", command.trials));
            bar.set_position((samples as f64 / RATE) as u64);
        });
        bar.finish_and_clear();
        let (recording, seen) = played.inspect_err(|_| tell_unkept(command, output))?;
        recordings.push(recording);
        flags.push(seen);
    }
    let gaps = client.gaps().telemetry;
    connection::tell_speed(&client, started, output);

    let duration = file.movement.duration / command.speed;
    let statistics_dropped = file.statistics.is_some();
    let summary = remember_rehearsals(
        &mut file,
        &recordings,
        duration,
        command.payload.unwrap_or_default(),
        !command.equal_weights,
    )
    .inspect_err(|_| tell_unkept(command, output))
    .map_err(|cause| memory_failure(cause, "rehearse: no expectation was stored"))?;
    let is_changed = target == command.primitive && input_file::read_text(&target).ok() != Some(before);
    if is_changed {
        return Err(keep_beside(&file, output_file, &target)?);
    }
    write(&file, output_file, &target, DOING).inspect_err(|_| tell_unkept(command, output))?;
    output.say(format!("wrote {}", target.display()));
    if !global.forgets() {
        let upload = format!("tactus upload {}", quoted::path(&target));
        output.say(format!("the device has the movement without what it remembers; `{upload}` gives it that"));
    }
    caution(&file, &flags, statistics_dropped.then_some(&*target), output);
    let report = Report {
        name: file.name.clone(),
        file: files::text(&target),
        checksum: format!("0x{:08x}", file.checksum()),
        weighted: file.feedback.as_ref().is_some_and(|feedback| feedback.k2.len() > 1),
        expectation: summary,
        statistics_dropped,
        flags,
        gaps,
    };
    output.result(&report, report.to_text())
}

/// Opens the device, with the surroundings that are asked for. Surroundings that it does not have are refused: what is
/// remembered would not be what was asked for, and nobody would know.
fn open(command: &Cmd, global: &Global) -> Result<Client<Device>, Failure> {
    let mut world = None;
    let client = connection::open(global, DOING, |options| {
        world = Some(options.world);
        surround(options, command.surroundings.unwrap_or_default());
    })?;
    let lacks = match (command.surroundings, world) {
        (None, _) | (_, Some(WorldKind::Mujoco)) | (Some(Surroundings::Nothing), Some(WorldKind::Simple)) => false,
        (Some(_), _) => true,
    };
    if lacks {
        let cause = "`--surroundings` is for an arm that is simulated in this process, with the MuJoCo world";
        return Err(Failure::new(ErrorCode::CommandLine, "rehearse refused", cause)
            .help("leave it out: the arm rehearses among what stands around it; `--device sil:` has such a world"));
    }
    Ok(client)
}

/// Says that a rehearsal which ends without a result leaves no recording either, where none was asked for.
fn tell_unkept(command: &Cmd, output: Output) {
    if command.record_dir.is_none() {
        output.say("nothing that was measured is kept; `--record-dir FOLDER` keeps each trial, as far as it came");
    }
}

/// One trial of a rehearsal.
struct Trial<'a> {
    movement: &'a PrimitiveFile,
    options: RunOptions,
    notes: &'a str,
    /// Where its recording goes, or what it is called.
    path: PathBuf,
}

impl Trial<'_> {
    /// Plays it. Its cycles go to the file as they come, so that what ends it in the middle leaves what was measured.
    fn play(
        &self,
        client: &mut Client<Device>,
        mut record: Option<RecordingFile>,
        output: Output,
        progress: &mut dyn FnMut(usize),
    ) -> Result<(Recording, FlagCounts), Failure> {
        let failed = |error| connection::failure(error, DOING);
        let recording = |cause: std::io::Error| failed(ProcedureError::Recording(cause));
        let writer = record.as_mut().map(|record| record.begin(self.notes));
        let mut writer = writer.transpose().map_err(recording)?;
        let (mut cycles, mut written) = (Vec::new(), Ok(()));
        let played = procedure::play_once(client, self.movement, self.options, &mut |cycle| {
            cycles.push(*cycle);
            progress(cycles.len());
            // A disk that is full is no reason to stop an arm in the middle of a movement.
            if let (Some(writer), Ok(())) = (&mut writer, &written) {
                written = writer.write(cycle);
            }
        });
        let written = written.and_then(|()| writer.map_or(Ok(()), |writer| writer.finish().map(|_| ())));
        let outcome = played.map_err(failed).and_then(|outcome| written.map(|()| outcome).map_err(recording));
        let outcome = match record {
            Some(record) => record.end(outcome, output)?,
            None => outcome?,
        };
        let bytes = recording_text(&cycles, self.notes).map_err(recording)?;
        let recording = Recording::parse(&self.path, &bytes).map_err(|cause| {
            Failure::new(ErrorCode::RecordingReadsBackWrong, "rehearse: the recording reads back wrong", cause)
        })?;
        match Tracking::of_run(&recording).ok().and_then(|tracking| tracking.missed()) {
            Some(missed) => Err(Failure::new(ErrorCode::GoalMissed, "rehearse: no expectation was stored", missed)),
            None => Ok((recording, outcome.flags)),
        }
    }
}

/// Keeps the primitive beside a file that somebody has changed meanwhile; the failure that says so.
fn keep_beside(file: &PrimitiveFile, mut output: OutputFile, target: &Path) -> Result<Failure, Failure> {
    let text = file.checked_text().map_err(|cause| super::check::failure(cause, target, DOING))?;
    output.write_all(text.as_bytes()).map_err(|cause| Failure::of_file(ErrorCode::FileFailed, DOING, cause))?;
    let words = format!("{} was changed while it was rehearsed", target.display());
    let help = "rehearse what the file holds now; what was learned of the one before is kept beside it";
    Ok(Failure::new(ErrorCode::WouldReplace, DOING, words).help(help).kept(output.keep()))
}

/// Warns of what a person should know about the primitive that was written; `dropped` is its file, if it has lost its
/// statistics.
fn caution(file: &PrimitiveFile, flags: &[FlagCounts], dropped: Option<&Path>, output: Output) {
    if flags.iter().any(|flags| flags.limited > 0) {
        output.warn("the torque limiter was active: the arm did not follow its plan everywhere");
    }
    if let Some(target) = dropped {
        output.warn(format!(
            "its statistics were dropped: they were gathered with another expectation. No run is watched until \
             `tactus statistics {} RECORDING...` has new ones",
            quoted::path(target)
        ));
    }
    if file.feedback.is_none() {
        output.warn("the primitive has no gains for feedback: learn it again, then rehearse it");
    }
}

/// True if what the device stores is this file, with all that it remembers.
fn is_image_of(file: &PrimitiveFile, stored: &Listing) -> bool {
    file.to_image().is_ok_and(|image| stored_crc(&image) == stored.crc)
}

/// Refuses a speed at which the expectation could not be kept.
fn keepable(movement: &PrimitiveFile, speed: f64) -> Result<(), Failure> {
    let recorded = movement.movement.duration / speed;
    if (recorded - movement.movement.duration).abs() > LARGEST_DURATION_DEVIATION * recorded {
        let text = format!(
            "at speed {} the movement takes {recorded:.2} s instead of {:.2} s: an expectation more than 50 % apart \
             from its movement is not kept",
            speed, movement.movement.duration
        );
        return Err(Failure::new(ErrorCode::ExpectationSpeed, "rehearse refused", text).help("a speed from 0.5 to 1.5"));
    }
    Ok(())
}

/// Opens the files of the recordings, if they are to be kept.
fn record_files(command: &Cmd, name: &str, global: &Global) -> Result<Vec<RecordingFile>, Failure> {
    let trials = 1..=if command.record_dir.is_some() { command.trials } else { 0 };
    trials
        .map(|trial| RecordingFile::create(&path_of(command, name, trial), global, &[&command.primitive], DOING))
        .collect()
}

/// Where the recording of a trial goes, or what it is called.
fn path_of(command: &Cmd, name: &str, trial: u8) -> PathBuf {
    match &command.record_dir {
        None => PathBuf::from(format!("rehearsal {trial}")),
        Some(folder) => folder.join(format!("{name}-{trial}.csv")),
    }
}

/// Opens the file for a primitive that learns something: the primitive itself, or another that is not there yet.
pub(super) fn memory_target(
    target: &Path,
    primitive: &Path,
    inputs: &[&Path],
    global: &Global,
    doing: &str,
) -> Result<OutputFile, Failure> {
    let force = global.force || target == primitive;
    OutputFile::create(target, force, inputs).map_err(|error| files::failure(error, doing))
}

/// Writes a primitive that has learned something.
pub(super) fn write(file: &PrimitiveFile, output: OutputFile, target: &Path, doing: &str) -> Result<(), Failure> {
    let refused = |cause| super::check::failure(cause, target, doing);
    // What a device would refuse is not written.
    file.to_primitive().map_err(refused)?;
    file.to_image().map_err(refused)?;
    files::fill(output, file.checked_text().map_err(refused)?.as_bytes(), doing)
}

/// The failure of what could not be remembered.
pub(super) fn memory_failure(cause: MemoryError, doing: &str) -> Failure {
    let help = match &cause {
        MemoryError::None | MemoryError::Incomplete { .. } | MemoryError::Several { .. } => {
            "record whole runs with `tactus run PRIMITIVE --record FILE`"
        }
        MemoryError::Twice { .. } => {
            "give recordings of different runs; a simulated arm repeats itself unless its seed differs, for example \
             `--device sil:seed=2`"
        }
        MemoryError::Columns { .. } => "record with this version of tactus",
        MemoryError::Saturated { .. } | MemoryError::Stale { .. } => {
            "check the force sensor and its cable, and that the hand touches nothing"
        }
        MemoryError::HeldBack { .. } => {
            "the usual cause is an arm that is faster than the pendant likes: `tactus check PRIMITIVE` tells the speed \
             at which it is not, for `--speed`; `tactus status` shows a warning that goes on, and temperatures"
        }
        MemoryError::Duration { .. } => "give recordings of this primitive, all at the same speed",
        MemoryError::Others { .. } => {
            return Failure::new(ErrorCode::RecordingOfOthers, doing, cause);
        }
        MemoryError::Table(_) => "give other recordings",
    };
    Failure::new(ErrorCode::NotRemembered, doing, cause).help(help)
}

impl Report {
    /// The report for people.
    pub fn to_text(&self) -> String {
        let memory = &self.expectation;
        let weights = if self.weighted { "K2 from the spread" } else { "K2 = 1" };
        format!(
            "{}: {} rehearsal(s) of {:.2} s, {} points, {weights}; content {}\n\n{}",
            self.name,
            memory.trials,
            memory.duration_s,
            memory.points,
            self.checksum,
            memory_table(memory)
        )
    }
}

/// Channel by channel what is remembered.
pub(super) fn memory_table(memory: &MemorySummary) -> Table {
    const UNITS: [&str; 4] = ["N", "N m", "N m", "rad"];
    let mut table = Table::new(["channel", "largest mean", "spread", "unit"]);
    for (channel, (extreme, spread)) in memory.extremes.iter().zip(&memory.spread).enumerate() {
        table.row([
            CHANNELS[channel].to_owned(),
            format!("{extreme:.3}"),
            format!("{spread:.3}"),
            UNITS[channel / 3].to_owned(),
        ]);
    }
    table
}

/// Clears the surroundings of a simulated arm.
#[cfg(feature = "mujoco")]
fn surround(options: &mut lab::simulation::SimulationOptions, surroundings: Surroundings) {
    use sim::world::mujoco::Scene;
    match surroundings {
        Surroundings::Table => options.scene = Scene::EMPTY,
        Surroundings::Nothing => options.scene = Scene::NOTHING,
        Surroundings::Object => {}
    }
}

/// Nothing stands around an arm without MuJoCo.
#[cfg(not(feature = "mujoco"))]
fn surround(_options: &mut lab::simulation::SimulationOptions, _surroundings: Surroundings) {}

/// A mass, or a mass and its centre.
fn payload(text: &str) -> Result<Payload, String> {
    let payload = if text.contains(',') {
        let [mass, x, y, z] = super::learn::numbers::<4>(text)?;
        Payload { mass, centre: [x, y, z] }
    } else {
        let [mass] = super::learn::numbers::<1>(text)?;
        Payload { mass, centre: [0.0; 3] }
    };
    // What a device would refuse must not be found out after all trials.
    let centre = payload.centre.map(|value| value as f32);
    bounds::check_marks(payload.mass as f32, &centre, 0.0, 0.0).map(|()| payload).map_err(|_| {
        let (mass, metres) = (bounds::LOAD_MASS, bounds::LOAD_CENTRE);
        format!("a mass from 0 to {mass} kg is expected, and a centre of at most {metres} m along each axis")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_payload_that_no_device_takes_is_refused_before_anything_moves() {
        assert_eq!(payload("0.5,0,0,0.08"), Ok(Payload { mass: 0.5, centre: [0.0, 0.0, 0.08] }));
        assert!(payload("4").is_ok());
        for wrong in ["-0.1", "5", "0.5,0,0,80", "0.5,0,0", "nan"] {
            assert!(payload(wrong).is_err(), "{wrong}");
        }
    }
}
