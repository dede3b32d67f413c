//! `tactus flash`: writes the firmware image to a board.

use std::path::PathBuf;

use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;

use super::{ErrorCode, Failure, Global, Table, connection, files};
use crate::probe::{Line, ProbeError};
use lab::image_file::{ImageFile, ImageFileError};
use lab::simulation::built_image;

/// File that `cargo xtask build --board stm32h743` leaves.
const IMAGE: &str = "arm-stm32h743.elf";

/// Options of `flash`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// The image [default: what `cargo xtask build --board stm32h743` built]
    #[arg(long, value_name = "ELF")]
    pub image: Option<PathBuf>,
    /// Which debug probe, if there are several, as `VID:PID` or `VID:PID:SERIAL`
    #[arg(long, value_name = "PROBE")]
    pub probe: Option<String>,
    /// Check the image and say what would be run
    #[arg(long)]
    pub dry_run: bool,
}

/// Checks the image, writes it, reads it back and starts it. Stored primitives stay. With `--device` the running
/// device is then asked whether it is that image.
///
/// # Errors
/// The image is not for a real board, probe-rs is missing or fails, or another image answers.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "flash";
    let output = global.output();
    let image = open_image(command.image.as_ref(), DOING)?;
    let chip = image.chip().map_err(|error| image_failure(error, DOING))?;
    let probe = command.probe.as_deref();
    let lines = [Line::download(chip, probe, &image.path), Line::reset(chip, probe)];
    if image.description.link_version != link::LINK_VERSION || image.description.schema_hash != link::SCHEMA_HASH {
        output.warn("this image speaks another version of the link than this tool: build both from the same sources");
    }
    for line in &lines {
        output.say(line.to_string());
        if !command.dry_run {
            line.run(None).map_err(|error| probe_failure(error, DOING))?;
        }
    }
    let mut answers = None;
    if !command.dry_run && global.device.is_some() {
        answers = Some(confirm(&image, global, DOING)?);
    }
    let text = describe(&image, chip);
    let ending = match (command.dry_run, answers) {
        (true, _) => "nothing was written",
        (false, None) => "written and verified; stored primitives were left alone",
        (false, Some(())) => "written and verified; the device runs it; stored primitives were left alone",
    };
    let commands: Vec<String> = lines.iter().map(Line::to_string).collect();
    let description = &image.description;
    let data = Flashed {
        image: files::text(&image.path),
        firmware: description.firmware.clone(),
        board: description.board.clone(),
        chip: chip.to_owned(),
        bytes: image.bytes(),
        link_version: description.link_version,
        schema_hash: format!("0x{:08x}", description.schema_hash),
        model_hash: format!("0x{:08x}", description.model_hash),
        commands,
        written: !command.dry_run,
        confirmed: answers.is_some(),
    };
    output.result(&data, format!("{text}{ending}"))
}

/// Data of `tactus --json flash`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Flashed {
    /// The file.
    pub image: String,
    /// Version of the firmware in it.
    pub firmware: String,
    /// The board that it is for.
    pub board: String,
    /// The chip, as probe-rs calls it.
    pub chip: String,
    /// Size of the image.
    pub bytes: u64,
    /// Version of the link that it speaks.
    pub link_version: u16,
    /// Check sum of the messages.
    pub schema_hash: String,
    /// Check sum of the robot's model.
    pub model_hash: String,
    /// The command lines of the debug probe.
    pub commands: Vec<String>,
    /// They were run: the image is written and verified.
    pub written: bool,
    /// The running device says that it is this image; only with `--device`.
    pub confirmed: bool,
}

/// The image a command is about: the one named, or the one built last.
pub(super) fn open_image(named: Option<&PathBuf>, doing: &str) -> Result<ImageFile, Failure> {
    let path = match named {
        Some(path) => path.clone(),
        None => built_image(IMAGE)
            .ok_or_else(|| Failure::new(ErrorCode::ImageMissing, doing, format!("no image {IMAGE} was built")))?,
    };
    ImageFile::read(&path).map_err(|error| image_failure(error, doing))
}

/// The image's description of itself, for people.
fn describe(image: &ImageFile, chip: &str) -> Table {
    let description = &image.description;
    let mut table = Table::new(["image", ""]);
    let region = |start: u32, length: u32| format!("{start:#010x}, {length} B");
    table.row(["file".to_owned(), image.path.display().to_string()]);
    table.row(["firmware".to_owned(), description.firmware.clone()]);
    table.row(["board".to_owned(), format!("{} (chip {chip})", description.board)]);
    table.row(["link version".to_owned(), description.link_version.to_string()]);
    table.row(["schema".to_owned(), format!("0x{:08x}", description.schema_hash)]);
    table.row(["robot model".to_owned(), format!("0x{:08x}", description.model_hash)]);
    table.row(["size".to_owned(), format!("{} B", image.bytes())]);
    table.row(["flash of images".to_owned(), region(description.image.start, description.image.length)]);
    if let Some(store) = description.store {
        table.row(["flash of primitives".to_owned(), format!("{} (kept)", region(store.start, store.length))]);
    }
    table
}

/// Asks the running device whether it is this image.
fn confirm(image: &ImageFile, global: &Global, doing: &str) -> Result<(), Failure> {
    let client = connection::open(global, doing, |_| {})?;
    let hello = client.hello();
    let expected = &image.description;
    let found = [hello.firmware.as_str(), hello.board.as_str()];
    let same = found == [expected.firmware.as_str(), expected.board.as_str()]
        && hello.link_version == expected.link_version
        && hello.schema_hash == expected.schema_hash
        && hello.model_hash == expected.model_hash;
    if same {
        return Ok(());
    }
    let text = format!("the device runs {} on {}, not {} on {}", found[0], found[1], expected.firmware, expected.board);
    Err(Failure::new(ErrorCode::OtherImageRuns, doing, text))
}

/// An image that cannot be used, as a failure.
pub(super) fn image_failure(error: ImageFileError, doing: &str) -> Failure {
    let code = match &error {
        ImageFileError::Unreadable { .. } => return Failure::of_file(ErrorCode::ImageUnreadable, doing, error),
        ImageFileError::UnknownBoard { .. } => {
            return Failure::new(ErrorCode::ImageOfNoBoard, doing, error)
                .help("use a `tactus` built from the same sources as the image");
        }
        ImageFileError::Emulated { .. } => ErrorCode::ImageOfNoBoard,
        ImageFileError::Outside { .. } | ImageFileError::OverStore { .. } => ErrorCode::ImageOutOfPlace,
        _ => ErrorCode::ImageUnreadable,
    };
    Failure::new(code, doing, error)
}

/// A debug probe that did not do it, as a failure.
pub(super) fn probe_failure(error: ProbeError, doing: &str) -> Failure {
    let code = match &error {
        ProbeError::Missing { program: "defmt-print" } => ErrorCode::DefmtPrintMissing,
        ProbeError::Missing { .. } => ErrorCode::ProbeRsMissing,
        ProbeError::NotStarted { .. } | ProbeError::Failed { .. } => ErrorCode::ProbeFailed,
    };
    Failure::new(code, doing, error)
}
