//! `tactus delete`: frees a place in the device.

use clap::Args;
use link::Name;
use schemars::JsonSchema;
use serde::Serialize;

use super::{Failure, Global, connection, get};

/// Options of `delete`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// Name of the primitive in the device, as `tactus list` shows it
    #[arg(value_name = "NAME")]
    pub name: Name,
}

/// Deletes a primitive.
///
/// # Errors
/// The device stores none of that name, or a run uses it.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "delete";
    let mut client = connection::open(global, DOING, |_| {})?;
    let deleted = client.delete(&command.name);
    deleted.map_err(|error| get::failure(&mut client, error, &command.name, global, DOING))?;
    let name = command.name.as_str();
    global.output().result(&Deleted { deleted: name.to_owned() }, format!("deleted '{name}'"))
}

/// Data of `tactus --json delete`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Deleted {
    /// Name of the primitive.
    pub deleted: String,
}
