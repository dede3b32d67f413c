//! The secret of a device in a file: one line of 32 hexadecimal digits, drawn at random.
//!
//! No secret is made from words that a person remembers: whoever has listened to one proof can try all such words at
//! leisure, and a hash as fast as this one lets them try a thousand million a second.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read as _, Write as _};
use std::os::unix::fs::{FileTypeExt as _, OpenOptionsExt as _, PermissionsExt as _};
use std::path::Path;

use link::Secret;
use link::secret::SECRET_BYTES;
use thiserror::Error;

use crate::error_code::ErrorCode;
use crate::input_file;

/// Why there is no secret in a file.
#[derive(Debug, Error)]
pub enum SecretFileError {
    /// The operating system refuses.
    #[error(transparent)]
    System(#[from] io::Error),
    /// It holds something else.
    #[error("it does not hold 32 hexadecimal digits")]
    Form,
    /// It is no file: nobody may ever write into a pipe, and reading it would wait for that.
    #[error("it is {0}, not a file with a secret")]
    NotAFile(&'static str),
}

impl SecretFileError {
    /// Its number.
    #[must_use]
    pub fn code(&self) -> ErrorCode {
        match self {
            Self::Form | Self::NotAFile(_) => ErrorCode::NoSecretInFile,
            Self::System(cause) if cause.kind() == io::ErrorKind::AlreadyExists => ErrorCode::WouldReplace,
            Self::System(cause) if cause.kind() == io::ErrorKind::InvalidData => ErrorCode::NoSecretInFile,
            Self::System(cause) => ErrorCode::of_file(cause).unwrap_or(ErrorCode::FileFailed),
        }
    }
}

/// Reads the secret in a file.
///
/// # Errors
/// The file cannot be read, or is none, or holds something else.
pub fn read(path: &Path) -> Result<Secret, SecretFileError> {
    let kind = fs::metadata(path)?.file_type();
    // `<(pass show lab)` of a shell is a pipe as well, with somebody at its other end.
    let is_of_the_shell = path.starts_with("/dev/fd") || path.starts_with("/proc");
    if kind.is_dir() {
        return Err(SecretFileError::NotAFile("a folder"));
    }
    if kind.is_socket() || kind.is_fifo() && !is_of_the_shell {
        return Err(SecretFileError::NotAFile("a pipe or a socket"));
    }
    parse(&input_file::read_text(path)?).ok_or(SecretFileError::Form)
}

/// True if others than its owner may read or replace the content of a file.
#[must_use]
pub fn is_open_to_others(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|found| found.is_file() && found.permissions().mode() & 0o066 != 0)
}

/// Draws a secret and writes it into a new file, which nobody but its owner may read.
///
/// # Errors
/// The file cannot be written, or there is one: a device may keep what it holds.
pub fn create(path: &Path) -> Result<Secret, SecretFileError> {
    let mut bytes = [0; SECRET_BYTES];
    File::open("/dev/urandom")?.read_exact(&mut bytes)?;
    let secret = Secret::new(bytes);
    let mut file = OpenOptions::new().write(true).create_new(true).mode(0o600).open(path)?;
    file.write_all(text(&secret).as_bytes()).and_then(|()| file.sync_all()).inspect_err(|_| {
        // Half a secret would only be in the way of the next one.
        let _ = fs::remove_file(path);
    })?;
    Ok(secret)
}

/// The content of its file.
fn text(secret: &Secret) -> String {
    secret.bytes().iter().map(|byte| format!("{byte:02x}")).chain(["\n".to_owned()]).collect()
}

fn parse(text: &str) -> Option<Secret> {
    let digits = text.trim();
    if digits.len() != 2 * SECRET_BYTES || !digits.bytes().all(|digit| digit.is_ascii_hexdigit()) {
        return None;
    }
    u128::from_str_radix(digits, 16).ok().map(|number| Secret::new(number.to_be_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_new_secret_is_random_is_read_again_is_its_owners_alone_and_is_never_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let (one, other) = (folder.path().join("one"), folder.path().join("other"));
        let secret = create(&one).unwrap();
        assert_eq!(read(&one).unwrap(), secret);
        assert_ne!(create(&other).unwrap(), secret);
        assert_eq!(one.metadata().unwrap().permissions().mode() & 0o777, 0o600);
        let before = std::fs::read(&one).unwrap();
        assert_eq!(create(&one).unwrap_err().code(), ErrorCode::WouldReplace);
        assert_eq!(std::fs::read(&one).unwrap(), before);
    }

    #[test]
    fn what_is_no_secret_is_refused() {
        let digits = "000102030405060708090a0B0c0d0e0f";
        let secret = Secret::new(std::array::from_fn(|index| index as u8));
        assert_eq!(parse(&format!(" {digits}\r\n")), Some(secret));
        assert_eq!(text(&secret), "000102030405060708090a0b0c0d0e0f\n");
        for wrong in
            ["", "correct horse battery staple", &digits[1..], &format!("{digits}0"), &digits.replace('a', "+")]
        {
            assert_eq!(parse(wrong), None, "{wrong}");
        }
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        for (content, code) in [(&b"secret"[..], ErrorCode::NoSecretInFile), (&[0xFF; 16], ErrorCode::NoSecretInFile)] {
            std::fs::write(&file, content).unwrap();
            assert_eq!(read(&file).unwrap_err().code(), code);
        }
        assert_eq!(read(&folder.path().join("none")).unwrap_err().code(), ErrorCode::FileMissing);
    }
}
