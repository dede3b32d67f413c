//! The report of a run, for people and for scripts.

use std::path::Path;

use link::Statistics;
use schemars::JsonSchema;
use serde::Serialize;

use super::Table;
use super::preflight::Precondition;
use lab::client::Client;
use lab::demonstration::{RATE, Recording};
use lab::device::Device;
use lab::line_health::LineHealth;
use lab::primitive_file::PrimitiveFile;
use lab::procedure::{FlagCounts, Mode, ProcedureError, RunOutcome, Surprise};
use lab::tracking::{HandTracking, Tracking};

/// The result of `run`.
#[derive(Debug, Clone, Serialize, JsonSchema)]
#[serde(untagged)]
#[allow(clippy::large_enum_variant, reason = "only its schema is used")]
pub enum Ran {
    /// The arm has moved.
    Played(Report),
    /// `--dry-run`
    Dry(DryRun),
}

/// The result of a run without motion.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct DryRun {
    /// Name of the primitive.
    pub name: String,
    /// Always true.
    pub dry_run: bool,
    /// The preconditions as they are now.
    pub preconditions: Vec<Precondition>,
}

/// The result of a run.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Report {
    /// Name of the primitive.
    pub name: String,
    /// Use of the measured force in the run.
    pub mode: &'static str,
    /// Folder with everything about this run; `null`: none was asked for.
    pub folder: Option<String>,
    /// The preconditions before anything moved.
    pub preconditions: Vec<Precondition>,
    /// Duration of the movement, s.
    pub duration_s: f64,
    /// Tracking of the plan by the tool; none where a hand alone is driven.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tracking: Option<Tracking>,
    /// Tracking of the plan by the digits, where a hand alone is driven.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hand_tracking: Option<HandTracking>,
    /// Health of the bus and of the line to the host while the arm moved.
    pub line: Option<LineHealth>,
    /// Samples in the recording, and how many the link lost.
    pub samples: usize,
    /// Telemetry messages lost.
    pub gaps: u32,
    /// Largest difference between the force on the tool and the one that the primitive expects, N; none where it
    /// expects none.
    pub force_error_max_n: Option<f64>,
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
#[derive(Debug, Clone, Serialize, JsonSchema)]
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

/// The report of a run that has ended; `line` and `preconditions` are left to whoever knows them.
///
/// # Errors
/// The device does not answer, or what was recorded reads back wrong.
pub(super) fn report(
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
        folder: None,
        preconditions: Vec::new(),
        duration_s: duration(&recording.running()),
        tracking,
        hand_tracking,
        samples: outcome.samples,
        gaps,
        line: None,
        force_error_max_n: force_error(file, &recording),
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

/// Time from the beginning of the first cycle of a run to the end of its last one, s. Cycles that were lost on the line
/// took theirs all the same.
fn duration(run: &Recording) -> f64 {
    let span = run.time.first().zip(run.time.last());
    span.map_or(0.0, |(first, last)| last - first + 1.0 / RATE)
}

/// Largest difference between measured and expected force in the run, N.
fn force_error(file: &PrimitiveFile, recording: &Recording) -> Option<f64> {
    let primitive = file.to_primitive().ok()?;
    let (expected, run) = (primitive.expected()?, recording.running());
    let samples = run.phase.as_ref()?.iter().zip(run.wrench.as_ref()?).filter(|(phase, _)| **phase > 0.0);
    let errors = samples.map(|(phase, measured)| {
        let passed = (-phase.ln() / file.movement.alpha).clamp(0.0, 1.0);
        let expects = expected.at(passed);
        (0..3).map(|axis| (measured[axis] - expects[axis]).powi(2)).sum::<f64>().sqrt()
    });
    errors.reduce(f64::max)
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
        if let Some(error) = self.force_error_max_n {
            row("largest force error", format!("{error:.2} N"));
        }
        if let Some(line) = &self.line {
            row("newest 100 cycles", line.summary());
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

#[cfg(test)]
mod tests {
    use super::*;

    /// The change that makes it fail: the samples are counted.
    #[test]
    fn a_run_takes_its_time_whatever_the_line_loses_of_it() {
        let told = |is_lost: fn(u32) -> bool| {
            let rows = (0..900).filter(|cycle| !is_lost(*cycle)).map(|cycle| {
                let state = if (150..750).contains(&cycle) { "run" } else { "hold" };
                format!("{cycle},{:.6},{state}\n", f64::from(cycle) / RATE)
            });
            let text = "cycle,t_s,state\n".to_owned() + &rows.collect::<String>();
            duration(&Recording::parse(Path::new("run"), text.as_bytes()).unwrap().running())
        };
        for lost in [|_| false, |cycle: u32| cycle.is_multiple_of(5) && cycle != 150] as [fn(u32) -> bool; 2] {
            assert!((told(lost) - 600.0 / RATE).abs() < 1e-5, "{}", told(lost));
        }
    }
}
