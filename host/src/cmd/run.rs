//! `tactus run`: the arm plays a primitive, watched and written down.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use control::State;
use link::{Goal, Name, RunOptions};
use serde_json::json;

use super::files::{self, RecordingFile};
use super::preflight::{self, Asked, Precondition};
use super::run_folder::RunFolder;
use super::run_report::{DryRun, Report, report};
use super::{ErrorCode, Failure, Global, Output, connection, get, upload};
use crate::check::Course;
use lab::client::Client;
use lab::demonstration::{Origin, RATE};
use lab::device::Device;
use lab::line_health::{LineHealth, Snapshot};
use lab::output_file;
use lab::primitive_file::PrimitiveFile;
use lab::procedure::{
    self, Change, ChangeKind, FlagCounts, Mode, ProcedureError, RunOutcome, RunRequest, recording_text,
};
use lab::quoted;
use lab::tracking::Missed;
use lab::transport::{Address, SimulatorOptions};

const DOING: &str = "run";

/// Rest that is recorded at the goal, s.
const POST_ROLL: f64 = 1.0;

/// Options of `run`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// The primitive: a TOML file, uploaded unless the device has it already, or the name of one in the device
    #[arg(value_name = "PRIMITIVE")]
    pub primitive: PathBuf,
    /// Where the recording goes, CSV (see docs/recording-format.md)
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,
    /// Keep all about the run in FOLDER/DATE-NAME: primitive, recording, result, report; FOLDER is `runs` if not given
    #[arg(long, value_name = "FOLDER", num_args = 0..=1, default_missing_value = "runs", conflicts_with = "record")]
    pub keep: Option<PathBuf>,
    /// Speed relative to the taught one, 0.1 to 2
    #[arg(long, default_value_t = 1.0, value_parser = super::check::factor, allow_hyphen_values = true)]
    pub speed: f64,
    /// Another goal of the grasp point, world frame, m
    #[arg(long, value_name = "X,Y,Z", value_parser = super::learn::numbers::<3>, allow_hyphen_values = true)]
    pub goal: Option<[f64; 3]>,
    /// Use of the measured force in the run
    #[arg(long, value_enum, default_value_t)]
    pub mode: Mode,
    /// Stiff gains in the modes `open` and `force`: for a hand that must keep its place where nothing pushes
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

