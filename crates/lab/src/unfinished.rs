//! Unfinished files of this process, for whoever ends it before anything worth keeping is in them.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

static FILES: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn files() -> MutexGuard<'static, Vec<PathBuf>> {
    FILES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A file is begun.
pub(crate) fn begin(file: &Path) {
    files().push(file.to_owned());
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
