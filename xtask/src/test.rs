//! Every test: unit and property tests, golden vectors, the MuJoCo world, whole systems under QEMU and on the emulated
//! board.

use anyhow::Result;

use crate::setup::Machine;
use crate::{build, emulated, hand, shell};

/// Builds what the tests need and runs all of them.
pub(crate) fn run(machine: &Machine) -> Result<()> {
    build::image(machine)?;
    hand::image(machine)?;
    emulated::build(machine.toolchain)?;
    build::host()?;
    shell::step("tests of all packages, whole-system tests included");
    shell::run(&mut build::with_the_world("test"))?;
    firmware()?;
    emulated::test()
}

/// Programs of tests that need the MuJoCo world, with their folders.
pub(crate) const WITH_THE_WORLD: [(&str, &str); 3] =
    [("experiment", "crates/experiment/tests/"), ("simulator", "crates/sim/tests/"), ("system", "tests/tests/")];

/// The tests that `cargo test` at the root, which has no world, cannot have run.
pub(crate) fn with_the_world() -> Result<()> {
    shell::step("tests with the MuJoCo world, whole-system tests included");
    let mut cargo = build::with_the_world("test");
    // By name, because another selection of packages would build half of the house once more.
    cargo.arg("--lib").args(WITH_THE_WORLD.iter().flat_map(|(name, _)| ["--test", name]));
    shell::run(&mut cargo)
}

/// The tests of the firmware that run on this machine.
pub(crate) fn firmware() -> Result<()> {
    // The image's own tests run on the host, without a board: its application on an in-memory board, its numbers.
    shell::step("tests of the firmware on this machine");
    // Selected with all the others, by name: by itself it would build them once more.
    let mut firmware = shell::cargo();
    firmware.args(["test", "--workspace", "--features", build::WORLD]);
    shell::run(firmware.args(["--test", "lines", "--test", "stm32h743_numbers", "--test", "memory_board"]))
}
