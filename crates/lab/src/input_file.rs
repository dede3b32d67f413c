//! A file that somebody gives to a command: read whole, and refused when it is longer than any of its kind.

use std::fs::File;
use std::io::{self, Error, ErrorKind, Read};
use std::path::Path;

/// Longest recording (bytes): half an hour of every control cycle has 300 MB.
pub const LONGEST_RECORDING: u64 = 1 << 30;
/// Longest image of a firmware (bytes).
pub const LONGEST_IMAGE: u64 = 64 << 20;
/// Longest primitive, configuration or script (bytes). A primitive of 50 kernels has 0.1 MB.
pub const LONGEST_TEXT: u64 = 16 << 20;

/// Reads a file of at most so many bytes. A device that never ends, such as `/dev/zero`, would fill the memory.
///
/// # Errors
/// Those of the system; [`ErrorKind::InvalidData`] says the limit.
pub fn read(path: &Path, longest: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(path)?.take(longest + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > longest {
        let cause = format!("it has more than the {} MiB that such a file can have", longest >> 20);
        return Err(Error::new(ErrorKind::InvalidData, cause));
    }
    Ok(bytes)
}

/// Reads a text of at most [`LONGEST_TEXT`] bytes.
///
/// # Errors
/// As [`read`]; [`ErrorKind::InvalidData`] if it is not UTF-8.
pub fn read_text(path: &Path) -> io::Result<String> {
    String::from_utf8(read(path, LONGEST_TEXT)?)
        .map_err(|_| Error::new(ErrorKind::InvalidData, "it is not text in UTF-8"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_read_up_to_its_limit_and_refused_beyond() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a");
        std::fs::write(&file, [7; 100]).unwrap();
        assert_eq!(read(&file, 100).unwrap(), [7; 100]);
        assert_eq!(read(&file, 99).unwrap_err().kind(), ErrorKind::InvalidData);
        assert_eq!(read(Path::new("/dev/zero"), LONGEST_TEXT).unwrap_err().kind(), ErrorKind::InvalidData);
        assert_eq!(read(&folder.path().join("b"), 1).unwrap_err().kind(), ErrorKind::NotFound);
        std::fs::write(&file, [0xFF]).unwrap();
        assert_eq!(read_text(&file).unwrap_err().kind(), ErrorKind::InvalidData);
    }
}
