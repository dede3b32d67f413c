//! `tactus run`: the arm plays a primitive, watched and written down.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use control::{State, flags};
use embedded_can::Frame as _;
use link::{EventKind, Goal, RunOptions, Statistics};
use serde::Serialize;

use super::{Failure, Global, Output, Table, connection, upload};
use crate::client::Client;
use crate::demonstration::{RATE, Recording};
use crate::device::Device;
use crate::primitive_file::PrimitiveFile;
use crate::procedure::{self, ProcedureError, Recorder, Take};
use crate::tracking::Tracking;

/// Rest that is recorded at the goal, s.
const AFTERGLOW: f64 = 1.0;

/// A joint farther than this from the start posture makes the arm go there first, rad; the device refuses at 50 mrad.
const START_TOLERANCE: f64 = 0.02;

/// Longest time a run may take beyond its planned duration, s.
const PATIENCE: f64 = 5.0;

/// Instructions per tick of the emulated board's clock (125 million and 25 million a second).
const INSTRUCTIONS_PER_TICK: u32 = 5;

/// Options of `run`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// The primitive, TOML; it is uploaded unless the device has it already
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

/// What a run came to.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// Name of the primitive.
    pub name: String,
    /// Duration of the movement, s.
    pub duration_s: f64,
    /// How well the plan was kept.
    pub tracking: Tracking,
    /// Samples in the recording, and how many the link lost.
    pub samples: usize,
    /// Telemetry messages lost.
    pub gaps: u32,
    /// Samples in which the torque limiter was at work.
    pub limited_samples: usize,
    /// Control cycles since the device was switched on.
    pub cycles: u32,
    /// Cycles whose torque frames were not queued in time.
    pub missed_deadlines: u32,
    /// Replies of pucks or sensor that did not come in their cycle.
    pub lost_replies: u32,
    /// Worst control computation, instructions; 0 where the board cannot tell.
    pub worst_instructions: u32,
    /// Mean control computation, instructions.
    pub mean_instructions: u32,
    /// Worst delay from timer to control task, us.
    pub worst_latency_us: f64,
    /// Stack used at the most, bytes.
    pub stack_used: u32,
    /// Telemetry left out because the line was full.
    pub telemetry_dropped: u32,
    /// What only the simulated bus knows.
    pub bus: Option<BusReport>,
}

/// What the simulated bus saw since the device was switched on.
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
    let file = upload::read(&command.primitive, DOING)?;
    upload::precheck(&file, command.speed, output, DOING)?;
    let started = Instant::now();
    let mut client = connection::open(global, DOING, |_| {})?;
    if command.bus_log.is_some()
        && let Some(simulation) = client.transport().simulation()
    {
        simulation.plant().record_bus();
    }
    upload::send(&mut client, &file, output, DOING)?;
    output.say(format!("'{}' is in the device", file.name));
    if command.dry_run {
        return output
            .result(&serde_json::json!({ "name": file.name, "dry_run": true }), "ready to run; nothing moved");
    }
    connection::ready(&mut client, command.at_home, output, DOING)?;
    let result = play(command, &mut client, &file, output);
    if let Some(path) = &command.bus_log {
        write_bus_log(&mut client, path)
            .map_err(|cause| connection::failure(ProcedureError::Recording(cause), DOING))?;
    }
    let report = result.map_err(|error| connection::failure(error, DOING))?;
    connection::tell_speed(&client, started, output);
    if let Some(path) = &command.record {
        output.say(format!("wrote {}", path.display()));
    }
    if !client.hello().simulated {
        output.say("the arm holds its goal; `tactus stop` makes it soft");
    }
    output.result(&report, report.to_text())
}

fn play(
    command: &Cmd,
    client: &mut Client<Device>,
    file: &PrimitiveFile,
    output: Output,
) -> Result<Report, ProcedureError> {
    go_to_start(client, file, output)?;
    let mut recorder = Recorder::start(client, Vec::new(), &notes(client, file))?;
    client.take_events();
    let name =
        link::Name::new(&file.name).map_err(|error| crate::transport::TransportError::other(error.to_string()))?;
    let goal = Goal { position: command.goal.map(|goal| goal.map(|value| value as f32)), orientation: None };
    client.run(&name, RunOptions { goal, speed: command.speed as f32, ..RunOptions::default() })?;

    output.say(format!("running '{}'", file.name));
    let planned = file.duration / command.speed;
    let bar = output.bar((planned * RATE) as u64, "running");
    let limited = flags::JOINT_LIMITED | flags::MOTOR_LIMITED | flags::RATE_LIMITED;
    let mut limited_samples = 0;
    let mut arrived: Option<usize> = None;
    loop {
        match recorder.take(client)? {
            Take::Event(event) => match event.kind {
                EventKind::Arrived => arrived = Some(recorder.rows()),
                EventKind::State => procedure::after(event.code, event.detail)?,
                _ => {}
            },
            Take::Cycle(telemetry) => {
                limited_samples += usize::from(telemetry.flags & limited != 0);
                bar.set_position(recorder.rows() as u64);
            }
        }
        let rows = recorder.rows();
        if arrived.is_some_and(|at| rows as f64 >= at as f64 + AFTERGLOW * RATE) {
            break;
        }
        if rows as f64 > (planned + PATIENCE) * RATE && arrived.is_none() {
            client.stop()?;
            return Err(ProcedureError::TooLong { what: "the movement", seconds: (planned + PATIENCE) as u64 });
        }
    }
    bar.finish_and_clear();
    let rows = recorder.rows();
    let bytes = recorder.finish(client)?;
    if let Some(path) = &command.record {
        std::fs::write(path, &bytes)?;
    }
    let statistics = client.statistics()?;
    report(client, file, &bytes, (rows, limited_samples), &statistics)
}

