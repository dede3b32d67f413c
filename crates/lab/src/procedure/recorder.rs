//! Records what the arm does: every cycle that comes over the link becomes one line of a file.

use std::io::Write;
use std::time::Duration;

use device::Stage;
use link::{Event, Telemetry};

use super::ProcedureError;
use crate::arm;
use crate::client::{Client, Incoming};
use crate::demonstration::RATE;
use crate::demonstration::{RecordingRow, RecordingWriter};
use crate::device::Device;
use crate::error::{HostError, explain_blocked};

/// Silence on the stream after which the device counts as lost.
const SILENCE: Duration = Duration::from_secs(1);

/// Time for what has come while nobody read it.
const BEHIND: Duration = Duration::from_millis(100);

/// Why no cycle comes.
fn silence(client: &mut Client<Device>) -> ProcedureError {
    let status = client.status().ok();
    let stage = status.as_ref().and_then(|status| Stage::from_code(status.startup_stage));
    match (status.and_then(|status| status.blocked), stage) {
        (Some(reason), _) => ProcedureError::NotReady(explain_blocked(reason)),
        (None, Some(stage)) if stage < Stage::WaitingForActive => {
            ProcedureError::NotReady(stage.explanation().to_owned())
        }
        _ => HostError::NoAnswer { request: "telemetry", after: SILENCE }.into(),
    }
}

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
    /// The first cycle, and the newest.
    span: Option<(u32, u32)>,
}

impl<W: Write> CycleWriter<W> {
    /// Writes the head of the file.
    ///
    /// # Errors
    /// The output's error.
    pub fn new(output: W, notes: &str) -> std::io::Result<Self> {
        Ok(Self { writer: RecordingWriter::new(output, notes)?, span: None })
    }

    /// Writes one cycle.
    ///
    /// # Errors
    /// The output's error.
    pub fn write(&mut self, telemetry: &Telemetry) -> std::io::Result<()> {
        let first = self.span.map_or(telemetry.cycle, |(first, _)| first);
        self.span = Some((first, telemetry.cycle));
        self.writer.write(&recording_row(telemetry, first))
    }

    /// Cycles written so far.
    pub fn rows(&self) -> usize {
        self.writer.rows()
    }

    /// Time from the beginning of the first cycle to the end of the newest, s. Cycles that were lost on the way took
    /// theirs all the same.
    pub fn seconds(&self) -> f64 {
        self.span.map_or(0.0, |(first, newest)| (f64::from(newest.wrapping_sub(first)) + 1.0) / RATE)
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
    /// Time of the last cycle. Events do not count: a start-up that is tried again and again tells of nothing else.
    heard: Duration,
}

impl<W: Write> Recorder<W> {
    /// Switches the stream on, every control cycle, and writes the head of the file.
    ///
    /// # Errors
    /// The device refuses, or the output does.
    pub fn start(client: &mut Client<Device>, output: W, notes: &str) -> Result<Self, ProcedureError> {
        let writer = CycleWriter::new(output, notes)?;
        client.set_telemetry(1)?;
        Ok(Self { writer, heard: client.now() })
    }

    /// Waits for the next cycle or event, and writes a cycle down.
    ///
    /// # Errors
    /// After a second without a cycle [`ProcedureError::NotReady`] if the start-up waits or is blocked, as there are no
    /// cycles then, else [`crate::error::HostError::NoAnswer`]; and as [`Client::next`].
    pub fn take(&mut self, client: &mut Client<Device>) -> Result<Take, ProcedureError> {
        let left = SILENCE.saturating_sub(client.now().saturating_sub(self.heard));
        match client.next(left.max(BEHIND))? {
            Some(Incoming::Telemetry(telemetry)) => {
                self.heard = client.now();
                self.writer.write(&telemetry)?;
                Ok(Take::Cycle(telemetry))
            }
            Some(Incoming::Event(event)) if !left.is_zero() => Ok(Take::Event(event)),
            Some(Incoming::Event(event)) => match silence(client) {
                // Cycles wait behind it: this program was kept from reading them.
                ProcedureError::Host(_) => Ok(Take::Event(event)),
                waits => Err(waits),
            },
            None => Err(silence(client)),
        }
    }

    /// Cycles written so far.
    pub fn rows(&self) -> usize {
        self.writer.rows()
    }

    /// As [`CycleWriter::seconds`].
    pub fn seconds(&self) -> f64 {
        self.writer.seconds()
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
