//! The flashed bytes, executed: builds the emulator of the board and the image, boots the image, plays the
//! demonstration's movement on it, and prints what came of it in one table. Anything but what is expected is a failure.

mod expected;
mod movement;
mod table;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::board::Board;
use crate::setup::{self, Toolchain};
use crate::{build, elf, shell};

use table::Table;

/// File name of the emulator beside the images, where `tactus` looks for it.
const FILE: &str = "emulated-board";

/// Builds the emulator and puts it beside the images; returns its path.
pub(crate) fn emulator() -> Result<PathBuf> {
    setup::emulator_compiler()?;
    shell::step("building the emulator of the board");
    shell::run(setup::emulator_cargo("build").args(["--release", "--locked"]))?;
    let built = setup::emulator_target().join("release").join(FILE);
    let folder = shell::target_dir().join("images");
    fs::create_dir_all(&folder)?;
    let emulator = folder.join(FILE);
    build::place(&built, &emulator)?;
    shell::note(&format!("emulator: {}", emulator.display()));
    Ok(emulator)
}

/// Builds emulator and image: what `--device board:` needs.
pub(crate) fn build(toolchain: Toolchain) -> Result<(PathBuf, PathBuf)> {
    Ok((emulator()?, build::real_board(toolchain, Board::Stm32h743)?))
}

/// Format and lints of the emulator's workspace.
pub(crate) fn lint() -> Result<()> {
    setup::emulator_lints()?;
    shell::step("format and lints of the emulator of the board");
    shell::run(setup::emulator_cargo("fmt").args(["--all", "--check"]))?;
    shell::run(
        setup::emulator_cargo("clippy").args(["--release", "--locked", "--all-targets"]).args(["--", "-D", "warnings"]),
    )
}

/// Tests of the emulator's workspace; some execute the image that is beside the tools.
pub(crate) fn test() -> Result<()> {
    setup::emulator_compiler()?;
    shell::step("tests of the emulator of the board");
    shell::run(setup::emulator_cargo("test").args(["--release", "--locked"]))
}

/// The verb: builds, boots, moves, tells. `image` takes the place of the one that would be built.
pub(crate) fn run(image: Option<&Path>) -> Result<()> {
    let machine = setup::all()?;
    let (emulator, image) = match image {
        Some(image) => (emulator()?, std::path::absolute(image)?),
        None => build(machine.toolchain)?,
    };
    let tactus = build::host()?;
    check(&emulator, &image, &tactus)
}

/// Boots and moves an image that is there.
pub(crate) fn check(emulator: &Path, image: &Path, tactus: &Path) -> Result<()> {
    let mut table = Table::default();
    let hash = elf::load_hash(image)?;
    table.told("load segments, SHA-256", hash.clone());
    shell::step("boot: the unmodified image on the emulated board");
    let (ended_well, report) = report(Command::new(emulator).args(["check", "--json", "--image"]).arg(image))?;
    expected::start(&mut table, &report, &hash);
    if ended_well && table.holds() {
        movement::play(&mut table, emulator, image, tactus)?;
    } else {
        shell::note("the image does not start as it should; the movement is not tried");
    }
    shell::step("what came of it");
    print!("{table}");
    table.verdict()?;
    ensure!(ended_well, "the emulator found the start of the image wrong; its reasons are above");
    Ok(())
}

/// Runs a command that writes one JSON object, with its messages on our terminal; tells whether it ended well.
fn report(command: &mut Command) -> Result<(bool, Value)> {
    let output = command
        .stdin(Stdio::null())
        .stderr(Stdio::inherit())
        .output()
        .with_context(|| format!("cannot start: {}", shell::line(command)))?;
    let text = String::from_utf8_lossy(&output.stdout);
    let value = serde_json::from_str(&text)
        .with_context(|| format!("{}, and no report; to repeat: {}", output.status, shell::line(command)))?;
    Ok((output.status.success(), value))
}
