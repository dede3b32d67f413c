//! `tactus can`: the arm's bus as a log or live, and logs played to the device's application.

pub mod decode;
mod replay;
mod source;

use clap::{Args, Subcommand};

use super::{ErrorCode, Failure, Global, Output, connection};

/// Options of `can`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// Action
    #[command(subcommand)]
    pub action: Action,
}

/// Actions on a bus.
#[derive(Debug, Clone, Subcommand)]
pub enum Action {
    /// Say what every frame means, and sum up the bus
    Decode(decode::Cmd),
    /// Replay a log to the control code and compare the frames it sends
    Replay(replay::Cmd),
}

/// Does it.
///
/// # Errors
/// The log or the interface cannot be read, or shows what it should not.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    match &command.action {
        Action::Decode(command) => decode::run(command, global),
        Action::Replay(command) => replay::run(command, global),
    }
}
