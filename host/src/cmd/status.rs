//! `tactus status`: what the device says of itself and its arm. Nothing is asked to move, nothing is started.

use std::time::Duration;

use clap::Args;
use control::{Fault, State};
use device::Stage;
use link::{HandStage, HomeSource, Status};
use schemars::JsonSchema;
use serde::Serialize;

use super::storage::{self, Storage};
use super::{Failure, Global, Table, connection, weigh};
use lab::error::{HostError, explain_blocked};
use lab::line_health::{self, LineHealth};
use lab::startup_guide::blocked_remedy;

/// Options of `status`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// Look at the bus and the line for so many seconds: complete cycles, gaps, times of answers, who was late
    #[arg(long, value_name = "SECONDS", value_parser = crate::config::seconds, allow_hyphen_values = true)]
    pub line: Option<Duration>,
}

/// Shows the state of the device.
///
/// # Errors
/// The device cannot be reached.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "status";
    let mut client = if command.line.is_some() && global.is_simulated_here() {
        // It has just been switched on: before its start-up there are no control cycles to look at.
        let mut client = connection::open(global, DOING, |_| {})?;
        connection::unmoved(&mut client, false, global.output(), DOING)?;
        client
    } else {
        connection::observe(global, DOING)?
    };
    let status = client.status().map_err(|error| error.into_failure(DOING))?;
    let source = match client.calibration() {
        Ok(calibration) => Some(calibration.source),
        // A hand alone has no home, and a device that is reading its storage does not know it yet.
        Err(HostError::Refused { .. }) => None,
        Err(error) => return Err(error.into_failure(DOING)),
    };
    let weight = match client.weight() {
        Ok(weight) => Some(weigh::weight_words(&weight)),
        Err(HostError::Refused { .. }) => None,
        Err(error) => return Err(error.into_failure(DOING)),
    };
    let storage = storage::ask(&mut client).map_err(|error| error.into_failure(DOING))?;
    let silences = client.statistics().map_err(|error| error.into_failure(DOING))?.link_timeouts;
    let line = command.line.map(|time| line_health::measure(&mut client, time)).transpose();
    let line = line.map_err(|error| error.into_failure(DOING))?;
    let hello = client.hello();
    let board = format!("{} ({})", hello.board.as_str(), hello.firmware.as_str());
    let drives = hello.capabilities;
    let fault = Fault::from_code(status.fault).filter(|fault| *fault != Fault::None);
    let stage = Stage::from_code(status.startup_stage).map_or("unknown", Stage::explanation);
    let state = State::from_code(status.state).map_or("unknown", State::name);
    let text = text(&status, &board, stage, state, (fault, silences), (source, weight.as_deref()))
        + &condition(storage.as_ref())
        + &words(line.as_ref());
    let data = StatusReport {
        board: hello.board.as_str().to_owned(),
        firmware: hello.firmware.as_str().to_owned(),
        cycle: status.cycle,
        drives_arm: drives.arm,
        drives_hand: drives.hand,
        reads_wrench: drives.wrench,
        startup: stage,
        blocked: status.blocked.map(explain_blocked),
        help: status.blocked.and_then(blocked_remedy),
        state,
        fault: status.fault,
        silences,
        zeroed: status.zeroed,
        home: source.map(HomeSource::name),
        weight,
        safety_mode: status.safety_mode,
        wrench_zeroed: status.wrench_zeroed,
        hand: status.hand_stage.name(),
        q_rad: status.q,
        hand_rad: status.hand,
        loaded: status.loaded.as_ref().map(|name| name.as_str().to_owned()),
        storage,
        line,
    };
    global.output().result(&data, text)
}

