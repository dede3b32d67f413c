//! `tactus get`: reads a primitive back from the device into a file.

use std::path::{Path, PathBuf};

use clap::Args;
use link::{Name, PrimitiveImage, Refusal};
use schemars::JsonSchema;
use serde::Serialize;

use super::{ErrorCode, Failure, Global, connection, files, storage};
use lab::client::Client;
use lab::device::Device;
use lab::error::HostError;
use lab::primitive_file::PrimitiveFile;
use lab::quoted;

/// Options of `get`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// Name of the primitive in the device, as `tactus list` shows it
    #[arg(value_name = "NAME")]
    pub name: Name,
    /// Where it goes, TOML; NAME.toml if it is not given
    #[arg(long, short, value_name = "FILE")]
    pub output: Option<PathBuf>,
}

/// Reads a primitive back. The file gives the same image when it is uploaded again.
///
/// # Errors
/// The device stores none of that name, or the file is there already or cannot be written.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "get";
    let path = command.output.clone().unwrap_or_else(|| PathBuf::from(format!("{}.toml", command.name)));
    let output_file = files::create(&path, global, &[], "get refused")?;
    let mut client = connection::open(global, DOING, |_| {})?;
    let file = fetch(&mut client, &command.name, global, DOING)?;
    if let Some(loss) = storage::loss_of(&mut client, &command.name).map_err(|error| error.into_failure(DOING))? {
        global.output().warn(format!("this is an image of before: {}", storage::missed(&loss)));
    }
    let text = file.checked_text().map_err(|cause| super::check::failure(cause, &path, DOING))?;
    files::fill(output_file, text.as_bytes(), DOING)?;
    let content = file.checksum();
    global.output().result(
        &Gotten { name: file.name, file: files::text(&path), content: format!("0x{content:08x}") },
        format!("wrote {} (content 0x{content:08x})", path.display()),
    )
}

/// Data of `tactus --json get`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Gotten {
    /// Name of the primitive.
    pub name: String,
    /// The file that was written.
    pub file: String,
    /// Check sum of its content, hexadecimal.
    pub content: String,
}

/// The failure of a request about a primitive in the device: one that is not there is named, with the place where it
/// may be, and one that the storage has lost is told to be lost.
pub(super) fn failure(
    client: &mut Client<Device>,
    error: HostError,
    name: &Name,
    global: &Global,
    doing: &str,
) -> Failure {
    if !matches!(error, HostError::Refused { reason: Refusal::NoSuchPrimitive, .. }) {
        return error.into_failure(doing);
    }
    let file = format!("{name}.toml");
    let is_file = Path::new(&file).is_file();
    let doing = format!("{doing} '{name}'");
    // What the device refused counts, also where it cannot tell of its storage.
    if let Some(loss) = storage::loss_of(client, name).unwrap_or_default() {
        let file = if is_file { quoted::text(&file) } else { "FILE".to_owned() };
        return Failure::new(error.code(), doing, format!("{error}; {}", storage::missed(&loss)))
            .help(format!("`tactus upload {file}` brings it back; `tactus list` tells all that is lost"));
    }
    let failure = error.into_failure(doing);
    if is_file {
        let file = quoted::text(&file);
        return failure.help(format!("there is a file {file}: `tactus run {file}`, or `tactus upload {file}`"));
    }
    if global.forgets() {
        return failure.help(
            "this simulated device begins empty with every command: `flash=FILE` in its address keeps what it stores, \
             `tactus sim` serves one that stays",
        );
    }
    failure
}

/// The primitive that the device stores under a name, to be played: a person who names it means what was stored last.
///
/// # Errors
/// As [`fetch`]; the storage has lost what was stored last, and kept an image of before.
pub(super) fn fetch_newest(
    client: &mut Client<Device>,
    name: &Name,
    global: &Global,
    doing: &str,
) -> Result<PrimitiveFile, Failure> {
    let file = fetch(client, name, global, doing)?;
    let Some(loss) = storage::loss_of(client, name).map_err(|error| error.into_failure(doing))? else {
        return Ok(file);
    };
    let cause = format!("'{name}' in the device is an image of before: {}", storage::missed(&loss));
    let help = format!(
        "`tactus upload FILE` brings the last one back; whoever wants the one of before: `tactus get {name}`, then \
         `tactus run {name}.toml`"
    );
    Err(Failure::new(ErrorCode::ImageOfBefore, format!("{doing} refused"), cause).help(help))
}

/// The primitive that the device stores under a name.
pub(super) fn fetch(
    client: &mut Client<Device>,
    name: &Name,
    global: &Global,
    doing: &str,
) -> Result<PrimitiveFile, Failure> {
    let image = client.read_image(name, |_| {}).map_err(|error| failure(client, error, name, global, doing))?;
    let image =
        PrimitiveImage::parse(&image).map_err(|cause| Failure::new(ErrorCode::ReadBackDiffers, doing, cause))?;
    let file = PrimitiveFile::from_image(Path::new(name.as_str()), &image);
    file.require_model(control::MODEL_HASH).map_err(|cause| super::check::failure(cause, &file.file, doing))?;
    Ok(file)
}