/// Runs a primitive.
///
/// # Errors
/// The primitive is wrong, the device refuses, or the arm stops before the end.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    let output = global.output();
    let outputs = command.record.iter().chain(&command.bus_log).map(PathBuf::as_path);
    output_file::apart(outputs).map_err(|error| files::failure(error, "run refused"))?;
    if let (Some(_), Some(Address::Simulated(_, SimulatorOptions { bus: Some(_), .. }))) =
        (&command.bus_log, global.address(DOING)?)
    {
        let cause = "`--bus-log` and `bus=` of the device name a log each; one of the two would not be written";
        return Err(Failure::new(ErrorCode::CommandLine, "run refused", cause).help("leave out one of the two"));
    }
    if command.stiff && command.mode.options().feedback {
        let cause =
            format!("--mode {} bends the plan, and an arm with stiff gains cannot follow it", command.mode.name());
        let help = "leave out `--stiff`, or take `--mode force` or `--mode open`";
        return Err(Failure::new(ErrorCode::CommandLine, "run refused", cause).help(help));
    }
    let stored = stored_name(&command.primitive);
    let mut opened = stored.is_some().then(|| open(command, global)).transpose()?;
    let file = match (&stored, &mut opened) {
        (Some(name), Some(client)) => get::fetch_newest(client, name, global, DOING)?,
        _ => upload::read(&command.primitive, DOING)?,
    };
    check_expectation(&file, command, output)?;
    let changes = changes(&file, command)?;
    let course = Course { speed: command.speed, goal: super::check::goal(command.goal), changes };
    let check = upload::precheck(&file, &course, output, DOING)?;
    let record = command.record.as_ref().filter(|_| !command.dry_run);
    let create = |path: &Path| RecordingFile::create(path, global, &[&command.primitive], DOING);
    let record = record.map(|path| create(path)).transpose()?;
    let started = Instant::now();
    let mut client = match opened {
        Some(client) => client,
        None => open(command, global)?,
    };
    let Cmd { speed, goal, mode, .. } = *command;
    let asked = Asked { file: &file, speed, goal, mode, check: &check };
    if command.dry_run {
        put(command, &mut client, &file, output)?;
        return tell_unmoved(&mut client, &asked, output);
    }
    let folder = command.keep.as_ref().map(|base| RunFolder::create(base, &file)).transpose()?;
    let sent = match &folder {
        Some(folder) => create(&folder.recording()).map(Some),
        None => Ok(record),
    };
    let sent = sent.and_then(|record| put(command, &mut client, &file, output).map(|()| record));
    let record = sent.inspect_err(|_| folder.iter().for_each(RunFolder::discard))?;
    let mut ended = carry_out(command, &mut client, &asked, record, started, global);
    if let Some(lost) = ended.as_ref().ok().and_then(|report| report.tracking.as_ref()?.missed()) {
        let recording = folder.as_ref().map(RunFolder::recording).or_else(|| command.record.clone());
        ended = ended.and_then(|report| Err(short_of_goal(&report, lost, recording.as_deref(), global)?));
    }
    ended = ended.map_err(|failure| connection::afterwards(failure, global));
    if let Some(folder) = folder {
        let kept = folder.finish(&mut ended, client.hello());
        let all = if kept.is_ok() { "everything" } else { "not everything" };
        // Somebody may have removed it meanwhile.
        if folder.path().is_dir() {
            output.say(format!("{all} about this run is in {}", folder.path().display()));
        }
        let name = Some(files::text(folder.path()));
        ended = ended.and_then(|report| kept.map(|()| Report { folder: name, ..report }));
    }
    let report = ended?;
    output.result(&report, report.to_text())
}

/// Puts the primitive into the device, unless it is there already.
fn put(command: &Cmd, client: &mut Client<Device>, file: &PrimitiveFile, output: Output) -> Result<(), Failure> {
    if command.bus_log.is_some() && client.transport().simulation().is_none() {
        let cause = std::io::Error::other("only a simulated bus can be logged");
        return Err(connection::failure(ProcedureError::Recording(cause), DOING));
    }
    if let Some(old) = upload::other_version(client, file, DOING)? {
        upload::say_replaced(&old, output);
    }
    upload::send(client, file, output, DOING)?;
    output.say(format!("'{}' is in the device", file.name));
    Ok(())
}

/// Meets the preconditions and plays the primitive.
fn carry_out(
    command: &Cmd,
    client: &mut Client<Device>,
    asked: &Asked<'_>,
    mut record: Option<RecordingFile>,
    started: Instant,
    global: &Global,
) -> Result<Report, Failure> {
    let output = global.output();
    let preconditions = meet(client, asked, command.at_home, output)?;
    let ready_s = client.is_virtual().then(|| client.now().as_secs_f64());
    let played = play(command, client, asked.file, record.as_mut(), output);
    connection::tell_speed(client, started, output);
    let played = played.map_err(|error| connection::failure(error, DOING));
    let (report, written) = match (played, record) {
        (Ok(played), record) => {
            let (report, written) = played;
            let written = written.map_err(|cause| connection::failure(ProcedureError::Recording(cause), DOING));
            (report, record.map_or(Ok(()), |record| record.end(written, output)))
        }
        (Err(failure), Some(record)) => return record.end(Err(failure), output),
        (Err(failure), None) => return Err(failure),
    };
    let report = Report { ready_s, preconditions, ..report };
    if let Err(failure) = written {
        // The run itself went to its end: how it went is told all the same.
        return Err(with_result(failure, &report, global)?);
    }
    if !client.is_simulated() {
        output.say("the arm holds its goal; `tactus stop` ends that");
    }
    Ok(report)
}

