//! `tactus run`: the arm plays a primitive, watched and written down.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use control::State;
use link::{Goal, Name, RunOptions, Statistics};
use serde::Serialize;

use super::files::{self, RecordingFile};
use super::{ErrorCode, Failure, Global, Output, Table, connection, get, upload};
use crate::check::Course;
use lab::client::Client;
use lab::demonstration::{Origin, RATE, Recording};
use lab::device::Device;
use lab::primitive_file::PrimitiveFile;
use lab::procedure::{
    self, Change, ChangeKind, CycleWriter, FlagCounts, Mode, ProcedureError, RunOutcome, RunRequest, Surprise,
    recording_text,
};
use lab::tracking::{HandTracking, Tracking};

/// Rest that is recorded at the goal, s.
const POST_ROLL: f64 = 1.0;

/// Distance (m) and angle (rad) from the end of its plan within which an arm counts as arrived. Force control leaves the
/// plan by millimetres where the hand touches something; by more than this it was held up.
const GOAL_TOLERANCE: (f64, f64) = (0.05, 15.0 * std::f64::consts::PI / 180.0);

/// Options of `run`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// The primitive: a TOML file, uploaded unless the device has it already, or the name of one in the device
    #[arg(value_name = "PRIMITIVE")]
    pub primitive: PathBuf,
    /// Where the recording goes, CSV (see docs/recording-format.md)
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,
    /// Speed relative to the taught one, 0.1 to 2
    #[arg(long, default_value_t = 1.0, value_parser = super::check::factor)]
    pub speed: f64,
    /// Another goal of the grasp point, world frame, m
    #[arg(long, value_name = "X,Y,Z", value_parser = super::learn::numbers::<3>, allow_hyphen_values = true)]
    pub goal: Option<[f64; 3]>,
    /// Use of the measured force in the run
    #[arg(long, value_enum, default_value_t)]
    pub mode: Mode,
    /// Stiff gains in every mode: for a hand that must keep its place where nothing pushes
    #[arg(long)]
    pub stiff: bool,
    /// Let the fingers keep to their plan, whatever their gauges measure
    #[arg(long)]
    pub no_finger_feedback: bool,
    /// Move the goal while it runs: seconds after the start, then the goal as for --goal. May be given more than once
    #[arg(long, value_name = "T:X,Y,Z", value_parser = goal_at, allow_hyphen_values = true)]
    pub goal_at: Vec<Change>,
    /// Change the speed while it runs: seconds after the start, then the factor. May be given more than once
    #[arg(long, value_name = "T:FACTOR", value_parser = speed_at)]
    pub speed_at: Vec<Change>,
    /// I have brought the arm to its home pose: zero it there if need be
    #[arg(long)]
    pub at_home: bool,
    /// Check and upload only; do not move
    #[arg(long)]
    pub dry_run: bool,
    /// Write every frame of the simulated bus to this file, in the layout of `candump -L`
    #[arg(long, value_name = "FILE")]
    pub bus_log: Option<PathBuf>,
}

