//! Unfinished files of this process, for whoever ends it before anything worth keeping is in them.

use std::fs::{File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

static FILES: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn files() -> MutexGuard<'static, Vec<PathBuf>> {
    FILES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Begins a file that does not exist; whoever takes all of them away meanwhile waits for this one.
pub(crate) fn create(file: &Path) -> io::Result<File> {
    let mut files = files();
    let created = OpenOptions::new().write(true).create_new(true).open(file)?;
    files.push(file.to_owned());
    Ok(created)
}

/// It is at its place, is kept, or is gone.
pub(crate) fn end(file: &Path) {
    files().retain(|other| other != file);
}

/// Takes all of them away, and holds up whatever else would begin or end one. Only for a process that ends now.
pub fn discard_all() -> impl Sized {
    let mut files = files();
    for file in files.drain(..) {
        // Nobody is left to take an error.
        let _ = std::fs::remove_file(file);
    }
    files
}
