//! Writes a recording in our own layout, line by line while the telemetry arrives.
//!
//! Numbers are printed with as many digits as it takes to read the same number back.

use std::io::{self, Write};

use super::layout::{self, RecordingRow};

/// A recording that is being written.
#[derive(Debug)]
pub struct RecordingWriter<W: Write> {
    output: W,
    rows: usize,
}

impl<W: Write> RecordingWriter<W> {
    /// Writes the notes and the header. Each line of `notes` becomes a line that starts with `#`.
    ///
    /// # Errors
    /// The output's error.
    pub fn new(mut output: W, notes: &str) -> io::Result<RecordingWriter<W>> {
        for note in notes.lines() {
            writeln!(output, "# {note}")?;
        }
        writeln!(output, "{}", layout::header().join(","))?;
        Ok(RecordingWriter { output, rows: 0 })
    }

    /// Writes one line.
    ///
    /// # Errors
    /// The output's error.
    pub fn write(&mut self, row: &RecordingRow) -> io::Result<()> {
        let fields: Vec<String> = layout::LAYOUT.iter().map(|quantity| (quantity.fields)(row)).collect();
        writeln!(self.output, "{}", fields.join(","))?;
        self.rows += 1;
        Ok(())
    }

    /// Lines of data written so far.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Hands every byte to the operating system and gives the output back.
    ///
    /// # Errors
    /// The output's error.
    pub fn finish(mut self) -> io::Result<W> {
        self.output.flush()?;
        Ok(self.output)
    }
}