/// The result of a run.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// Name of the primitive.
    pub name: String,
    /// Use of the measured force in the run.
    pub mode: &'static str,
    /// Duration of the movement, s.
    pub duration_s: f64,
    /// Tracking of the plan by the tool; none where a hand alone is driven.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tracking: Option<Tracking>,
    /// Tracking of the plan by the digits, where a hand alone is driven.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hand_tracking: Option<HandTracking>,
    /// Samples in the recording, and how many the link lost.
    pub samples: usize,
    /// Telemetry messages lost.
    pub gaps: u32,
    /// Samples in which the torque limiter was at work.
    pub limited_samples: usize,
    /// Samples in which something was out of the ordinary.
    pub flags: FlagCounts,
    /// Where the run did not go as the successful ones did.
    pub surprises: Vec<Surprise>,
    /// Virtual time from power-up to an arm that could be commanded, s; none where time is real.
    pub ready_s: Option<f64>,
    /// Control cycles since the device was switched on.
    pub cycles: u32,
    /// Cycles whose torque frames were not queued in time.
    pub missed_deadlines: u32,
    /// Replies of pucks or sensor that did not come in their cycle.
    pub lost_replies: u32,
    /// Worst control computation, instructions; none where the board cannot tell.
    pub worst_instructions: Option<u32>,
    /// Mean control computation, instructions; likewise.
    pub mean_instructions: Option<u32>,
    /// Worst control computation by the board's own clock, us; none in this process, where nobody measures.
    pub worst_computation_us: Option<f64>,
    /// Worst delay from timer to control task, us; likewise.
    pub worst_latency_us: Option<f64>,
    /// Stack used at the most, bytes; likewise.
    pub stack_used: Option<u32>,
    /// Telemetry left out because the line was full.
    pub telemetry_dropped: u32,
    /// Counters of the simulated bus.
    pub bus: Option<BusReport>,
}

/// Traffic on the simulated bus since the device was switched on.
#[derive(Debug, Clone, Serialize)]
pub struct BusReport {
    /// Frames.
    pub frames: u64,
    /// Frames that the device side of the protocol could not read.
    pub invalid_frames: u64,
    /// Share of the time the bus was busy.
    pub load: f64,
    /// Hash over every frame with its time: equal seeds give equal hashes.
    pub hash: String,
}

/// Runs a primitive.
///
/// # Errors
/// The primitive is wrong, the device refuses, or the arm stops before the end.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "run";
    let output = global.output();
    let stored = stored_name(&command.primitive);
    let mut opened = stored.is_some().then(|| open(command, global)).transpose()?;
    let file = match (&stored, &mut opened) {
        (Some(name), Some(client)) => get::fetch(client, name, DOING)?,
        _ => upload::read(&command.primitive, DOING)?,
    };
    check_expectation(&file, command, output)?;
    let changes = changes(&file, command)?;
    let course = Course { speed: command.speed, goal: super::check::goal(command.goal), changes };
    upload::precheck(&file, &course, output, DOING)?;
    let record = command.record.as_ref().filter(|_| !command.dry_run);
    let mut record =
        record.map(|path| RecordingFile::create(path, global, &[&command.primitive], DOING)).transpose()?;
    let started = Instant::now();
    let mut client = match opened {
        Some(client) => client,
        None => open(command, global)?,
    };
    if command.bus_log.is_some() && client.transport().simulation().is_none() {
        let cause = std::io::Error::other("only a simulated bus can be written down");
        return Err(connection::failure(ProcedureError::Recording(cause), DOING));
    }
    if let Some(old) = upload::other_version(&mut client, &file, DOING)? {
        output.say(format!("replaces another version of '{}' in the device (checksum 0x{:08x})", file.name, old.crc));
    }
    upload::send(&mut client, &file, output, DOING)?;
    output.say(format!("'{}' is in the device", file.name));
    if command.dry_run {
        return output
            .result(&serde_json::json!({ "name": file.name, "dry_run": true }), "ready to run; nothing moved");
    }
    connection::ready(&mut client, command.at_home, output, DOING)?;
    let ready_s = client.is_virtual().then(|| client.now().as_secs_f64());
    let played = play(command, &mut client, &file, record.as_mut(), output);
    connection::tell_speed(&client, started, output);
    let played = played.map_err(|error| connection::failure(error, DOING));
    let report = match record {
        Some(record) => record.end(played, output)?,
        None => played?,
    };
    let report = Report { ready_s, ..report };
    if !client.is_simulated() {
        output.say("the arm holds its goal; `tactus stop` makes it soft");
    }
    let Some(missed) = report.tracking.as_ref().and_then(missed) else {
        return output.result(&report, report.to_text());
    };
    if !global.json {
        output.result(&report, report.to_text())?;
    }
    let failure = Failure::new(ErrorCode::GoalMissed, DOING, missed);
    Err(match serde_json::to_value(&report) {
        Ok(data) => failure.data(data),
        Err(_) => failure,
    })
}