/// Brings the arm to the posture in which the primitive begins.
fn go_to_start(client: &mut Client<Device>, file: &PrimitiveFile, output: Output) -> Result<(), ProcedureError> {
    let status = client.status()?;
    let start = file.start.posture;
    let far = status.q.iter().zip(&start).any(|(q, start)| (f64::from(*q) - start).abs() > START_TOLERANCE);
    let standing = State::from_code(status.state) == Some(State::Hold);
    if far || !standing {
        let spinner = output.spinner("moving to the start");
        let travelled = procedure::travel(client, start.map(|angle| angle as f32), |passed| {
            spinner.set_message(format!("moving to the start, {passed:.0} s"));
        });
        spinner.finish_and_clear();
        travelled?;
    }
    Ok(())
}

fn notes(client: &Client<Device>, file: &PrimitiveFile) -> String {
    let simulated = if client.hello().simulated { " (simulated arm)" } else { "" };
    format!("Tactus recording of a run of '{}', 300 Hz, on {}{simulated}", file.name, client.hello().board.as_str())
}

fn report(
    client: &mut Client<Device>,
    file: &PrimitiveFile,
    bytes: &[u8],
    (rows, limited_samples): (usize, usize),
    statistics: &Statistics,
) -> Result<Report, ProcedureError> {
    let unreadable = |error: &dyn std::fmt::Display| std::io::Error::other(format!("it reads back wrong: {error}"));
    let recording = Recording::parse(Path::new("run"), bytes).map_err(|error| unreadable(&error))?;
    let tracking = Tracking::of_run(&recording).map_err(|error| unreadable(&error))?;
    let ticks_per_second = client.hello().ticks_per_second;
    let counts_instructions = client.hello().board.as_str().starts_with("mps2");
    let instructions = |ticks: u32| {
        if counts_instructions { ticks * INSTRUCTIONS_PER_TICK } else { 0 }
    };
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
    Ok(Report {
        name: file.name.clone(),
        duration_s: tracking.samples as f64 / RATE,
        tracking,
        samples: rows,
        gaps,
        limited_samples,
        cycles: statistics.cycles,
        missed_deadlines: statistics.missed_deadlines,
        lost_replies: statistics.lost_replies,
        worst_instructions: instructions(statistics.cost_worst_ticks),
        mean_instructions: instructions(statistics.cost_mean_ticks),
        worst_latency_us: f64::from(statistics.latency_worst_ticks) * 1e6 / f64::from(ticks_per_second.max(1)),
        stack_used: statistics.stack_size.saturating_sub(statistics.stack_free),
        telemetry_dropped: statistics.telemetry_dropped,
        bus,
    })
}

impl Report {
    /// The report as a table for people.
    pub fn to_text(&self) -> String {
        let tracking = &self.tracking;
        let mut table = Table::new(["run", &self.name]);
        let mut row = |name: &str, value: String| {
            table.row([name.to_owned(), value]);
        };
        row("duration", format!("{:.2} s", self.duration_s));
        row(
            "tracking, RMS",
            format!("{:.2} mm  {:.2} deg", tracking.position_rms_m * 1e3, tracking.orientation_rms_rad.to_degrees()),
        );
        row(
            "tracking, worst",
            format!("{:.2} mm  {:.2} deg", tracking.position_max_m * 1e3, tracking.orientation_max_rad.to_degrees()),
        );
        row(
            "error at the goal",
            format!("{:.2} mm  {:.2} deg", tracking.position_end_m * 1e3, tracking.orientation_end_rad.to_degrees()),
        );
        row("cycles since power-up", self.cycles.to_string());
        row("missed deadlines", self.missed_deadlines.to_string());
        row("lost replies", self.lost_replies.to_string());
        row("samples, lost on the link", format!("{}, {}", self.samples, self.gaps));
        row("samples with limited torque", self.limited_samples.to_string());
        if self.worst_instructions > 0 {
            row("control cycle, worst", format!("{} instructions", self.worst_instructions));
            row("control cycle, mean", format!("{} instructions", self.mean_instructions));
            row("timer latency, worst", format!("{:.1} us", self.worst_latency_us));
            row("stack used", format!("{} bytes", self.stack_used));
        }
        if let Some(bus) = &self.bus {
            row("bus load", format!("{:.1} %", bus.load * 100.0));
            row("bus frames, invalid", format!("{}, {}", bus.frames, bus.invalid_frames));
            row("bus hash", bus.hash.clone());
        }
        table.to_string()
    }
}

/// Every frame of the simulated bus as a line `(seconds) can0 ID#DATA`.
fn write_bus_log(client: &mut Client<Device>, path: &Path) -> std::io::Result<()> {
    let Some(simulation) = client.transport().simulation() else {
        return Err(std::io::Error::other("only a simulated bus can be written down"));
    };
    let mut file = BufWriter::new(File::create(path)?);
    for passage in simulation.plant().recorded() {
        let frame = &passage.frame;
        let seconds = sim::seconds(passage.start);
        write!(file, "({seconds:.6}) can0 {:03X}#", frame.can_id().raw())?;
        for byte in frame.data() {
            write!(file, "{byte:02X}")?;
        }
        writeln!(file)?;
    }
    file.flush()
}
