//! The output of a command: data on stdout, words and progress on stderr, JSON when asked.

use std::borrow::Cow;
use std::io::{ErrorKind, Write};

use indicatif::ProgressBar;
use serde::Serialize;

use super::{ErrorCode, Failure, progress};
use lab::visible::visible;

/// The action that fails when standard output does.
pub(super) const WRITING: &str = "writing the result to standard output";

/// Judges what became of writing to standard output, once all of it has left; false where nobody reads it any more,
/// which is no failure: `tactus --help | head -1` is a way to use it.
///
/// # Errors
/// The output could not take it.
pub(super) fn written(outcome: std::io::Result<()>) -> Result<bool, Failure> {
    match outcome.and_then(|()| std::io::stdout().flush()) {
        Err(cause) if cause.kind() == ErrorKind::BrokenPipe => Ok(false),
        Err(cause) => Err(Failure::of_file(ErrorCode::ResultNotWritten, WRITING, cause)),
        Ok(()) => Ok(true),
    }
}

/// Where the output of one command goes.
#[derive(Debug, Clone, Copy, Default)]
pub struct Output {
    /// Data as JSON instead of text.
    pub json: bool,
    /// No words and no progress; data and errors still appear.
    pub quiet: bool,
}

/// Says something to a person in any case, on standard error.
pub(super) fn tell(words: impl AsRef<str>) {
    // A terminal that was closed is no reason to end: an arm may be moving.
    let _ = writeln!(std::io::stderr(), "{}", visible(words.as_ref()));
}

impl Output {
    /// Says something to a person.
    pub fn say(&self, words: impl AsRef<str>) {
        if !self.quiet {
            tell(words);
        }
    }

    /// Warns, also when quiet.
    pub fn warn(&self, words: impl AsRef<str>) {
        tell(format!("warning: {}", words.as_ref()));
    }

    /// Writes the result: `data` as one line of JSON, or `text`.
    ///
    /// # Errors
    /// The output cannot take it, or the data cannot be expressed in JSON.
    pub fn result(&self, data: &impl Serialize, text: impl AsRef<str>) -> Result<(), Failure> {
        // `tactus check FILE | head -1` is a way to use it.
        self.line(data, text).map(|_| ())
    }

    /// As [`result`](Self::result), of a command that writes line after line; false once nobody reads them any more.
    ///
    /// # Errors
    /// As [`result`](Self::result).
    pub fn line(&self, data: &impl Serialize, text: impl AsRef<str>) -> Result<bool, Failure> {
        let line: Cow<'_, str> = if self.json {
            serde_json::to_string(data)
                .map_err(|cause| Failure::new(ErrorCode::ResultNotWritten, WRITING, cause))?
                .into()
        } else {
            visible(text.as_ref().trim_end())
        };
        written(writeln!(std::io::stdout(), "{line}"))
    }

    /// A bar for work of `steps` steps of a unit; off a terminal it is a line every ten seconds.
    pub fn bar(&self, steps: u64, unit: &str, doing: impl Into<Cow<'static, str>>) -> ProgressBar {
        if self.quiet { ProgressBar::hidden() } else { progress::bar(steps, unit, doing) }
    }

    /// A sign of life for work of unknown length; off a terminal it is a line every ten seconds.
    pub fn spinner(&self, doing: impl Into<Cow<'static, str>>) -> ProgressBar {
        if self.quiet { ProgressBar::hidden() } else { progress::spinner(doing) }
    }
}