/// The changes on the way; one that would come after the run is refused.
fn changes(file: &PrimitiveFile, command: &Cmd) -> Result<Vec<Change>, Failure> {
    let changes: Vec<Change> = command.goal_at.iter().chain(&command.speed_at).copied().collect();
    let end = procedure::planned(file.movement.duration, command.speed, &changes);
    match changes.iter().map(|change| change.time).find(|time| *time >= end) {
        None => Ok(changes),
        Some(late) => {
            let text = format!("a change at {late} s comes too late: the movement takes {end:.2} s");
            Err(Failure::new(ErrorCode::ChangeTooLate, "run refused", text))
        }
    }
}

/// The name of a primitive in the device, where the argument is that and no file.
fn stored_name(primitive: &Path) -> Option<Name> {
    let is_file = primitive.exists() || primitive.extension().is_some_and(|extension| extension == "toml");
    Name::new(primitive.to_str()?).ok().filter(|_| !is_file)
}

fn open(command: &Cmd, global: &Global) -> Result<Client<Device>, Failure> {
    connection::open(global, "run", |options| {
        options.bus_log = command.bus_log.clone().or(options.bus_log.take());
    })
}

fn play(
    command: &Cmd,
    client: &mut Client<Device>,
    file: &PrimitiveFile,
    record: Option<&mut RecordingFile>,
    output: Output,
) -> Result<Report, ProcedureError> {
    let spinner = output.spinner("moving to the start");
    let at_start = procedure::go_to_start(client, &file.start, |passed| {
        spinner.set_message(format!("moving to the start, {passed:.0} s"));
    });
    spinner.finish_and_clear();
    at_start?;
    let name = link::Name::new(&file.name).map_err(|error| lab::transport::TransportError::other(error.to_string()))?;
    let goal = Goal { position: command.goal.map(|goal| goal.map(|value| value as f32)), orientation: None };
    let usual = command.mode.options();
    let options = RunOptions {
        goal,
        speed: command.speed as f32,
        finger_feedback: !command.no_finger_feedback,
        compliant: usual.compliant && !command.stiff,
        ..usual
    };
    let changes = command.goal_at.iter().chain(&command.speed_at).copied().collect();
    let request = RunRequest { rest: POST_ROLL, changes, ..RunRequest::new(name, file.movement.duration, options) };

    let notes = notes(client, file, command);
    let mut writer = record.map(|record| start(record, &notes)).transpose()?;
    let bar = output.bar((file.movement.duration / command.speed * RATE) as u64, "running");
    let (mut cycles, mut written, mut is_running) = (Vec::new(), Ok(()), false);
    let outcome = procedure::play(client, &request, &mut |cycle| {
        if !is_running && State::from_code(cycle.state) == Some(State::Run) {
            is_running = true;
            bar.suspend(|| output.say(format!("running '{}' ({})", file.name, command.mode.name())));
        }
        cycles.push(*cycle);
        bar.set_position(cycles.len() as u64);
        // A disk that is full is no reason to stop an arm: the run goes on, and is told of at its end.
        if let (Some(writer), Ok(())) = (&mut writer, &written) {
            written = writer.write(cycle);
        }
    });
    bar.finish_and_clear();
    let outcome = outcome?;
    written?;
    if let Some(writer) = writer {
        writer.finish()?;
    }
    let bytes = recording_text(&cycles, &notes)?;
    tell(&outcome, output);
    let statistics = client.statistics()?;
    report(client, file, command.mode, &bytes, outcome, &statistics)
}

