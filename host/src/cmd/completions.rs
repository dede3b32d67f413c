//! `tactus completions`: what a shell needs to complete its command lines.

use clap::{Args, CommandFactory as _};
use clap_complete::Shell;

use super::{Cli, ErrorCode, Failure};

/// Options of `completions`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// The shell
    #[arg(value_enum)]
    pub shell: Shell,
}

/// Writes the completions to standard output, for example to `~/.local/share/bash-completion/completions/tactus`.
///
/// # Errors
/// Standard output was closed.
pub fn run(command: &Cmd) -> Result<(), Failure> {
    use std::io::Write as _;
    // Into memory first: the generator panics where it cannot write.
    let mut text = Vec::new();
    clap_complete::generate(command.shell, &mut Cli::command(), "tactus", &mut text);
    let mut stdout = std::io::stdout().lock();
    let written = stdout.write_all(&text).and_then(|()| stdout.flush());
    written.map_err(|cause| Failure::of_file(ErrorCode::ResultNotWritten, "completions", cause))
}
