//! The compiler of the emulator of the board, which is newer than the product's. Nothing is skipped where it cannot be
//! had.

use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, Result};

use crate::shell;

/// The emulator's compiler; `emulator/Cargo.toml` says at least which it needs.
pub(crate) const EMULATOR_RUST: &str = "1.98.0";

/// Variables that the cargo that runs this program sets. Another cargo would take them for its own.
const INHERITED: [&str; 5] = ["CARGO", "RUSTC", "RUSTDOC", "RUSTUP_TOOLCHAIN", "RUSTC_WORKSPACE_WRAPPER"];

/// Build folder of the emulator: two compilers must not share one.
pub(crate) fn emulator_target() -> PathBuf {
    shell::target_dir().join("emulator")
}

/// `cargo <verb>` in the workspace of the emulator; more arguments may follow.
pub(crate) fn emulator_cargo(verb: &str) -> Command {
    let mut command = rustup();
    command.args(["run", EMULATOR_RUST, "cargo", verb]).current_dir(shell::root().join("emulator"));
    command.env("CARGO_TARGET_DIR", emulator_target());
    command
}

/// Makes sure that the compiler is there.
pub(crate) fn emulator_compiler() -> Result<()> {
    if has("rustc") && has("cargo") {
        return Ok(());
    }
    shell::note(&format!("installing Rust {EMULATOR_RUST} for the emulator of the board"));
    shell::run(rustup().args(["toolchain", "install", EMULATOR_RUST, "--profile", "minimal"])).with_context(|| {
        format!(
            "the emulator of the board needs Rust {EMULATOR_RUST} by rustup (https://rustup.rs); to repeat: \
             rustup toolchain install {EMULATOR_RUST} --profile minimal"
        )
    })
}

/// Makes sure that its `cargo fmt` and `cargo clippy` are there.
pub(crate) fn emulator_lints() -> Result<()> {
    emulator_compiler()?;
    if has("cargo-fmt") && has("cargo-clippy") {
        return Ok(());
    }
    shell::note(&format!("adding rustfmt and clippy to Rust {EMULATOR_RUST}"));
    shell::run(rustup().args(["component", "add", "rustfmt", "clippy", "--toolchain", EMULATOR_RUST]))
        .context("rustfmt or clippy of the emulator's compiler is missing and rustup cannot add it")
}

fn has(tool: &str) -> bool {
    shell::succeeds(rustup().args(["run", EMULATOR_RUST, tool, "--version"]))
}

fn rustup() -> Command {
    let mut command = Command::new("rustup");
    for name in INHERITED {
        command.env_remove(name);
    }
    command
}