/// Says what a person should know about how the run went.
fn tell(outcome: &RunOutcome, output: Output) {
    for surprise in &outcome.surprises {
        output.warn(format!(
            "not as the successful runs: {} stands out {:.2} s into the run, at phase {:.3}",
            surprise.channel, surprise.time_s, surprise.phase
        ));
    }
    let seconds = |samples: usize| samples as f64 / RATE;
    let FlagCounts { faded, saturated, stale, hand_lost, clamped, .. } = outcome.flags;
    for (samples, words) in [
        (clamped, "the adaptation was at its limits"),
        (faded, "the adaptation was derated or fading"),
        (saturated, "the force sensor was saturated; force control stood still"),
        (stale, "the force sensor was silent"),
        (hand_lost, "the hand did not answer and was left alone"),
    ] {
        if samples > 0 {
            output.say(format!("for {:.2} s {words}", seconds(samples)));
        }
    }
}

/// Refuses a run that compares forces with an expectation that is not there or says nothing about this run.
fn check_expectation(file: &PrimitiveFile, command: &Cmd, output: Output) -> Result<(), Failure> {
    if !command.mode.needs_expectation() {
        return Ok(());
    }
    let doing = format!("run refused: mode `{}`", command.mode.name());
    let help = format!("tactus rehearse {}", file.file.display());
    let Some(expectation) = &file.expectation else {
        return Err(Failure::new(
            ErrorCode::NoExpectation,
            doing,
            format!("{}: the primitive does not know what it should feel", file.file.display()),
        )
        .help(help));
    };
    let primitive = file.to_primitive().map_err(|cause| super::check::failure(cause, &file.file, "run"))?;
    let relative = expectation.recorded_duration / (file.movement.duration / command.speed);
    let trust = primitive.expected().map_or(0.0, |expected| expected.trust(relative));
    if trust <= 0.0 {
        return Err(Failure::new(
            ErrorCode::ExpectationSpeed,
            doing,
            format!(
                "the expectation was recorded at {:.2} s, this run would take {:.2} s: more than 50 % apart",
                expectation.recorded_duration,
                file.movement.duration / command.speed
            ),
        )
        .help(format!("{help} --speed {}", command.speed)));
    }
    if trust < 1.0 {
        output.warn(format!(
            "the expectation was recorded at another speed: the adaptation is derated to {:.0} %",
            trust * 100.0
        ));
    }
    if expectation.payload_mass > 0.0 {
        output.say(format!("expects the load it was rehearsed with: {:.3} kg", expectation.payload_mass));
    }
    Ok(())
}

/// The notes above a recording of this run.
fn notes(client: &Client<Device>, file: &PrimitiveFile, command: &Cmd) -> String {
    let origin = Origin {
        speed: Some(command.speed),
        mode: Some(command.mode.name().to_owned()),
        goal: command.goal,
        ..files::origin(client, Some(file))
    };
    format!("Tactus recording of a run of '{}', {} Hz\n{origin}", file.name, control::RATE_HZ)
}

/// Begins the file of a recording.
fn start<'a>(record: &'a mut RecordingFile, notes: &str) -> std::io::Result<CycleWriter<impl Write + use<'a>>> {
    record.expect_notes(notes);
    CycleWriter::new(&mut record.file, notes)
}

