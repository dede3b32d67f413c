//! `tactus completions`: what a shell needs to complete its command lines.

use clap::{Args, CommandFactory as _};
use clap_complete::Shell;
use schemars::JsonSchema;
use serde::Serialize;

use super::{Cli, Failure, Global};

/// Options of `completions`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// The shell
    #[arg(value_enum)]
    pub shell: Shell,
}

/// Data of `tactus --json completions`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Completing {
    /// The shell.
    pub shell: String,
    /// Text that this shell reads.
    pub script: String,
}

/// Writes the completions to standard output, for example to `~/.local/share/bash-completion/completions/tactus`.
///
/// # Errors
/// Standard output cannot take them.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    // Into memory first: the generator panics where it cannot write.
    let mut script = Vec::new();
    clap_complete::generate(command.shell, &mut Cli::command(), "tactus", &mut script);
    let script = String::from_utf8_lossy(&script).into_owned();
    global.output().result(&Completing { shell: command.shell.to_string(), script: script.clone() }, script)
}
