//! Words and paths in a command line that a message names, as a shell takes each of them for one word.

use std::path::Path;

/// A word as a shell takes it for one.
#[must_use]
pub fn text(word: &str) -> String {
    let is_plain = |letter: char| letter.is_alphanumeric() || "-_./,=:+@%".contains(letter);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

/// A path as a shell takes it for one word.
#[must_use]
pub fn path(path: &Path) -> String {
    let word = path.to_string_lossy();
    // It would be taken for an option.
    let before = if word.starts_with('-') { "./" } else { "" };
    text(&format!("{before}{word}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The change that makes it fail: a word goes into a command line as it is.
    #[test]
    fn a_word_with_spaces_or_quotes_is_one_word_for_a_shell() {
        for plain in ["reach.toml", "a/b-c_d.csv", "unix:/run/arm", "grüße.toml"] {
            assert_eq!(text(plain), plain);
        }
        assert_eq!(path(Path::new("my reach.toml")), "'my reach.toml'");
        assert_eq!(path(Path::new("-a.toml")), "./-a.toml");
        assert_eq!(text("it's"), r"'it'\''s'");
        assert_eq!(text(""), "''");
    }
}