/// The failure of a run that ended elsewhere than at its goal.
fn short_of_goal(report: &Report, missed: Missed, record: Option<&Path>, global: &Global) -> Result<Failure, Failure> {
    let help = match record {
        Some(file) => {
            let (from, to) = (quoted::path(file), quoted::path(&file.with_extension("png")));
            format!("`tactus plot --run {from} --output {to}` shows where it went")
        }
        None => "`--record FILE` keeps the next run, and `tactus plot` shows where it went".to_owned(),
    };
    with_result(Failure::new(ErrorCode::GoalMissed, DOING, missed).help(help), report, global)
}

/// A failure behind a run that was played to its end; its report is told all the same.
fn with_result(failure: Failure, report: &Report, global: &Global) -> Result<Failure, Failure> {
    if !global.json {
        global.output().result(report, report.to_text())?;
    }
    Ok(match serde_json::to_value(report) {
        Ok(data) => failure.data(data),
        Err(_) => failure,
    })
}

/// Brings the device as far as it gets without moving, tells the preconditions, and refuses what lacks one.
fn meet(
    client: &mut Client<Device>,
    asked: &Asked<'_>,
    at_home: bool,
    output: Output,
) -> Result<Vec<Precondition>, Failure> {
    let started = connection::unmoved(client, at_home, output, DOING);
    let found = preflight::look(client, asked, DOING);
    if let Ok(list) = &found {
        preflight::tell(list, output);
    }
    match (started, found) {
        (Err(failure), Ok(list)) => Err(failure.data(json!({ "preconditions": list }))),
        (Err(failure), Err(_)) | (Ok(()), Err(failure)) => Err(failure),
        (Ok(()), Ok(list)) => {
            preflight::require(&list)?;
            procedure::initialise_hand(client).map_err(|error| connection::failure(error, DOING))?;
            Ok(list)
        }
    }
}

