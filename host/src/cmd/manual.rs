//! `tactus manual`: a page for `man` of each command.

use std::path::PathBuf;

use clap::{Args, Command, CommandFactory as _};
use clap_mangen::Man;
use schemars::JsonSchema;
use serde::Serialize;

use super::{Cli, ErrorCode, Failure, Global, files};
use lab::quoted;

/// Options of `manual`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// The folder of the pages, for example `~/.local/share/man/man1`; made if it does not exist
    #[arg(value_name = "FOLDER")]
    pub folder: PathBuf,
}

/// The pages that were written.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Written {
    /// Their files.
    pub pages: Vec<String>,
}

/// Writes a page of each command and of each command's commands.
///
/// # Errors
/// A page cannot be written, or is there already and `--force` is not given. Unless the disk fails while the pages are
/// put at their places, none is replaced then.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    let doing = "manual";
    files::create_folder(&command.folder, doing)?;
    let mut tool = Cli::command().disable_help_subcommand(true);
    tool.build();
    let mut pages = Vec::new();
    collect(&tool, "tactus", &mut pages).map_err(|cause| Failure::new(ErrorCode::ResultNotWritten, doing, cause))?;
    // All are opened before the first is put at its place.
    let mut opened = Vec::new();
    for (name, text) in pages {
        let path = command.folder.join(format!("{name}.1"));
        opened.push((files::create(&path, global, &[], doing)?, path, text));
    }
    let mut written = Written { pages: Vec::new() };
    for (file, path, text) in opened {
        files::fill(file, &text, doing)?;
        written.pages.push(files::text(&path));
    }
    let page = quoted::path(&command.folder.join("tactus-run.1"));
    let words = format!("{} pages; for example `man {page}`", written.pages.len());
    global.output().result(&written, words)
}

/// The pages of a command and of its commands, each with its name.
fn collect(command: &Command, name: &str, pages: &mut Vec<(String, Vec<u8>)>) -> std::io::Result<()> {
    let mut text = Vec::new();
    Man::new(command.clone().display_name(name.to_owned())).render(&mut text)?;
    pages.push((name.to_owned(), text));
    for inner in command.get_subcommands() {
        collect(inner, &format!("{name}-{}", inner.get_name()), pages)?;
    }
    Ok(())
}