fn report(
    client: &mut Client<Device>,
    file: &PrimitiveFile,
    mode: Mode,
    bytes: &[u8],
    outcome: RunOutcome,
    statistics: &Statistics,
) -> Result<Report, ProcedureError> {
    let unreadable = |error: &dyn std::fmt::Display| std::io::Error::other(format!("it reads back wrong: {error}"));
    let recording = Recording::parse(Path::new("run"), bytes).map_err(|error| unreadable(&error))?;
    let ticks_per_second = client.hello().ticks_per_second;
    let per_tick = u32::from(client.hello().instructions_per_tick);
    let instructions = |ticks: u32| ticks.saturating_mul(per_tick);
    let microseconds = |ticks: u32| f64::from(ticks) * 1e6 / f64::from(ticks_per_second.max(1));
    let measures = statistics.cost_worst_ticks > 0;
    let counts = measures && per_tick > 0;
    let gaps = client.gaps().telemetry;
    let bus = client.transport().simulation().map(|simulation| {
        let elapsed = simulation.ticks();
        let trace = simulation.plant().trace();
        BusReport {
            frames: trace.total(),
            invalid_frames: trace.invalid,
            load: trace.load(elapsed),
            hash: format!("{:016x}", trace.hash),
        }
    });
    // Asked last: the bus goes on meanwhile, and its figures are those at the end of the run.
    let (tracking, hand_tracking) = if client.hello().capabilities.arm {
        (Some(Tracking::of_run(&recording).map_err(|error| unreadable(&error))?), None)
    } else {
        (None, Some(HandTracking::of_run(&recording).map_err(|error| unreadable(&error))?))
    };
    Ok(Report {
        name: file.name.clone(),
        mode: mode.name(),
        duration_s: recording.running().len() as f64 / RATE,
        tracking,
        hand_tracking,
        samples: outcome.samples,
        gaps,
        limited_samples: outcome.flags.limited,
        flags: outcome.flags,
        surprises: outcome.surprises,
        ready_s: None,
        cycles: statistics.cycles,
        missed_deadlines: statistics.missed_deadlines,
        lost_replies: statistics.lost_replies,
        worst_instructions: counts.then(|| instructions(statistics.cost_worst_ticks)),
        mean_instructions: counts.then(|| instructions(statistics.cost_mean_ticks)),
        worst_computation_us: measures.then(|| microseconds(statistics.cost_worst_ticks)),
        worst_latency_us: measures.then(|| microseconds(statistics.latency_worst_ticks)),
        stack_used: measures.then(|| statistics.stack_size.saturating_sub(statistics.stack_free)),
        telemetry_dropped: statistics.telemetry_dropped,
        bus,
    })
}

impl Report {
    /// The report as a table for people.
    pub fn to_text(&self) -> String {
        let mut table = Table::new(["run", &self.name]);
        let mut row = |name: &str, value: String| {
            table.row([name.to_owned(), value]);
        };
        row("mode", self.mode.to_owned());
        row("duration", format!("{:.2} s", self.duration_s));
        if let Some(tracking) = &self.tracking {
            let pose = |metres: f64, radians: f64| format!("{:.2} mm  {:.2} deg", metres * 1e3, radians.to_degrees());
            row("tracking, RMS", pose(tracking.position_rms_m, tracking.orientation_rms_rad));
            row("tracking, worst", pose(tracking.position_max_m, tracking.orientation_max_rad));
            row("error at the goal", pose(tracking.position_end_m, tracking.orientation_end_rad));
        }
        if let Some(tracking) = &self.hand_tracking {
            let digits = |[spread, first, second, third]: [f64; 4]| {
                format!("spread {spread:.3}, fingers {first:.3}, {second:.3}, {third:.3} rad")
            };
            row("tracking, RMS", digits(tracking.rms_rad));
            row("tracking, worst", digits(tracking.max_rad));
            row("error at the goal", digits(tracking.end_rad));
        }
        row("cycles since power-up", self.cycles.to_string());
        row("missed deadlines", self.missed_deadlines.to_string());
        row("lost replies", self.lost_replies.to_string());
        row("samples, lost on the link", format!("{}, {}", self.samples, self.gaps));
        row("samples with limited torque", self.limited_samples.to_string());
        row("surprises", self.surprises.len().to_string());
        if let (Some(worst), Some(mean)) = (self.worst_instructions, self.mean_instructions) {
            row("control cycle, worst", format!("{worst} instructions"));
            row("control cycle, mean", format!("{mean} instructions"));
        } else if let Some(worst) = self.worst_computation_us {
            row("control cycle, worst", format!("{worst:.1} us"));
        }
        if let (Some(latency), Some(stack)) = (self.worst_latency_us, self.stack_used) {
            row("timer latency, worst", format!("{latency:.1} us"));
            row("stack used", format!("{stack} bytes"));
        }
        if let Some(bus) = &self.bus {
            row("bus load", format!("{:.1} %", bus.load * 100.0));
            row("bus frames, invalid", format!("{}, {}", bus.frames, bus.invalid_frames));
            row("bus hash", bus.hash.clone());
        }
        table.to_string()
    }
}

