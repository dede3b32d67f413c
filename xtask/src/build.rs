//! Builds the host tools and the image for the board.

use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result};

use crate::setup::{ARM, Machine};
use crate::shell;

/// Features of the host packages with the MuJoCo world and its pictures.
pub(crate) const WORLD: &str = "tactus/mujoco,sim/mujoco,sim/render,system-tests/mujoco";

/// Builds the `tactus` command with the MuJoCo world, optimised; returns its path.
pub(crate) fn host() -> Result<PathBuf> {
    shell::step("building the tactus command");
    shell::run(shell::cargo().args(["build", "--release", "--package", "tactus", "--features", "tactus/mujoco"]))?;
    Ok(shell::target_dir().join("release").join("tactus"))
}

/// Builds the arm image for the emulated board; returns the path under which the host tools look for it.
pub(crate) fn image(machine: &Machine) -> Result<PathBuf> {
    shell::step("building the arm image for QEMU's mps2-an500");
    let mut cargo = machine.toolchain.cargo("build", ARM)?;
    cargo.args(["--package", "firmware", "--bin", "arm", "--profile", "firmware"]);
    if !machine.qemu.may_sleep() {
        cargo.arg("--no-default-features");
    }
    shell::run(&mut cargo)?;
    let built = machine.toolchain.output(ARM, "firmware").join("arm");
    // One place whatever the toolchain, beside the tools that load it.
    let folder = shell::target_dir().join("images");
    fs::create_dir_all(&folder)?;
    let image = folder.join("arm.elf");
    fs::copy(&built, &image).with_context(|| format!("cannot copy {}", built.display()))?;
    shell::note(&format!("image: {}", image.display()));
    Ok(image)
}

/// Builds the documentation of every crate of the workspace.
pub(crate) fn documentation() -> Result<()> {
    shell::step("building the documentation");
    shell::run(
        shell::cargo()
            .args(["doc", "--no-deps", "--workspace", "--exclude", "firmware"])
            .env("RUSTDOCFLAGS", "-D warnings"),
    )
}
