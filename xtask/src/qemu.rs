//! Runs an image by itself under QEMU: the `runner` of cargo for Cortex-M targets, and `cargo xtask qemu`.
//!
//! The image talks to the simulated bus on its standard input and output, so by itself it soon ends with a failure:
//! useful to look at a debugger or at QEMU's messages. With bus and world: `tactus --device sim:`.

use std::path::PathBuf;
use std::process::Command;

use anyhow::Result;

use crate::{build, setup, shell};

/// The machine and its time base: 125 million instructions per virtual second, repeatable to the tick.
const MACHINE: &[&str] = &[
    "-machine",
    "mps2-an500",
    "-nodefaults",
    "-nic",
    "none",
    "-display",
    "none",
    "-serial",
    "none",
    "-monitor",
    "none",
    "-semihosting-config",
    "enable=on,target=native",
    "-icount",
    "shift=3,sleep=off",
    "-kernel",
];

/// Runs `[IMAGE] [more QEMU arguments]`; without an image, builds the arm image first.
pub(crate) fn run(rest: &[&str]) -> Result<()> {
    let (image, more) = match rest {
        [image, more @ ..] => (PathBuf::from(image), more),
        [] => (build::image(&setup::all()?)?, &[][..]),
    };
    shell::run(Command::new("qemu-system-arm").args(MACHINE).arg(image).args(more))
}
