//! Playing a stored primitive from its first cycle to its end: what `tactus run`, rehearsals and experiments share.
//!
//! The arm must stand at the start of the primitive and hold. Telemetry comes in every control cycle; changes of goal
//! and speed are sent when their time has come in the device's cycles, so that a simulated run is the same whatever the
//! machine does beside it.

use std::time::Duration;

use control::{Fault, State, flags};
use link::{Event, EventKind, Goal, Name, RunOptions, Telemetry};

use super::ProcedureError;
use super::wait::after;
use crate::client::{Client, Incoming};
use crate::demonstration::RATE;
use crate::device::Device;
use crate::error::HostError;

/// Silence on the stream after which the device counts as lost.
const SILENCE: Duration = Duration::from_secs(1);

/// Longest time a run may take beyond its planned duration, s: the device waits up to 5 s for an arm that comes to its
/// goal against friction, and more.
const SETTLING_ALLOWANCE: f64 = 8.0;

/// Time for which an arm that has stopped is watched on: its recording shows the fault, and how it came to rest.
const AFTERMATH: Duration = Duration::from_millis(500);

/// Longest time that a goal takes to a new place, s.
const GOAL_ALLOWANCE: f64 = 30.0;

/// Something that changes while a primitive runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Change {
    /// When, s after the first cycle of the run.
    pub time: f64,
    /// What.
    pub kind: ChangeKind,
}

impl Change {
    /// The new speed, if it is one.
    pub fn speed(&self) -> Option<f64> {
        match self.kind {
            ChangeKind::Speed(factor) => Some(f64::from(factor)),
            ChangeKind::Goal(_) => None,
        }
    }
}

/// A change during a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ChangeKind {
    /// The goal.
    Goal(Goal),
    /// The speed relative to the taught one.
    Speed(f32),
}

/// The run that is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct RunRequest {
    /// Name of the primitive in the device.
    pub name: Name,
    /// How.
    pub options: RunOptions,
    /// Duration as taught, s.
    pub duration: f64,
    /// Time to go on watching after the arm has arrived, s.
    pub rest: f64,
    /// Changes on the way, in any order.
    pub changes: Vec<Change>,
}

impl RunRequest {
    /// A run without changes on the way, watched for a second after its end.
    pub fn new(name: Name, duration: f64, options: RunOptions) -> RunRequest {
        RunRequest { name, options, duration, rest: 1.0, changes: Vec::new() }
    }

    /// Longest time the movement may take until it arrives, s: at the slowest speed of the run all the way, and more.
    pub fn longest(&self) -> f64 {
        let slowest = self.changes.iter().filter_map(Change::speed).fold(f64::from(self.options.speed), f64::min);
        let taught = self.duration / slowest.max(0.05) + SETTLING_ALLOWANCE;
        let changed = self.options.goal != Goal::default()
            || self.changes.iter().any(|change| matches!(change.kind, ChangeKind::Goal(_)));
        if changed { taught + 0.5 * self.duration / slowest.max(0.05) + GOAL_ALLOWANCE } else { taught }
    }
}

/// Duration of a movement of `duration` s begun at `speed`, with its changes of speed on the way, s.
pub fn planned(duration: f64, speed: f64, changes: &[Change]) -> f64 {
    let mut speeds: Vec<(f64, f64)> = changes
        .iter()
        .filter_map(|change| match change.kind {
            ChangeKind::Speed(factor) => Some((change.time, f64::from(factor))),
            ChangeKind::Goal(_) => None,
        })
        .collect();
    speeds.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut time, mut left, mut speed) = (0.0, duration, speed);
    for (at, factor) in speeds {
        let passed = (at - time).min(left / speed);
        (time, left, speed) = (time + passed, left - passed * speed, factor);
    }
    time + left / speed
}

/// The device told that a run does not go as the successful ones did.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, schemars::JsonSchema)]
pub struct Surprise {
    /// Control cycle.
    pub cycle: u32,
    /// Time since the first cycle of the run, s.
    pub time_s: f64,
    /// Phase of the movement when it was told: 1 at its start, towards 0 at its end.
    pub phase: f64,
    /// The channel that stood out, as a word.
    pub channel: &'static str,
}

/// Names of the channels that the statistics compare.
pub const CHANNELS: [&str; control::plan::primitive::STATISTICS_CHANNELS] = [
    "force x",
    "force y",
    "force z",
    "torque x",
    "torque y",
    "torque z",
    "gauge F1",
    "gauge F2",
    "gauge F3",
    "finger F1",
    "finger F2",
    "finger F3",
];

/// Samples of a run in which something out of the ordinary was going on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, schemars::JsonSchema)]
pub struct FlagCounts {
    /// The torque limiter was at work.
    pub limited: usize,
    /// The adaptation was at its limits.
    pub clamped: usize,
    /// The adaptation was derated or fading.
    pub faded: usize,
    /// The force sensor was saturated.
    pub saturated: usize,
    /// There was no fresh wrench.
    pub stale: usize,
    /// The hand's replies were missing for so long that it was left alone.
    pub hand_lost: usize,
    /// The run was held to half of the taught speed.
    pub slowed: usize,
}

impl FlagCounts {
    /// Counts one sample.
    pub fn add(&mut self, sample: u32) {
        let count = |counter: &mut usize, mask: u32| *counter += usize::from(sample & mask != 0);
        count(&mut self.limited, flags::JOINT_LIMITED | flags::MOTOR_LIMITED | flags::RATE_LIMITED);
        count(&mut self.clamped, flags::CLAMPED);
        count(&mut self.faded, flags::FEEDBACK_FADED);
        count(&mut self.saturated, flags::SENSOR_SATURATED);
        count(&mut self.stale, flags::WRENCH_STALE);
        count(&mut self.hand_lost, flags::HAND_LOST);
        count(&mut self.slowed, flags::SLOWED);
    }
}