/// Data of `tactus --json status`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct StatusReport {
    /// Name of the board.
    pub board: String,
    /// Version of its firmware.
    pub firmware: String,
    /// Control cycles since start-up.
    pub cycle: u32,
    /// The program of the device is made for an arm.
    pub drives_arm: bool,
    /// The same for a hand.
    pub drives_hand: bool,
    /// The same for a force/torque sensor.
    pub reads_wrench: bool,
    /// Stage of the start-up in words.
    pub startup: &'static str,
    /// Why the start-up cannot go on; null where it can.
    pub blocked: Option<String>,
    /// The remedy for that.
    pub help: Option<&'static str>,
    /// State of the supervisor.
    pub state: &'static str,
    /// Code of the latched fault, 0 for none.
    pub fault: u8,
    /// Motions since start-up that the device stopped because their host fell silent.
    pub silences: u32,
    /// The encoders count from a known pose.
    pub zeroed: bool,
    /// Whose home counts; null where that is not known yet, and for a hand alone.
    pub home: Option<&'static str>,
    /// Whose weight the links are taken to have; likewise.
    pub weight: Option<String>,
    /// Mode of the safety module: 0 emergency stop, 1 idle, 2 active; null before it answered.
    pub safety_mode: Option<u8>,
    /// The wrench has a zero; null without a force/torque sensor.
    pub wrench_zeroed: Option<bool>,
    /// Stage of the hand's start-up.
    pub hand: &'static str,
    /// Joint angles J1 to J7, rad; they mean something where `zeroed` is true.
    pub q_rad: [f32; 7],
    /// Spread and fingers F1 to F3, rad; 0 unless the hand is ready.
    pub hand_rad: [f32; 4],
    /// The primitive in use.
    pub loaded: Option<String>,
    /// Losses of the storage; null while the device reads it.
    pub storage: Option<Storage>,
    /// Health of the line; null unless `--line` was given.
    pub line: Option<LineHealth>,
}

fn text(
    status: &Status,
    board: &str,
    stage: &str,
    state: &str,
    (fault, silences): (Option<Fault>, u32),
    (source, weight): (Option<HomeSource>, Option<&str>),
) -> String {
    let blocked = status.blocked.map(|numbers| format!(": {}", explain_blocked(numbers))).unwrap_or_default();
    let mut table = Table::new(["device", board]);
    table.row(["start-up", &format!("{stage}{blocked}")]);
    if let Some(remedy) = status.blocked.and_then(blocked_remedy) {
        table.row(["help", remedy]);
    }
    table.row(["state", state]).row(["fault", &fault.map_or_else(|| "none".to_owned(), |fault| fault.to_string())]);
    // No fault tells of such a stop, and whoever could have heard of it was gone.
    if silences > 0 {
        table.row(["stopped, its host silent", &format!("{silences} since the device started")]);
    }
    table
        .row(["safety module", safety_mode(status.safety_mode)])
        .row(["joint angles", if status.zeroed { "count from home" } else { "not zeroed" }])
        .row(["home", source.map_or("not known", HomeSource::name)])
        .row(["weight of the links", weight.unwrap_or("not known")])
        .row(["force sensor", force_sensor(status.wrench_zeroed)])
        .row(["hand", status.hand_stage.name()])
        .row(["primitive in use", status.loaded.as_ref().map_or("none", |name| name.as_str())]);
    if status.zeroed {
        table.row(["J1 to J7, rad", &numbers(&status.q)]);
    }
    if status.hand_stage == HandStage::Ready {
        table.row(["spread, F1 to F3, rad", &numbers(&status.hand)]);
    }
    table.to_string()
}

/// Complaints about the storage; empty where nothing is, or it is not known yet.
fn condition(storage: Option<&Storage>) -> String {
    storage.map(storage::complaints).unwrap_or_default().iter().map(|line| format!("storage: {line}\n")).collect()
}

/// The health of the line as a table of its own; empty where it was not asked for.
fn words(line: Option<&LineHealth>) -> String {
    let Some(line) = line else { return String::new() };
    let mut table = Table::new(["line", &format!("{} cycles", line.cycles)]);
    for (name, value) in line.rows() {
        table.row([name, &value]);
    }
    format!("\n{table}")
}

pub(super) fn safety_mode(mode: Option<u8>) -> &'static str {
    match mode {
        Some(0) => "emergency stop",
        Some(1) => "idle",
        Some(2) => "active",
        Some(_) => "unknown",
        None => "has not answered",
    }
}

pub(super) fn force_sensor(zeroed: Option<bool>) -> &'static str {
    match zeroed {
        Some(true) => "has its zero",
        Some(false) => "no zero yet: the arm has not rested",
        None => "none, or not looked for yet",
    }
}

fn numbers(values: &[f32]) -> String {
    values.iter().map(|value| format!("{value:.4}")).collect::<Vec<_>>().join(" ")
}
