//! `tactus stop`: brings the arm to rest.

use clap::Args;
use serde_json::json;

use super::{Failure, Global, connection};

/// Options of `stop`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {}

/// Stops any motion softly: gravity compensation and damping.
///
/// # Errors
/// The device cannot be reached, or the arm still moves after 200 ms.
pub fn run(_command: &Cmd, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "stop";
    let mut client = connection::open(global, DOING, |_| {})?;
    client.stop().map_err(|error| error.into_failure(DOING))?;
    let status = client.status().map_err(|error| error.into_failure(DOING))?;
    let state = control::State::from_code(status.state).map_or("unknown", control::State::name);
    global.output().result(&json!({ "state": state }), format!("stopped; state: {state}"))
}
