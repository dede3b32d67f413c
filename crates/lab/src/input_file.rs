//! A file that somebody gives to a command: read whole, and refused when it is longer than any of its kind.

use std::borrow::Cow;
use std::fmt::Display;
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

/// Reads a text of at most [`LONGEST_TEXT`] bytes, with its lines as [`with_newlines`] ends them.
///
/// # Errors
/// As [`read`]; [`ErrorKind::InvalidData`] if it is not UTF-8.
pub fn read_text(path: &Path) -> io::Result<String> {
    String::from_utf8(with_newlines(&read(path, LONGEST_TEXT)?).into_owned())
        .map_err(|_| Error::new(ErrorKind::InvalidData, "it is not text in UTF-8"))
}

/// The bytes with their lines ended by newlines: some programs end them with carriage returns alone, which would make
/// one note, or one line, of the whole file.
#[must_use]
pub fn with_newlines(bytes: &[u8]) -> Cow<'_, [u8]> {
    if bytes.contains(&b'\n') || !bytes.contains(&b'\r') {
        return Cow::Borrowed(bytes);
    }
    Cow::Owned(bytes.iter().map(|byte| if *byte == b'\r' { b'\n' } else { *byte }).collect())
}

/// Letters of the longest line of a file that is shown beside what is wrong with it.
const SHOWN: usize = 160;

/// The words of a parser, without the line that it shows where that is longer than people read: a picture or a page of
/// HTML that was taken for a primitive has lines of a megabyte.
#[must_use]
pub fn parser_words(error: &impl Display) -> String {
    let words = error.to_string();
    let is_shown = |line: &str| {
        line.trim_start().trim_start_matches(|letter: char| letter.is_ascii_digit()).starts_with([' ', '|'])
            && line.contains('|')
    };
    let is_long = words.lines().any(|line| line.chars().count() > SHOWN);
    let kept = words.trim_end().lines().filter(|line| !is_long || !is_shown(line));
    kept.collect::<Vec<_>>().join("\n")
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

    /// The change that makes it fail: a text is given as it stands in the file.
    #[test]
    fn a_text_whose_lines_end_in_carriage_returns_alone_has_lines() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a");
        for (text, read) in [("a\rb\r", "a\nb\n"), ("a\r\nb\r\n", "a\r\nb\r\n"), ("a\rb\n", "a\rb\n")] {
            std::fs::write(&file, text).unwrap();
            assert_eq!(read_text(&file).unwrap(), read, "{text:?}");
        }
    }

    /// The change that makes it fail: what the parser says is told as it is, with a line of a megabyte.
    #[test]
    fn the_words_of_a_parser_show_no_line_that_is_longer_than_a_screen() {
        let of = |text: &str| parser_words(&toml::from_str::<toml::Table>(text).unwrap_err());
        let usual = of("a = 1\nb = \nc = 3\n");
        assert!(usual.contains("\n2 | b = \n") && usual.ends_with(|letter: char| !letter.is_whitespace()), "{usual}");
        let long = of(&format!("a = 1\nb = {} }}\n", "[1, ".repeat(1000)));
        assert!(long.starts_with("TOML parse error at line 2, column ") && long.len() < 300, "{long}");
        assert!(!long.contains("[1, "), "{long}");
    }
}
