//! A hint for a command line in which an option has taken the word that was meant for the command.

use std::path::Path;

use clap::error::{ContextKind, ErrorKind};

use lab::quoted;

/// An option that may stand alone, and so takes the next word for its own.
const OPTION: &str = "--keep";

/// The hint, if a word is missing that [`OPTION`] has taken; `words` is the command line.
pub(super) fn hint(error: &clap::Error, words: &[String]) -> Option<String> {
    let is_missing = error.kind() == ErrorKind::MissingRequiredArgument && error.get(ContextKind::InvalidArg).is_some();
    let at = words.iter().position(|word| word == OPTION)?;
    let taken = words.get(at + 1).filter(|word| !word.starts_with('-'))?;
    // A folder is what the option is for: then the other word is missing indeed.
    if !is_missing || Path::new(taken).is_dir() {
        return None;
    }
    let mut meant: Vec<String> = words.iter().map(|word| quoted::text(word)).collect();
    meant.swap(at, at + 1);
    meant[0] = "tactus".to_owned();
    Some(format!("`{OPTION}` took {} as its folder: `{}`", quoted::text(taken), meant.join(" ")))
}
