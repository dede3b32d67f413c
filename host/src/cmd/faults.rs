//! `tactus faults`: the present fault and the last one, what to do about them, and the second before it.

mod data;

use std::path::PathBuf;

use clap::Args;
use control::{Fault, State};
use lab::client::LastSecond;
use lab::fault_guide::FaultGuide;
use lab::procedure::recording_text;
use lab::table::Table;
use link::{Status, Telemetry};
use puck::PendantState;
use puck::safety::Health;

pub use data::FaultReport;

use super::{ErrorCode, Failure, Global, connection, files};

/// Options of `faults`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// Where the last second before the fault goes, a recording for `plot` and `report`
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,
}

const DOING: &str = "faults";
/// The memory of a fault outlives a reset, not a loss of power (decision 0095), and a device in this process got its
/// power with the command: a file of its flash keeps its library and settings only.
const SWITCHED_ON: &str = "this simulated arm was switched on with the command, and its memory of a fault with it; \
                           `tactus sim` serves one that stays";
/// Cycles in the table: 67 ms.
const SHOWN: usize = 20;
/// Quantities that the safety module judges, in the order of its word.
const SUPERVISED: [&str; 5] = ["velocity", "torque", "voltage", "heartbeat", "other"];

/// Tells the present fault and the last one.
///
/// # Errors
/// The device cannot be reached, or the file cannot be written.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    let output = global.output();
    let file = command.record.as_deref().map(|path| files::create(path, global, &[], DOING)).transpose()?;
    let mut client = connection::observe(global, DOING)?;
    // Reading it takes a second: what is told as present is what is latched behind that.
    let last = client.last_second().map_err(|error| error.into_failure(DOING))?;
    let status = client.status().map_err(|error| error.into_failure(DOING))?;
    if let Some(file) = file {
        let Some(LastSecond { cycles, .. }) = &last else {
            let failure = Failure::new(ErrorCode::NoFaultRecord, DOING, "there is nothing to write");
            return Err(if global.is_simulated_here() { failure.help(SWITCHED_ON) } else { failure });
        };
        let notes = format!("Tactus fault record, {} Hz\n{}", control::RATE_HZ, files::origin(&client, None));
        let text =
            recording_text(cycles, &notes).map_err(|error| Failure::of_file(ErrorCode::FileFailed, DOING, error))?;
        files::fill(file, &text, DOING)?;
        output.say(format!("wrote {} cycles", cycles.len()));
    }
    let mut words = text(&status, last.as_ref());
    if last.is_none() && global.is_simulated_here() {
        words += &format!("; {SWITCHED_ON}");
    }
    output.result(&FaultReport::of(&status, last.as_ref()), words)
}

fn text(status: &Status, last: Option<&LastSecond>) -> String {
    let present = fault_text(status.fault);
    let mut text = match &present {
        Some(fault) => format!("present fault: {fault}"),
        None => "present fault: none\n".to_owned(),
    };
    text += &pendant_text(status);
    let Some(last) = last else {
        return text + "last fault: none that the device remembers";
    };
    text += &match fault_text(last.record.fault) {
        Some(_) if last.record.fault == status.fault => "last second before it:\n".to_owned(),
        // A loss that goes on gets another name; its record ends with its first cycles.
        Some(_) if last.record.latched && present.is_some() => {
            format!("it began as {}; the last second before that:\n", fault_name(last.record.fault))
        }
        Some(fault) => format!("last fault, cleared: {fault}"),
        None => "last fault: none; the device restarted, and this is the second before\n".to_owned(),
    };
    let damaged = usize::from(last.record.cycles) - last.cycles.len();
    if damaged > 0 {
        text += &format!("{damaged} of {} cycles were lost in a restart\n", last.record.cycles);
    }
    text + &table(&last.cycles)
}

/// Name, meaning, reaction, cause, what to check, how to go on; `None` for no fault.
fn fault_text(code: u8) -> Option<String> {
    let fault = Fault::from_code(code)?;
    let FaultGuide { reaction, cause, check, clear } = FaultGuide::of(fault);
    let words = format!(
        "{fault:?}: {fault}\n  the arm: {reaction}\n  usual cause: {cause}\n  check: {check}\n  to go on: {clear}\n"
    );
    (fault != Fault::None).then_some(words)
}

