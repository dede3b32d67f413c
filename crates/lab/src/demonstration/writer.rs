//! Writes a recording in our own layout, line by line while the telemetry arrives.
//!
//! Numbers are printed with as many digits as it takes to read the same number back.

use std::io::{self, Write};

use super::layout;

/// One line of a recording; what it holds, in which unit and frame, is described in `docs/recording-format.md`.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordingRow {
    /// Number of the control cycle.
    pub cycle: u32,
    /// Time since the first line, s.
    pub time: f64,
    /// State of the supervisor, one lower-case word.
    pub state: &'static str,
    /// Stable code of the latched fault, 0 for none.
    pub fault: u8,
    /// Flags of the telemetry message.
    pub flags: u32,
    /// Phase of the movement.
    pub phase: f32,
    /// Joint angles, rad.
    pub q: [f32; layout::JOINTS],
    /// Joint velocities, rad/s.
    pub dq: [f32; layout::JOINTS],
    /// Joint torques commanded on the bus, N m.
    pub tau: [f32; layout::JOINTS],
    /// Tool frame computed from `q`: x, y, z (m, world), w, x, y, z.
    pub pose: [f64; 7],
    /// Desired tool frame: x, y, z (m, world), w, x, y, z.
    pub pose_d: [f32; 7],
    /// Wrench of the environment on the robot: force N (world axes), torque N m.
    pub wrench: [f32; 6],
    /// Position replies that were missing in this cycle.
    pub lost_replies: u8,
    /// Cost of the control cycle in ticks of the device's clock.
    pub cost_ticks: u32,
    /// Measured hand: spread and fingers 1 to 3, rad.
    pub hand: [f32; 4],
    /// Desired hand: spread and fingers 1 to 3, rad.
    pub hand_d: [f32; 4],
    /// Torque of the environment on fingers 1 to 3, N m.
    pub gauges: [f32; 3],
    /// Statistic of the watch for unusual runs.
    pub surprise: f32,
}

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
        let output = &mut self.output;
        write!(output, "{},{},{},{},{},{}", row.cycle, row.time, row.state, row.fault, row.flags, row.phase)?;
        for value in row.q.iter().chain(&row.dq).chain(&row.tau) {
            write!(output, ",{value}")?;
        }
        for value in &row.pose {
            write!(output, ",{value}")?;
        }
        for value in row.pose_d.iter().chain(&row.wrench) {
            write!(output, ",{value}")?;
        }
        write!(output, ",{},{}", row.lost_replies, row.cost_ticks)?;
        for value in row.hand.iter().chain(&row.hand_d).chain(&row.gauges).chain([&row.surprise]) {
            write!(output, ",{value}")?;
        }
        writeln!(output)?;
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
