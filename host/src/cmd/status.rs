//! `tactus status`: what the device says of itself and its arm. Nothing is asked to move, nothing is started.

use clap::Args;
use control::{Fault, State};
use device::Stage;
use link::{HandStage, HomeSource, Status};
use serde_json::json;

use super::{Failure, Global, Table, connection, weigh};
use lab::error::{HostError, explain_blocked};

/// Options of `status`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {}

/// Shows the state of the device.
///
/// # Errors
/// The device cannot be reached.
pub fn run(_command: &Cmd, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "status";
    let mut client = connection::observe(global, DOING)?;
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
    let hello = client.hello();
    let board = format!("{} ({})", hello.board.as_str(), hello.firmware.as_str());
    let drives = hello.capabilities;
    let fault = Fault::from_code(status.fault).filter(|fault| *fault != Fault::None);
    let stage = Stage::from_code(status.startup_stage).map_or("unknown", Stage::explanation);
    let state = State::from_code(status.state).map_or("unknown", State::name);
    global.output().result(
        &json!({
            "board": hello.board.as_str(), "firmware": hello.firmware.as_str(), "cycle": status.cycle,
            "drives_arm": drives.arm, "drives_hand": drives.hand, "reads_wrench": drives.wrench,
            "startup": stage, "blocked": status.blocked.map(explain_blocked), "state": state, "fault": status.fault,
            "zeroed": status.zeroed, "home": source.map(HomeSource::name), "weight": weight,
            "safety_mode": status.safety_mode,
            "wrench_zeroed": status.wrench_zeroed, "hand": status.hand_stage.name(), "q_rad": status.q,
            "hand_rad": status.hand, "loaded": status.loaded.as_ref().map(|name| name.as_str()),
        }),
        text(&status, &board, stage, state, fault, (source, weight.as_deref())),
    )
}

fn text(
    status: &Status,
    board: &str,
    stage: &str,
    state: &str,
    fault: Option<Fault>,
    (source, weight): (Option<HomeSource>, Option<&str>),
) -> String {
    let blocked = status.blocked.map(|numbers| format!(": {}", explain_blocked(numbers))).unwrap_or_default();
    let mut table = Table::new(["device", board]);
    table
        .row(["start-up", &format!("{stage}{blocked}")])
        .row(["state", state])
        .row(["fault", &fault.map_or_else(|| "none".to_owned(), |fault| fault.to_string())])
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

fn safety_mode(mode: Option<u8>) -> &'static str {
    match mode {
        Some(0) => "emergency stop",
        Some(1) => "idle",
        Some(2) => "active",
        Some(_) => "unknown",
        None => "has not answered",
    }
}

fn force_sensor(zeroed: Option<bool>) -> &'static str {
    match zeroed {
        Some(true) => "has its zero",
        Some(false) => "no zero yet: the arm has not rested",
        None => "none, or not looked for yet",
    }
}

fn numbers(values: &[f32]) -> String {
    values.iter().map(|value| format!("{value:.4}")).collect::<Vec<_>>().join(" ")
}