fn fault_name(code: u8) -> String {
    Fault::from_code(code).map_or_else(|| code.to_string(), |fault| format!("{fault:?}"))
}

fn pendant(status: &Status) -> Option<PendantState> {
    PendantState::from_value(status.pendant?.cast_signed()).ok()
}

fn pendant_text(status: &Status) -> String {
    let Some(state) = pendant(status) else {
        return match status.pendant {
            Some(word) => format!("pendant: a word that no document explains ({word:#010x})\n"),
            None => "pendant: not read yet\n".to_owned(),
        };
    };
    let judged = SUPERVISED.iter().zip(state.health()).map(|(name, health)| format!("{name} {}", health_name(health)));
    let display = state.display().map_or("?".to_owned(), String::from);
    let light = |on| if on { "on" } else { "off" };
    let (idle, activate) = (light(state.idle_light), light(state.activate_light));
    let judged = judged.collect::<Vec<_>>().join(", ");
    format!("pendant: {judged}; display {display}; idle light {idle}, activate light {activate}\n")
}

const fn health_name(health: Health) -> &'static str {
    match health {
        Health::Safe => "ok",
        Health::Warning => "warning",
        Health::Fault => "fault",
    }
}

fn state(cycle: &Telemetry) -> &'static str {
    State::from_code(cycle.state).map_or("unknown", State::name)
}

/// The last cycles, the newest at the end.
fn table(cycles: &[Telemetry]) -> String {
    let Some(end) = cycles.last() else { return String::new() };
    let joints = (1..=7).map(|joint| format!("J{joint}"));
    let head = ["ms", "state", "phase"].map(str::to_owned).into_iter().chain(joints);
    let mut table = Table::new(head.chain(["rad/s", "N m", "N", "lost"].map(str::to_owned)));
    for cycle in &cycles[cycles.len().saturating_sub(SHOWN)..] {
        let before = f64::from(end.cycle.wrapping_sub(cycle.cycle)) * 1000.0 / f64::from(control::RATE_HZ);
        let [x, y, z, ..] = cycle.wrench;
        let mut row = vec![format!("{:.0}", -before), state(cycle).to_owned(), format!("{:.3}", cycle.phase)];
        row.extend(cycle.q.map(|angle| format!("{angle:.3}")));
        row.extend([largest(&cycle.dq), largest(&cycle.tau), format!("{:.1}", (x * x + y * y + z * z).sqrt())]);
        row.push(cycle.lost_replies.to_string());
        table.row(row);
    }
    let of = format!("joint angles in rad; the fastest joint, the largest torque, the force; {SHOWN} cycles at most\n");
    of + &table.to_string()
}

/// The value of the joint that has the largest, with its number. One that is not a number is the largest.
fn largest(values: &[f32; 7]) -> String {
    let size = |value: f32| if value.is_nan() { f32::INFINITY } else { value.abs() };
    let joint = (0..7).max_by(|a, b| size(values[*a]).total_cmp(&size(values[*b]))).unwrap_or(0);
    format!("J{} {:.2}", joint + 1, values[joint])
}

#[cfg(test)]
mod tests {
    use link::FaultRecord;

    use super::*;

    /// A loss that goes on has another name than its first cycles, with which the record ends.
    #[test]
    fn a_loss_that_goes_on_is_not_said_to_be_a_fault_that_was_cleared() {
        let told = |now: Fault, latched: bool| {
            let record = FaultRecord { number: 1, fault: Fault::RepliesLost.code(), latched, cycles: 0 };
            let last = LastSecond { record, cycles: Vec::new() };
            text(&Status { fault: now.code(), ..Status::default() }, Some(&last))
        };
        let on = told(Fault::RepliesLostForLong, true);
        assert!(on.contains("it began as RepliesLost;") && !on.contains("cleared"), "{on}");
        assert!(told(Fault::RepliesLost, true).contains("last second before it"));
        assert!(told(Fault::None, false).contains("last fault, cleared: RepliesLost:"));
    }
}