/// Ends a dry run: the preconditions as they are now, and those that a run would wait for.
fn tell_unmoved(client: &mut Client<Device>, asked: &Asked<'_>, output: Output) -> Result<(), Failure> {
    let list = preflight::look(client, asked, DOING)?;
    preflight::tell(&list, output);
    let missing = preflight::missing(&list);
    let words = if missing.is_empty() {
        "ready to run; nothing moved".to_owned()
    } else {
        format!("nothing moved; a run needs first: {}", missing.join(", "))
    };
    let data = DryRun { name: asked.file.name.clone(), dry_run: true, preconditions: list };
    output.result(&data, words)
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

/// The name of a primitive in the device, where the argument is that and no file. A folder is no primitive, whatever
/// its name: it does not hide the one in the device.
fn stored_name(primitive: &Path) -> Option<Name> {
    let is_file =
        primitive.exists() && !primitive.is_dir() || primitive.extension().is_some_and(|extension| extension == "toml");
    Name::new(primitive.to_str()?).ok().filter(|_| !is_file)
}

fn open(command: &Cmd, global: &Global) -> Result<Client<Device>, Failure> {
    connection::open(global, "run", |options| {
        options.bus_log = command.bus_log.clone().or(options.bus_log.take());
        options.reads = vec![command.primitive.clone()];
    })
}

/// Plays the primitive; beside the report, whether its recording could be written.
fn play(
    command: &Cmd,
    client: &mut Client<Device>,
    file: &PrimitiveFile,
    record: Option<&mut RecordingFile>,
    output: Output,
) -> Result<(Report, std::io::Result<()>), ProcedureError> {
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
    let mut writer = record.map(|record| record.begin(&notes)).transpose()?;
    let bar = output.bar((file.movement.duration / command.speed).ceil() as u64, "s", "running");
    let (mut cycles, mut written, mut is_running) = (Vec::new(), Ok(()), false);
    let before = Snapshot::of(client)?;
    client.take_answer_times();
    let outcome = procedure::play(client, &request, &mut |cycle| {
        if !is_running && State::from_code(cycle.state) == Some(State::Run) {
            is_running = true;
            bar.suspend(|| output.say(format!("running '{}' ({})", file.name, command.mode.name())));
        }
        cycles.push(*cycle);
        bar.set_position((cycles.len() as f64 / RATE) as u64);
        // A disk that is full is no reason to stop an arm: the run goes on, and is told of at its end.
        if let (Some(writer), Ok(())) = (&mut writer, &written) {
            written = writer.write(cycle);
        }
    });
    bar.finish_and_clear();
    let outcome = outcome?;
    let written = written.and_then(|()| writer.map_or(Ok(()), |writer| writer.finish().map(|_| ())));
    let bytes = recording_text(&cycles, &notes)?;
    tell(&outcome, output);
    let answers = client.take_answer_times();
    let after = Snapshot::of(client)?;
    let line = Some(LineHealth::between(&before, &after, &cycles, &answers));
    let report = report(client, file, command.mode, &bytes, outcome, &after.statistics)?;
    Ok((Report { line, ..report }, written))
}

/// Says what a person should know about how the run went.
fn tell(outcome: &RunOutcome, output: Output) {
    for surprise in &outcome.surprises {
        output.warn(format!(
            "unlike the successful runs: {} is unusual {:.2} s into the run, at phase {:.3}",
            surprise.channel, surprise.time_s, surprise.phase
        ));
    }
    let seconds = |samples: usize| samples as f64 / RATE;
    let FlagCounts { faded, saturated, stale, hand_lost, clamped, slowed, .. } = outcome.flags;
    for (samples, words) in [
        (clamped, "the adaptation was at its limits"),
        (faded, "the adaptation was derated or fading"),
        (saturated, "the force sensor was saturated; force control was paused"),
        (stale, "the force sensor was silent"),
        (hand_lost, "the hand did not answer and got no commands"),
        (slowed, "the run was held to half of the taught speed: the pendant warned, or a motor was hot"),
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
    let name = quoted::path(&file.file);
    // One that was read from the device has no file yet.
    let help = match file.file.is_file() {
        true => format!("tactus rehearse {name}"),
        false => format!("`tactus get {name}`, then tactus rehearse {name}.toml"),
    };
    let Some(expectation) = &file.expectation else {
        return Err(Failure::new(
            ErrorCode::NoExpectation,
            doing,
            format!("{}: the primitive has no expected forces", file.file.display()),
        )
        .help(help));
    };
    let primitive = file.to_primitive().map_err(|cause| super::check::failure(cause, &file.file, "run"))?;
    let trusted = |speed: f64| {
        let relative = expectation.recorded_duration / (file.movement.duration / speed);
        primitive.expected().map_or(0.0, |expected| expected.trust(relative))
    };
    let trust = trusted(command.speed);
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
    for (time, speed) in command.speed_at.iter().filter_map(|change| Some((change.time, change.speed()?))) {
        let trust = trusted(speed);
        if trust < 1.0 {
            let share = trust * 100.0;
            output.warn(format!("from {time} s on, at speed {speed:.2}, the adaptation is derated to {share:.0} %"));
        }
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
        changes: changes_in_words(command),
        ..files::origin(client, Some(file))
    };
    format!("Tactus recording of a run of '{}', {} Hz\n{origin}", file.name, control::RATE_HZ)
}

/// The changes on the way in words, in their order; none if there are none.
fn changes_in_words(command: &Cmd) -> Option<String> {
    let mut changes: Vec<&Change> = command.goal_at.iter().chain(&command.speed_at).collect();
    changes.sort_by(|one, other| one.time.total_cmp(&other.time));
    let words = changes.into_iter().filter_map(|Change { time, kind }| match kind {
        ChangeKind::Speed(speed) => Some(format!("speed {speed} at {time} s")),
        ChangeKind::Goal(goal) => goal.position.map(|[x, y, z]| format!("goal_m {x},{y},{z} at {time} s")),
    });
    let words: Vec<String> = words.collect();
    (!words.is_empty()).then(|| words.join("; "))
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
