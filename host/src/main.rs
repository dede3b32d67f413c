//! The `tactus` command.

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    tactus::cmd::run(tactus::cmd::Cli::parse())
}
