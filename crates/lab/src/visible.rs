//! Text for a terminal: letters that would command it are shown by their number.

use std::borrow::Cow;

/// The text with no control character but ends of lines and tabs. Names of files, and what stands in them, are as other
/// people made them.
#[must_use]
pub fn visible(text: &str) -> Cow<'_, str> {
    let commands = |letter: char| letter.is_control() && !matches!(letter, '\n' | '\t');
    if !text.contains(commands) {
        return Cow::Borrowed(text);
    }
    let shown = |letter: char| if commands(letter) { letter.escape_default().to_string() } else { letter.to_string() };
    Cow::Owned(text.chars().map(shown).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The change that makes it fail: a letter that commands a terminal is given as it is, or an umlaut is not.
    #[test]
    fn what_commands_a_terminal_is_shown_and_all_else_is_as_it_was() {
        assert_eq!(visible("a\u{1b}[2Jb\u{9b}\r"), "a\\u{1b}[2Jb\\u{9b}\\r");
        assert!(matches!(visible("Grüße\n\tπ"), Cow::Borrowed("Grüße\n\tπ")));
    }
}
