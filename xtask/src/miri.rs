//! Crates of the device under Miri, which checks step by step what they and the crates below them do.

use std::process::{Command, Stdio};

use anyhow::{Result, bail};

use crate::shell;

/// Packages whose unit tests end within minutes under an interpreter. Those of `dmp` count in millions; those of
/// `control` need a square root in machine code, which Miri does not read.
const PACKAGES: [&str; 3] = ["barrett-can", "link", "device"];

/// Runs them.
///
/// # Errors
/// If Miri is missing, or finds undefined behaviour, or a test fails.
pub(crate) fn run() -> Result<()> {
    let known = miri(&["--version"]).stdout(Stdio::null()).stderr(Stdio::null()).status();
    if !known.is_ok_and(|status| status.success()) {
        bail!("Miri is missing: rustup toolchain install nightly --component miri,rust-src");
    }
    for package in PACKAGES {
        shell::step(&format!("unit tests of {package} under Miri"));
        let mut command = miri(&["test", "--quiet", "--lib", "--package", package]);
        // Property tests look at the clock and for the cases that failed before.
        shell::run(command.env("MIRIFLAGS", "-Zmiri-disable-isolation"))?;
    }
    Ok(())
}

/// Miri of the nightly toolchain; this one's `cargo` takes no other toolchain's name.
fn miri(arguments: &[&str]) -> Command {
    let mut command = Command::new("rustup");
    command.args(["run", "nightly", "cargo", "miri"]).args(arguments).current_dir(shell::root());
    command
}
