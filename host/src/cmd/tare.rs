//! `tactus tare`: the present readings of force sensor and strain gauges become zero.

use clap::Args;
use lab::procedure::{self, Reading, Tared};
use link::HandStage;

use super::{Failure, Global, Table, connection};

/// Options of `tare`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// Make a zero of a load too, up to 20 N; without it more than 1 N at rest is refused
    #[arg(long)]
    pub loaded: bool,
    /// I have brought the arm to its home pose: zero it there if need be
    #[arg(long)]
    pub at_home: bool,
}

const DOING: &str = "tare";

/// Takes the zero and tells the readings before and after, of the sensors that the device has. The arm stands; nothing
/// is moved and nothing is stored: the next start-up takes a zero of its own.
///
/// # Errors
/// The device cannot be reached, has no sensor or plays a primitive; the arm moves, or something loads its hand.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    let mut client = connection::open(global, DOING, |_| {})?;
    let is_arm = client.hello().capabilities.arm;
    if !is_arm && global.is_simulated_here() {
        // Nobody could initialise the hand of this device: it has just been switched on, and ends with the command.
        connection::ready(&mut client, command.at_home, global.output(), DOING)?;
    } else {
        connection::joints_read(&mut client, command.at_home, global.output(), DOING)?;
    }
    let mut is_taken = false;
    let tared = procedure::tare(&mut client, command.loaded, || is_taken = true);
    if is_taken && tared.is_err() {
        global.output().say("the zero is taken; only the readings with it could not be shown");
    }
    let tared = tared.map_err(|error| connection::failed(&mut client, error, DOING))?;
    // The zero is taken: what is only told beside it fails nothing.
    if tared.after.gauges_nm.is_none()
        && let Ok(hand) = client.status().map(|status| status.hand_stage)
        && hand != HandStage::Absent
    {
        global
            .output()
            .say(format!("the hand is {}: its gauges have got no zero; first: tactus hand init", hand.name()));
    }
    if global.is_simulated_here() {
        let device = if is_arm { "arm" } else { "hand" };
        global.output().say(format!(
            "this simulated {device} ends with the command, and its zero with it; `tactus sim` serves one that stays"
        ));
    }
    global.output().result(&tared, table(&tared).to_string())
}

fn table(tared: &Tared) -> Table {
    let mut table = Table::new(["zero of", "before", "now", "unit"]);
    let values = |reading: &Reading| [reading.force_n, reading.torque_nm, reading.gauges_nm];
    let (before, now) = (tared.before.as_ref().map(values), values(&tared.after));
    let channels =
        [("force", "N", ["x", "y", "z"]), ("torque", "N m", ["x", "y", "z"]), ("gauge", "N m", ["F1", "F2", "F3"])];
    // Noise around zero has no sign that anybody should look at.
    let number = |value: f64| format!("{:.3}", (value * 1e3).round() / 1e3 + 0.0);
    for (kind, (name, unit, parts)) in channels.into_iter().enumerate() {
        // A sensor that is not there has no row.
        let Some(now) = now[kind] else { continue };
        let before = before.and_then(|before| before[kind]);
        for (part, of) in parts.into_iter().enumerate() {
            let before = before.map_or_else(|| "-".to_owned(), |before| number(before[part]));
            table.row([format!("{name} {of}"), before, number(now[part]), unit.to_owned()]);
        }
    }
    table
}
