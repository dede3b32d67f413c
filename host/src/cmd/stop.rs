//! `tactus stop`: brings the arm to rest, and clears a fault whose cause a person has removed.

use clap::Args;
use control::{Fault, State};
use serde_json::json;

use super::{Failure, Global, connection};

/// Options of `stop`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// I have found the cause of the fault and removed it: clear it, so that the arm can be commanded again
    #[arg(long)]
    pub clear_fault: bool,
}

/// Stops any motion softly (gravity compensation and damping), and says which fault is latched.
///
/// # Errors
/// The device cannot be reached, the arm still moves after 200 ms, or the cause of the fault is still there.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "stop";
    let mut client = connection::open(global, DOING, |_| {})?;
    client.stop().map_err(|error| error.into_failure(DOING))?;
    let status = client.status().map_err(|error| error.into_failure(DOING))?;
    let state = State::from_code(status.state).map_or("unknown", State::name);
    let latched = Fault::from_code(status.fault).filter(|fault| *fault != Fault::None);
    let cleared = command.clear_fault && latched.is_some();
    if cleared {
        client.clear_fault().map_err(|error| error.into_failure(DOING))?;
    }
    let mut text = format!("stopped; state: {state}");
    if let Some(fault) = latched {
        text.push_str(&format!("\n{}: {fault}", if cleared { "cleared" } else { "fault" }));
        if !cleared {
            global.output().say("when its cause is removed: `tactus stop --clear-fault`");
        }
    }
    global.output().result(&json!({ "state": state, "fault": status.fault, "cleared": cleared }), text)
}
