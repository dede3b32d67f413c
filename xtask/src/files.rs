//! The files of the repository: tracked by git, or new and not ignored.

use std::process::Command;

use anyhow::Result;

use crate::shell;

/// Path below the root and text of every file that `is_read` accepts; a file that is no text counts as empty.
///
/// # Errors
/// If git cannot list the files.
pub(crate) fn all(is_read: impl Fn(&str) -> bool) -> Result<Vec<(String, String)>> {
    let mut list = Command::new("git");
    list.current_dir(shell::root()).args(["ls-files", "--cached", "--others", "--exclude-standard"]);
    let mut files = Vec::new();
    for path in shell::capture(&mut list)?.lines() {
        // A file that was deleted but not committed yet is still listed.
        let absolute = shell::root().join(path);
        if absolute.is_file() {
            let text =
                if is_read(path) { std::fs::read_to_string(absolute).unwrap_or_default() } else { String::new() };
            files.push((path.to_owned(), text));
        }
    }
    Ok(files)
}
