//! Progress of long work: a bar on a terminal, elsewhere a line every ten seconds.

use std::borrow::Cow;
use std::io::{self, IsTerminal as _, Write as _};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle, TermLike};

/// Time between two lines where no terminal shows a bar.
const BETWEEN_LINES: Duration = Duration::from_secs(10);

/// Width that a bar has room in, columns.
const WIDTH: u16 = 80;

/// A bar for work of `steps` steps of a unit; on a terminal it fits 80 columns.
pub(super) fn bar(steps: u64, unit: &str, doing: impl Into<Cow<'static, str>>) -> ProgressBar {
    let shown = io::stderr().is_terminal();
    let template = if shown {
        format!("{{msg:24!}} [{{bar:20}}] {{pos}}/{{len}} {unit}, {{eta}} left")
    } else {
        format!("{{msg}}: {{pos}} of {{len}} {unit}, {{eta}} left")
    };
    let style = ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::with_draw_target(Some(steps), target(shown))
        .with_style(style.progress_chars("=> "))
        .with_message(doing)
}

/// A sign of life for work of unknown length.
pub(super) fn spinner(doing: impl Into<Cow<'static, str>>) -> ProgressBar {
    let shown = io::stderr().is_terminal();
    let spinner = ProgressBar::with_draw_target(None, target(shown)).with_message(doing);
    if shown {
        spinner.enable_steady_tick(Duration::from_millis(120));
        spinner
    } else {
        let style =
            ProgressStyle::with_template("{msg}, {elapsed} so far").unwrap_or_else(|_| ProgressStyle::default_bar());
        let spinner = spinner.with_style(style);
        spinner.enable_steady_tick(Duration::from_secs(1));
        spinner
    }
}

fn target(shown: bool) -> ProgressDrawTarget {
    if shown { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::term_like_with_hz(Box::new(Lines::new()), 1) }
}

/// Standard error that is no terminal: of everything that is drawn, a line every ten seconds is written.
#[derive(Debug)]
struct Lines {
    begun: Instant,
    due: Mutex<Due>,
}

impl Lines {
    fn new() -> Self {
        Self { begun: Instant::now(), due: Mutex::default() }
    }
}

/// The line that is drawn, and how many have been written.
#[derive(Debug, Default)]
struct Due {
    line: String,
    written: u32,
}

impl Due {
    /// A part of the line that is being drawn.
    fn draw(&mut self, text: &str) {
        self.line.push_str(text);
    }

    /// The drawing is complete, this long after the beginning: the line, if it is time for one.
    fn complete(&mut self, elapsed: Duration) -> Option<String> {
        let line = std::mem::take(&mut self.line);
        let line = line.trim();
        if line.is_empty() || elapsed < BETWEEN_LINES * (self.written + 1) {
            return None;
        }
        self.written = u32::try_from(elapsed.as_secs() / BETWEEN_LINES.as_secs()).unwrap_or(u32::MAX);
        Some(line.to_owned())
    }
}

impl TermLike for Lines {
    fn width(&self) -> u16 {
        WIDTH
    }

    fn move_cursor_up(&self, _: usize) -> io::Result<()> {
        Ok(())
    }

    fn move_cursor_down(&self, _: usize) -> io::Result<()> {
        Ok(())
    }

    fn move_cursor_right(&self, _: usize) -> io::Result<()> {
        Ok(())
    }

    fn move_cursor_left(&self, _: usize) -> io::Result<()> {
        Ok(())
    }

    fn write_line(&self, text: &str) -> io::Result<()> {
        self.write_str(text)
    }

    fn write_str(&self, text: &str) -> io::Result<()> {
        self.due.lock().unwrap_or_else(PoisonError::into_inner).draw(text);
        Ok(())
    }

    fn clear_line(&self) -> io::Result<()> {
        Ok(())
    }

    fn flush(&self) -> io::Result<()> {
        let due = self.due.lock().unwrap_or_else(PoisonError::into_inner).complete(self.begun.elapsed());
        // Whoever read it may be gone: the work goes on.
        due.map_or(Ok(()), |line| writeln!(io::stderr(), "{line}").or(Ok(())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_written_every_ten_seconds_and_none_twice_or_late() {
        let mut due = Due::default();
        let mut written = Vec::new();
        for tenth in 0..400_u32 {
            // A stall between 21 s and 29 s costs no line and brings none twice.
            if (210..290).contains(&tenth) {
                continue;
            }
            due.draw(&format!("at {}", tenth / 10));
            due.draw(" s   ");
            written.extend(due.complete(Duration::from_millis(u64::from(tenth) * 100)));
        }
        assert_eq!(written, ["at 10 s", "at 20 s", "at 30 s"]);
        due.draw("at 75 s");
        assert_eq!(due.complete(Duration::from_secs(75)).as_deref(), Some("at 75 s"));
        due.draw("at 79 s");
        assert_eq!(due.complete(Duration::from_secs(79)), None);
        assert_eq!(due.complete(Duration::from_secs(90)), None, "nothing is drawn");
    }
}
