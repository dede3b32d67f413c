//! Set-up of a machine that has cargo, python3 and apt: installs what is missing, says so, asks nothing.
//!
//! Every part is idempotent and costs milliseconds when there is nothing to do. Where a part cannot be installed
//! (no root, no apt, no network), the error names the exact command or program and the program stops.

mod apt;
mod emulator;
mod mujoco;
mod pictures;
mod python;
mod qemu;
mod toolchain;

use anyhow::Result;

pub(crate) use emulator::{emulator_cargo, emulator_compiler, emulator_lints, emulator_target};
pub(crate) use qemu::Qemu;
pub(crate) use toolchain::{ARM, HAND, Toolchain};

use crate::shell;

/// Tools of a prepared machine.
pub(crate) struct Machine {
    /// The emulator the images run on.
    pub(crate) qemu: Qemu,
    /// Way of compiling Cortex-M code.
    pub(crate) toolchain: Toolchain,
}

/// Makes sure that everything needed to build, run and test is there.
pub(crate) fn all() -> Result<Machine> {
    shell::step("set-up: what is missing is installed");
    let qemu = qemu::ensure()?;
    let toolchain = toolchain::ensure()?;
    mujoco::ensure()?;
    pictures::ensure()?;
    python::ensure()?;
    Ok(Machine { qemu, toolchain })
}

/// Makes sure that the compiler for Cortex-M is there: all that building an image needs.
pub(crate) fn compiler() -> Result<Toolchain> {
    shell::step("set-up: what is missing is installed");
    toolchain::ensure()
}

/// Makes sure that `cargo fmt` and `cargo clippy` exist: minimal Rust installations lack them.
pub(crate) fn lints() -> Result<()> {
    toolchain::ensure_lints()
}