/// Words for an arm that rests elsewhere than its plan ends; `None` where it is at its goal.
fn missed(tracking: &Tracking) -> Option<String> {
    let (away, turned) = (tracking.position_end_m, tracking.orientation_end_rad);
    // Not a number is no goal reached either.
    let is_there = away <= GOAL_TOLERANCE.0 && turned <= GOAL_TOLERANCE.1;
    (!is_there).then(|| {
        format!(
            "the arm ended {:.0} mm and {:.0} degrees away from its goal; at most {:.0} mm and {:.0} degrees count as there",
            away * 1e3,
            turned.to_degrees(),
            GOAL_TOLERANCE.0 * 1e3,
            GOAL_TOLERANCE.1.to_degrees()
        )
    })
}

/// A time and a goal, as in `3.5:0.7,0.1,0.2`.
fn goal_at(text: &str) -> Result<Change, String> {
    let (time, goal) = timed(text)?;
    let position = super::learn::numbers::<3>(goal)?.map(|value| value as f32);
    Ok(Change { time, kind: ChangeKind::Goal(Goal { position: Some(position), orientation: None }) })
}

/// A time and a speed factor, as in `3.5:0.5`.
fn speed_at(text: &str) -> Result<Change, String> {
    let (time, factor) = timed(text)?;
    Ok(Change { time, kind: ChangeKind::Speed(super::check::factor(factor)? as f32) })
}

fn timed(text: &str) -> Result<(f64, &str), String> {
    let (time, rest) = text.split_once(':').ok_or("a time in seconds, a colon and a value are expected")?;
    match time.parse::<f64>() {
        Ok(time) if (0.0..=3600.0).contains(&time) => Ok((time, rest)),
        _ => Err(format!("`{time}` is not a time between 0 and 3600 s")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_arm_that_ends_away_from_its_goal_has_missed_it_and_the_distance_is_told() {
        let ended = |position_end_m: f64, orientation_end_rad: f64| {
            missed(&Tracking {
                samples: 1,
                position_rms_m: 0.0,
                position_max_m: 0.0,
                position_end_m,
                orientation_rms_rad: 0.0,
                orientation_max_rad: 0.0,
                orientation_end_rad,
            })
        };
        assert_eq!(ended(0.012, 0.05), None);
        let words = ended(0.22, 75f64.to_radians()).unwrap();
        assert!(words.contains("220 mm and 75 degrees away"), "{words}");
        assert!(ended(0.0, 0.3).is_some() && ended(0.06, 0.0).is_some() && ended(f64::NAN, 0.0).is_some());
    }

    #[test]
    fn changes_carry_their_time_and_nonsense_is_refused() {
        let change = goal_at("3.5:0.7,-0.1,0.2").unwrap();
        assert_eq!(change.time, 3.5);
        let goal = Goal { position: Some([0.7, -0.1, 0.2]), orientation: None };
        assert_eq!(change.kind, ChangeKind::Goal(goal));
        assert_eq!(speed_at("0:0.5").unwrap().kind, ChangeKind::Speed(0.5));
        for wrong in ["0.7,0.1,0.2", "-1:0.7,0.1,0.2", "nan:0.7,0.1,0.2", "1:0.7,0.1", "1:"] {
            assert!(goal_at(wrong).is_err(), "{wrong}");
        }
        assert!(speed_at("1:3").is_err() && speed_at("1:nan").is_err());
    }
}
