//! `tactus stop`: brings the arm to rest, and clears a fault whose cause a person has removed.

use clap::Args;
use control::{Fault, State};
use schemars::JsonSchema;
use serde::Serialize;

use super::{Failure, Global, connection};
use lab::client::{Client, Halted};
use lab::device::Device;

/// Options of `stop`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// I have found the cause of the fault and removed it: clear it, so that the arm can be commanded again
    #[arg(long)]
    pub clear_fault: bool,
}

const DOING: &str = "stop";

/// Stops any motion softly (gravity compensation and damping), also that of another host, and says which fault is
/// latched.
///
/// # Errors
/// The device cannot be reached, the arm still moves after 200 ms, or the cause of the fault is still there.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    match connection::halt(global, DOING)? {
        Halted::Ours(client) => report(*client, command, global),
        // The stop is done, but clearing a fault is not for those who do not have the arm.
        Halted::Others(error) if command.clear_fault => {
            Err(error.into_failure("stop: stopped, but no fault was cleared"))
        }
        Halted::Others(_) => global.output().result(
            &Stopped { state: None, fault: None, cleared: false, others: true },
            "stopped; another host is connected and keeps the arm",
        ),
    }
}

fn report(mut client: Client<Device>, command: &Cmd, global: &Global) -> Result<(), Failure> {
    client.stop().map_err(|error| connection::refused(&mut client, error, DOING))?;
    let mut status = client.status().map_err(|error| error.into_failure(DOING))?;
    let latched = Fault::from_code(status.fault).filter(|fault| *fault != Fault::None);
    let cleared = command.clear_fault && latched.is_some();
    let fault = status.fault;
    if cleared {
        client.clear_fault().map_err(|error| connection::refused(&mut client, error, DOING))?;
        // A soft stop that is cleared floats. The device would stop that as soon as this host leaves, and count it as
        // one that fell silent.
        client.stop().map_err(|error| connection::refused(&mut client, error, DOING))?;
        status = client.status().map_err(|error| error.into_failure(DOING))?;
    }
    let state = State::from_code(status.state).map_or("unknown", State::name);
    let mut text = format!("stopped; state: {state}");
    if let Some(fault) = latched {
        text.push_str(&format!("\n{}: {fault}", if cleared { "cleared" } else { "fault" }));
        if !cleared {
            global.output().say("when its cause is removed: `tactus stop --clear-fault`");
        }
    }
    let data = Stopped { state: Some(state.to_owned()), fault: Some(fault), cleared, others: false };
    global.output().result(&data, text)
}

/// Data of `tactus --json stop`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Stopped {
    /// State of the supervisor afterwards; null where another host keeps the arm.
    pub state: Option<String>,
    /// Code of the fault that is or was latched, 0 for none; null where another host keeps the arm.
    pub fault: Option<u8>,
    /// True if a fault was cleared.
    pub cleared: bool,
    /// True if another host keeps the arm.
    pub others: bool,
}