/// Result of a run.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RunOutcome {
    /// First cycle of the run.
    pub first_cycle: u32,
    /// Time from the first cycle of the run until the arm had arrived, s.
    pub arrived_s: f64,
    /// Samples seen, from before the start until the rest at the end.
    pub samples: usize,
    /// Irregularities, in samples of the movement itself.
    pub flags: FlagCounts,
    /// Where the device was surprised.
    pub surprises: Vec<Surprise>,
}

/// Runs a primitive and hands every cycle to `on_cycle`, from the start of the stream until the rest behind the end.
///
/// # Errors
/// The device refuses the run or a change, the arm stops by itself, or it does not arrive; then it has been stopped.
pub fn play(
    client: &mut Client<Device>,
    request: &RunRequest,
    on_cycle: &mut dyn FnMut(&Telemetry),
) -> Result<RunOutcome, ProcedureError> {
    client.set_telemetry(1)?;
    let outcome = follow(client, request, on_cycle);
    if matches!(outcome, Err(ProcedureError::Stopped(_) | ProcedureError::Diverted(_))) {
        watch_on(client, on_cycle);
    }
    // The stream must not run on into the next procedure, and the first error is the one to tell.
    let silenced = client.set_telemetry(0);
    let outcome = outcome?;
    silenced?;
    Ok(outcome)
}

fn follow(
    client: &mut Client<Device>,
    request: &RunRequest,
    on_cycle: &mut dyn FnMut(&Telemetry),
) -> Result<RunOutcome, ProcedureError> {
    client.take_events();
    client.run(&request.name, request.options)?;
    let mut changes = request.changes.clone();
    // The end of the list goes first: of several at one moment the first one given goes first, as in the check.
    changes.sort_by(|a, b| a.time.total_cmp(&b.time));
    changes.reverse();
    let mut outcome = RunOutcome::default();
    let (mut first, mut arrived) = (None, None);
    loop {
        match client.next(SILENCE)? {
            None => return Err(HostError::NoAnswer { request: "telemetry", after: SILENCE }.into()),
            Some(Incoming::Event(event)) => match event.kind {
                EventKind::Arrived => arrived = arrived.or(Some(event.cycle)),
                EventKind::State => after(event.code, event.detail)?,
                EventKind::Surprise => outcome.surprises.push(surprise(&event, first)),
                _ => {}
            },
            Some(Incoming::Telemetry(telemetry)) => {
                outcome.samples += 1;
                let state = State::from_code(telemetry.state);
                let running = matches!(state, Some(State::Run | State::Coast));
                if running {
                    // What is bridged may still be the hold before.
                    first = first.or((state == Some(State::Run)).then_some(telemetry.cycle));
                    outcome.flags.add(telemetry.flags);
                } else if first.is_some() && arrived.is_none() {
                    // The event may have been lost; the state cannot.
                    arrived = (state == Some(State::Hold)).then_some(telemetry.cycle);
                    let fault = Fault::from_code(telemetry.fault).unwrap_or(Fault::None);
                    after(u16::from(telemetry.state), u32::from(fault.code()))?;
                }
                on_cycle(&telemetry);
                let Some(first) = first else { continue };
                let time = since(first, telemetry.cycle);
                while changes.last().is_some_and(|change| change.time <= time) {
                    if let (Some(change), None) = (changes.pop(), arrived) {
                        apply(client, &change)?;
                    }
                }
                match arrived {
                    Some(at) if since(at, telemetry.cycle) >= request.rest => {
                        outcome.first_cycle = first;
                        outcome.arrived_s = since(first, at);
                        return Ok(outcome);
                    }
                    None if time > request.longest() => {
                        client.stop()?;
                        let seconds = request.longest() as u64;
                        return Err(ProcedureError::TooLong { what: "the movement", seconds });
                    }
                    _ => {}
                }
            }
        }
    }
}

/// Hands on the cycles after an arm has stopped. What ends the stream now is no news: the stop is what is told.
fn watch_on(client: &mut Client<Device>, on_cycle: &mut dyn FnMut(&Telemetry)) {
    let end = client.now() + AFTERMATH;
    while client.now() < end {
        match client.next(end.saturating_sub(client.now())) {
            Ok(Some(Incoming::Telemetry(telemetry))) => on_cycle(&telemetry),
            Ok(Some(_)) => {}
            Ok(None) | Err(_) => return,
        }
    }
}

fn apply(client: &mut Client<Device>, change: &Change) -> Result<(), HostError> {
    match change.kind {
        ChangeKind::Goal(goal) => client.set_goal(goal),
        ChangeKind::Speed(factor) => client.set_speed(factor),
    }
}

fn surprise(event: &Event, first: Option<u32>) -> Surprise {
    Surprise {
        cycle: event.cycle,
        time_s: first.map_or(0.0, |first| since(first, event.cycle)),
        phase: f64::from(event.detail) / 1000.0,
        channel: CHANNELS.get(usize::from(event.code)).copied().unwrap_or("unknown channel"),
    }
}

/// Time from one cycle to a later one, s; 0 for an earlier one, which a counter that wraps cannot tell from one far
/// ahead.
fn since(first: u32, cycle: u32) -> f64 {
    let cycles = cycle.wrapping_sub(first);
    if cycles > u32::MAX / 2 { 0.0 } else { f64::from(cycles) / RATE }
}
