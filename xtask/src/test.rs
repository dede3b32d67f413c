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
    // Optimised: physics and the emulator's peer are several times faster, and the demo needs the same build.
    shell::run(&mut build::optimised("test"))?;
    // The image's own tests run on the host, without a board: its application on an in-memory board, its numbers.
    shell::step("tests of the firmware on this machine");
    // Selected with all the others, by name: by itself it would build them once more.
    let mut firmware = shell::cargo();
    firmware.args(["test", "--release", "--workspace", "--features", build::WORLD]);
    shell::run(firmware.args(["--test", "lines", "--test", "stm32h743_numbers"]))?;
    emulated::test()
}
