//! `tactus logs`: shows what a device logs.

use std::fs::File;
use std::path::PathBuf;

use clap::Args;

use super::flash::{image_failure, open_image, probe_failure};
use super::{ErrorCode, Failure, Global};
use crate::probe::Line;
use lab::image_file::ImageFile;
use lab::simulation::{IMAGE_VARIABLE, built_image};

/// File that `cargo xtask build` leaves for the emulator.
const EMULATED_IMAGE: &str = "arm.elf";

/// Options of `logs`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// The image the device runs: the log holds only numbers of its texts [default: the image built last]
    #[arg(long, value_name = "ELF")]
    pub image: Option<PathBuf>,
    /// Which debug probe, if there are several, as `VID:PID` or `VID:PID:SERIAL`
    #[arg(long, value_name = "PROBE", conflicts_with = "file")]
    pub probe: Option<String>,
    /// Show a log that was kept in a file, as the emulator writes it
    #[arg(long, value_name = "FILE")]
    pub file: Option<PathBuf>,
    /// Attach to a running board: that halts it for a moment, and its watchdog may restart it, so the arm must have
    /// no torque
    #[arg(long, conflicts_with = "file")]
    pub attach_may_reset: bool,
    /// Say what would be run
    #[arg(long)]
    pub dry_run: bool,
}

/// Shows the log until Ctrl-C, or that of a file to its end.
///
/// Reading the log does not disturb the device, but attaching to it does: probe-rs halts the core while it clears the
/// breakpoints of an earlier session, and the watchdog goes on meanwhile. So it has to be asked for by name.
///
/// # Errors
/// It was not asked for, there is no image, or the program that reads the log is missing or fails.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "logs";
    let (line, input) = match &command.file {
        Some(path) => {
            let input = File::open(path).map_err(|error| {
                Failure::new(ErrorCode::LogFileUnreadable, DOING, format!("cannot read {}: {error}", path.display()))
            })?;
            (Line::print(&emulated_image(command, DOING)?.path), Some(input))
        }
        None => {
            let image = open_image(command.image.as_ref(), DOING)?;
            let chip = image.chip().map_err(|error| image_failure(error, DOING))?;
            (Line::attach(chip, command.probe.as_deref(), &image.path), None)
        }
    };
    global.output().say(line.to_string());
    if command.dry_run {
        return Ok(());
    }
    if command.file.is_none() && !command.attach_may_reset {
        let text = "attaching the debug probe halts the board for a moment, and its watchdog may restart it";
        return Err(Failure::new(ErrorCode::AttachMayReset, DOING, text.to_owned()));
    }
    line.run(input).map_err(|error| probe_failure(error, DOING))
}

/// The image whose log is in a file: the one named, or the emulator's.
fn emulated_image(command: &Cmd, doing: &str) -> Result<ImageFile, Failure> {
    let named = command.image.clone().or_else(|| std::env::var_os(IMAGE_VARIABLE).map(PathBuf::from));
    let path = named.or_else(|| built_image(EMULATED_IMAGE)).ok_or_else(|| {
        Failure::new(ErrorCode::ImageMissing, doing, format!("no image {EMULATED_IMAGE} was built"))
            .help("build it with `cargo xtask build`, or name one with `--image`")
    })?;
    ImageFile::read(&path).map_err(|error| image_failure(error, doing))
}
