//! `tactus upload`: puts a primitive into the device, checked on both sides and read back.

use std::path::{Path, PathBuf};

use clap::Args;
use link::image::stored_crc;
use link::{Listing, Name};
use schemars::JsonSchema;
use serde::Serialize;

use super::{ErrorCode, Failure, Global, Output, connection};
use crate::check::{self, CheckReport, Course};
use lab::client::{Client, UploadOutcome, UploadPhase};
use lab::device::Device;
use lab::primitive_file::PrimitiveFile;

/// Options of `upload`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// The primitive, TOML
    #[arg(value_name = "PRIMITIVE")]
    pub primitive: PathBuf,
}

/// Uploads a primitive.
///
/// # Errors
/// The file is wrong, the device refuses it or cannot be reached.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "upload";
    let output = global.output();
    let file = read(&command.primitive, DOING)?;
    let mut client = connection::open(global, DOING, |_| {})?;
    may_replace(&mut client, &file, global)?;
    let outcome = send(&mut client, &file, output, DOING)?;
    if let (UploadOutcome::Stored(_), Some(line)) = (&outcome, client.transport().line_rate()) {
        let rate = client.transfer().sending_rate();
        let (rate_kb, line_kb, share) = (rate / 1000.0, line / 1000.0, 100.0 * rate / line);
        output.say(format!(
            "sent at {rate_kb:.1} kB/s: {share:.0} % of the {line_kb:.1} kB/s that full CAN frames carry"
        ));
    }
    let (sent, listing) = match outcome {
        UploadOutcome::Stored(listing) => (true, listing),
        UploadOutcome::AlreadyThere(listing) => (false, listing),
    };
    if global.forgets() {
        output.say("this simulated device ends with the command; one that stays: `tactus sim`");
    }
    let data = Uploaded {
        name: listing.name.as_str().to_owned(),
        sent,
        bytes: listing.length,
        crc: format!("0x{:08x}", listing.crc),
        place: listing.index,
        kernels: listing.kernels,
        duration_s: listing.duration,
    };
    let word = if sent { "stored" } else { "already there, nothing sent" };
    output.result(
        &data,
        format!("{}: {word} ({} bytes, CRC 0x{:08x})", listing.name.as_str(), listing.length, listing.crc),
    )
}

/// Data of `tactus --json upload`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Uploaded {
    /// Name of the primitive.
    pub name: String,
    /// It was sent; otherwise the device had it already.
    pub sent: bool,
    /// Size of its image.
    pub bytes: u32,
    /// Check sum of its image, hexadecimal.
    pub crc: String,
    /// Place in the device, from 0.
    pub place: u8,
    /// Kernels of each row.
    pub kernels: u16,
    /// Duration of the movement, s.
    pub duration_s: f32,
}

/// Makes sure that a person wants another version of the same name replaced.
fn may_replace(client: &mut Client<Device>, file: &PrimitiveFile, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "upload";
    let Some(there) = other_version(client, file, DOING)?.filter(|_| !global.force) else { return Ok(()) };
    let checksum = there.crc;
    let what = format!("the device stores another version of '{}' (checksum 0x{checksum:08x})", file.name);
    if super::ask(global, &format!("{what}; replace it?")) {
        return Ok(());
    }
    Err(Failure::new(ErrorCode::WouldReplace, "upload refused", what)
        .help("keep that one first: `tactus rename` or `tactus get`; or replace it with `--force`"))
}

/// The listing of another version of the primitive in the device.
pub(super) fn other_version(
    client: &mut Client<Device>,
    file: &PrimitiveFile,
    doing: &str,
) -> Result<Option<Listing>, Failure> {
    let image = file.to_image().map_err(|cause| super::check::failure(cause, &file.file, doing))?;
    let name = Name::new(&file.name).map_err(|cause| Failure::new(ErrorCode::NameInvalid, doing, cause))?;
    let there = client.find(&name).map_err(|error| error.into_failure(doing))?;
    Ok(there.filter(|there| there.crc != stored_crc(&image)))
}

/// Says that another version goes.
pub(super) fn say_replaced(old: &Listing, output: Output) {
    output.say(format!(
        "replaces another version of '{}' in the device (checksum 0x{:08x})",
        old.name.as_str(),
        old.crc
    ));
}

/// Reads a primitive that fits this arm.
pub(super) fn read(path: &Path, doing: &str) -> Result<PrimitiveFile, Failure> {
    read_with_text(path, doing).map(|(file, _)| file)
}

/// The same, with the text of the file.
pub(super) fn read_with_text(path: &Path, doing: &str) -> Result<(PrimitiveFile, String), Failure> {
    let refused = |cause| super::check::failure(cause, path, doing);
    let (file, text) = PrimitiveFile::read_with_text(path).map_err(refused)?;
    file.require_model(control::MODEL_HASH).map_err(refused)?;
    Ok((file, text))
}

/// Plays the primitive on the host first, and refuses what would break a limit of the arm.
pub(super) fn precheck(
    file: &PrimitiveFile,
    course: &Course,
    output: Output,
    doing: &str,
) -> Result<CheckReport, Failure> {
    let bar = output.bar(100, "%", "checking");
    let report = check::check(file, course, |fraction| bar.set_position((fraction * 100.0) as u64))
        .map_err(|cause| super::check::failure(cause, &file.file, doing))?;
    bar.finish_and_clear();
    match report.violations.first() {
        None => {
            report.warnings.iter().for_each(|warning| output.warn(warning));
            Ok(report)
        }
        Some(first) => {
            Err(Failure::new(ErrorCode::CheckFailed, format!("{doing} refused: the check failed"), first.to_string())
                .help(course.help(&file.file, &report)))
        }
    }
}

/// Sends the primitive with a progress bar.
pub(super) fn send(
    client: &mut Client<Device>,
    file: &PrimitiveFile,
    output: Output,
    doing: &str,
) -> Result<UploadOutcome, Failure> {
    let image = file.to_image().map_err(|cause| super::check::failure(cause, &file.file, doing))?;
    let bar = output.bar(image.len() as u64, "bytes", "sending");
    let outcome = client.upload(&image, |phase, done, all| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
        bar.set_message(match phase {
            UploadPhase::Send => "sending",
            UploadPhase::Commit => "storing",
            UploadPhase::Verify => "reading back",
        });
    });
    bar.finish_and_clear();
    outcome.map_err(|error| error.into_failure(doing))
}
