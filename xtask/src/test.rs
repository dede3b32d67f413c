//! Every test: unit and property tests, golden vectors, the MuJoCo world, whole systems under QEMU and on the emulated
//! board.

use anyhow::{Context, Result};
use serde_json::Value;

use crate::setup::Machine;
use crate::{build, emulated, hand, shell};

/// Builds what the tests need and runs all of them.
pub(crate) fn run(machine: &Machine) -> Result<()> {
    build::image(machine)?;
    hand::image(machine)?;
    emulated::build(machine.toolchain)?;
    build::host()?;
    shell::step("tests of all packages, whole-system tests included");
    // Optimised: physics and the emulator's peer are several times faster, and the demo needs the same build.
    shell::run(&mut build::optimised("test"))?;
    firmware()?;
    emulated::test()
}

/// The tests that `cargo test` at the root, which has no world, cannot have run: those of the packages that have one.
pub(crate) fn with_the_world() -> Result<()> {
    shell::step("tests with the MuJoCo world, whole-system tests included");
    let mut metadata = shell::cargo();
    metadata.args(["metadata", "--no-deps", "--format-version", "1"]);
    let metadata: Value = serde_json::from_str(&shell::capture(&mut metadata)?)?;
    let packages = metadata["packages"].as_array().context("cargo metadata lists no packages")?;
    let have_it = packages.iter().filter(|package| !package["features"]["mujoco"].is_null());
    let targets = have_it.flat_map(|package| package["targets"].as_array().into_iter().flatten());
    let tests = targets.filter(|target| target["kind"][0] == "test").filter_map(|target| target["name"].as_str());
    let mut cargo = build::optimised("test");
    // By name, because another selection of packages would build half of the house once more.
    cargo.arg("--lib").args(tests.flat_map(|name| ["--test", name]));
    shell::run(&mut cargo)
}

/// The tests of the firmware that run on this machine.
pub(crate) fn firmware() -> Result<()> {
    // The image's own tests run on the host, without a board: its application on an in-memory board, its numbers.
    shell::step("tests of the firmware on this machine");
    // Selected with all the others, by name: by itself it would build them once more.
    let mut firmware = shell::cargo();
    firmware.args(["test", "--release", "--workspace", "--features", build::WORLD]);
    shell::run(firmware.args(["--test", "lines", "--test", "stm32h743_numbers", "--test", "memory_board"]))
}
