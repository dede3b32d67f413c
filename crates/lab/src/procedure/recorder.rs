//! Records what the arm does: every cycle that comes over the link becomes one line of a file.

use std::io::Write;
use std::time::Duration;

use link::{Event, Telemetry};

use super::ProcedureError;
use crate::arm;
use crate::client::{Client, Incoming};
use crate::demonstration::RATE;
use crate::demonstration::{RecordingRow, RecordingWriter};
use crate::device::Device;

/// Silence on the stream after which the device counts as lost.
const SILENCE: Duration = Duration::from_secs(1);

/// One thing a recorder came by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Take {
    /// A cycle; it is in the file.
    Cycle(Telemetry),
    /// An event; events are not recorded.
    Event(Event),
}

/// One cycle as a line of a recording whose first line is the cycle `first`.
pub fn recording_row(telemetry: &Telemetry, first: u32) -> RecordingRow {
    let (position, orientation) = arm::tool_pose(&telemetry.q.map(f64::from));
    let mut pose = [0.0; 7];
    pose[..3].copy_from_slice(&position);
    pose[3..].copy_from_slice(&orientation);
    RecordingRow { time: f64::from(telemetry.cycle.wrapping_sub(first)) / RATE, pose, telemetry: *telemetry }
}

/// The text of a recording of these cycles.
///
/// # Errors
/// None that a memory could give; the type is that of [`RecordingWriter`].
pub fn recording_text(cycles: &[Telemetry], notes: &str) -> std::io::Result<Vec<u8>> {
    let mut writer = CycleWriter::new(Vec::new(), notes)?;
    for telemetry in cycles {
        writer.write(telemetry)?;
    }
    writer.finish()
}

/// A recording that is written cycle by cycle.
#[derive(Debug)]
pub struct CycleWriter<W: Write> {
    writer: RecordingWriter<W>,
    first: Option<u32>,
}

impl<W: Write> CycleWriter<W> {
    /// Writes the head of the file.
    ///
    /// # Errors
    /// The output's error.
    pub fn new(output: W, notes: &str) -> std::io::Result<Self> {
        Ok(Self { writer: RecordingWriter::new(output, notes)?, first: None })
    }

    /// Writes one cycle.
    ///
    /// # Errors
    /// The output's error.
    pub fn write(&mut self, telemetry: &Telemetry) -> std::io::Result<()> {
        let first = *self.first.get_or_insert(telemetry.cycle);
        self.writer.write(&recording_row(telemetry, first))
    }

    /// Cycles written so far.
    pub fn rows(&self) -> usize {
        self.writer.rows()
    }

    /// Hands every byte to the output and gives it back.
    ///
    /// # Errors
    /// The output's error.
    pub fn finish(self) -> std::io::Result<W> {
        self.writer.finish()
    }
}

/// A recording that is being made.
pub struct Recorder<W: Write> {
    writer: CycleWriter<W>,
}

impl<W: Write> Recorder<W> {
    /// Switches the stream on, every control cycle, and writes the head of the file.
    ///
    /// # Errors
    /// The device refuses, or the output does.
    pub fn start(client: &mut Client<Device>, output: W, notes: &str) -> Result<Self, ProcedureError> {
        let writer = CycleWriter::new(output, notes)?;
        client.set_telemetry(1)?;
        Ok(Self { writer })
    }

    /// Waits for the next cycle or event, and writes a cycle down.
    ///
    /// # Errors
    /// [`crate::error::HostError::NoAnswer`] after a second without either, and as [`Client::next`].
    pub fn take(&mut self, client: &mut Client<Device>) -> Result<Take, ProcedureError> {
        match client.next(SILENCE)? {
            Some(Incoming::Telemetry(telemetry)) => {
                self.writer.write(&telemetry)?;
                Ok(Take::Cycle(telemetry))
            }
            Some(Incoming::Event(event)) => Ok(Take::Event(event)),
            None => Err(crate::error::HostError::NoAnswer { request: "telemetry", after: SILENCE }.into()),
        }
    }

    /// Cycles written so far.
    pub fn rows(&self) -> usize {
        self.writer.rows()
    }

    /// Switches the stream off and closes the file.
    ///
    /// # Errors
    /// The device or the output refuses.
    pub fn finish(self, client: &mut Client<Device>) -> Result<W, ProcedureError> {
        client.set_telemetry(0)?;
        Ok(self.writer.finish()?)
    }
}
