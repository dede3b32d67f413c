//! Runs an image where it belongs: the `runner` of cargo for Cortex-M targets.
//!
//! The image says which board it is for. One for an emulated board starts in QEMU; one for a real board is written to
//! the chip by probe-rs, started, and its log shown until Ctrl-C.

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result};
use link::ImageMetadata;

use crate::elf::Sizes;
use crate::{qemu, shell};

/// Runs `IMAGE [arguments for the program that runs it]`.
pub(crate) fn run(image: &str, rest: &[&str]) -> Result<()> {
    let sizes = Sizes::of(Path::new(image))?;
    let description = sizes.description().context("the image does not say which board it is for")?;
    let metadata = ImageMetadata::decode(description)?;
    if metadata.simulated {
        return qemu::run(&[&[image][..], rest].concat());
    }
    let chip = link::metadata::chip(metadata.board)
        .with_context(|| format!("no chip is known on board '{}'", metadata.board))?;
    shell::note(&format!("{} for {} (chip {chip})", metadata.firmware, metadata.board));
    let mut probe = Command::new("probe-rs");
    shell::run(probe.args(["run", "--chip", chip]).args(rest).arg(image))
        .context("probe-rs writes images to real boards; if it is missing: cargo install probe-rs-tools --locked")
}
