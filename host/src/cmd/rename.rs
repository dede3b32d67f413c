//! `tactus rename`: gives a primitive in the device another name.

use clap::Args;
use link::{Name, Refusal};
use schemars::JsonSchema;
use serde::Serialize;

use super::{ErrorCode, Failure, Global, connection, get};
use lab::error::HostError;

/// Options of `rename`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// Name of the primitive in the device, as `tactus list` shows it
    #[arg(value_name = "OLD")]
    pub old: Name,
    /// Its name from then on
    #[arg(value_name = "NEW", value_parser = new_name)]
    pub new: Name,
}

/// A name to give to a primitive. One that ends as a file of one does names nothing that `tactus run` could play from
/// the device: there it means the file.
///
/// # Errors
/// It is none, or has that ending.
pub(super) fn new_name(text: &str) -> Result<Name, String> {
    let name = Name::new(text).map_err(|error| error.to_string())?;
    match text.strip_suffix(".toml") {
        Some(stem) => Err(format!("`tactus run {text}` means a file; without the ending it is `{stem}`")),
        None => Ok(name),
    }
}

/// Renames a primitive.
///
/// # Errors
/// Both names are the same; the device stores none of the old name, or one of the new; a run uses it.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "rename";
    let (old, new) = (&command.old, &command.new);
    if old == new {
        let failure = Failure::new(ErrorCode::CommandLine, "rename refused", format!("'{old}' has that name already"));
        return Err(failure.help(format!("give another name: `tactus rename {old} NEW`")));
    }
    let mut client = connection::open(global, DOING, |_| {})?;
    let mut renamed = client.rename(old, new);
    if matches!(renamed, Err(HostError::Refused { reason: Refusal::NameTaken, .. })) {
        let what = format!("the device stores another primitive '{new}'");
        if !global.force && !super::ask(global, &format!("{what}; delete it?")) {
            return Err(Failure::new(ErrorCode::WouldReplace, "rename refused", what));
        }
        client.delete(new).map_err(|error| error.into_failure(DOING))?;
        renamed = client.rename(old, new);
    }
    renamed.map_err(|error| get::failure(&mut client, error, old, global, DOING))?;
    let data = Renamed { old: old.as_str().to_owned(), new: new.as_str().to_owned() };
    global.output().result(&data, format!("'{old}' is '{new}' now"))
}

/// Data of `tactus --json rename`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Renamed {
    /// Name before.
    pub old: String,
    /// Name now.
    pub new: String,
}
