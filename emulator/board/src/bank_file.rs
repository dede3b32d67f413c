//! The file that holds bank 2 of the flash between two runs, and the one beside it.

use std::collections::BTreeSet;
use std::io;
use std::path::{Path, PathBuf};

use crate::cache::BANK;

/// A file that cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[error("{}: {source}", path.display())]
pub struct FileError {
    path: PathBuf,
    source: io::Error,
}

/// Names the file in its error.
pub(crate) fn file<T>(path: &Path, result: io::Result<T>) -> Result<T, FileError> {
    result.map_err(|source| FileError { path: path.to_owned(), source })
}

/// Content of bank 2 from its file; a file that is not there is an erased bank.
pub(crate) fn content(path: &Path) -> Result<Vec<u8>, FileError> {
    let size = (BANK.end - BANK.start) as usize;
    if !path.exists() {
        return Ok(vec![0xFF; size]);
    }
    let bytes = file(path, std::fs::read(path))?;
    if bytes.len() != size {
        let message = format!("{} bytes where bank 2 has {size}", bytes.len());
        return file(path, Err(io::Error::new(io::ErrorKind::InvalidData, message)));
    }
    Ok(bytes)
}

/// Keeps the content of a file. Written beside it, it then takes its place: an emulator that is killed meanwhile
/// leaves the old one whole.
pub(crate) fn keep(path: &Path, content: &[u8]) -> Result<(), FileError> {
    let mut beside = path.as_os_str().to_owned();
    beside.push(".new");
    let beside = PathBuf::from(beside);
    file(&beside, std::fs::write(&beside, content))?;
    file(path, std::fs::rename(&beside, path))
}

/// The file beside bank 2's that names the words whose check bits do not fit, one address a line.
fn damaged_path(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".damaged");
    name.into()
}

/// Words whose check bits do not fit, from the file beside bank 2's.
pub(crate) fn damaged_words(path: &Path) -> Result<BTreeSet<u32>, FileError> {
    let path = damaged_path(path);
    if !path.exists() {
        return Ok(BTreeSet::new());
    }
    let text = file(&path, std::fs::read_to_string(&path))?;
    Ok(text.lines().filter_map(|line| u32::from_str_radix(line.trim_start_matches("0x"), 16).ok()).collect())
}

/// Keeps them; no file is none.
pub(crate) fn keep_damaged(path: &Path, damaged: &BTreeSet<u32>) -> Result<(), FileError> {
    let path = damaged_path(path);
    if damaged.is_empty() {
        return if path.exists() { file(&path, std::fs::remove_file(&path)) } else { Ok(()) };
    }
    let text: String = damaged.iter().map(|address| format!("{address:#010x}\n")).collect();
    keep(&path, text.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The change that makes it fail: the file is written in place, so that a kill on the way leaves half of it.
    #[test]
    fn what_is_kept_takes_the_place_of_the_old_bank_and_never_overwrites_it() {
        let folder = std::env::temp_dir().join(format!("emulated-board-bank-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let (path, witness) = (folder.join("bank2"), folder.join("witness"));
        keep(&path, b"old").expect("written");
        // A second name of the old file tells whether it is written to.
        std::fs::hard_link(&path, &witness).expect("a second name");
        keep(&path, b"new").expect("written");
        assert_eq!(std::fs::read(&path).expect("there"), b"new");
        assert_eq!(std::fs::read(&witness).expect("there"), b"old");
        assert_eq!(std::fs::read_dir(&folder).expect("a folder").count(), 2, "nothing else is left behind");
        std::fs::remove_dir_all(&folder).expect("removed");
    }
}
