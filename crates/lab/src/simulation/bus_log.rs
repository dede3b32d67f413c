//! A log of the simulated buses as `candump -L` writes it: `can0` is the arm's bus, `can1` the host's.
//!
//! A line's time is the moment at which the receivers have the frame, virtual seconds since power-up. Six decimals,
//! as every tool that reads such files expects. Where a fault is injected, frames of the co-controller stand as it sent
//! them, and all others as they were received: a lost one does not, a late one stands where it came.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use sim::{Passage, TICKS_PER_MICROSECOND, Ticks};

use super::SimulationError;
use crate::output_file::{OutputError, create_log};
use canlog::{ARM_INTERFACE, AnyFrame, HOST_INTERFACE, LogLine};

/// The file, and the frames whose time has not come: both buses go into it in order of time.
pub(super) struct BusLog {
    path: PathBuf,
    file: BufWriter<File>,
    waiting: Vec<(Ticks, LogLine)>,
}

impl BusLog {
    /// Begins a file; none of `inputs` is replaced.
    pub(super) fn create(path: &Path, replace: bool, inputs: &[&Path]) -> Result<Self, SimulationError> {
        let file = create_log(path, replace, inputs)?;
        Ok(Self { path: path.to_owned(), file: BufWriter::new(file), waiting: Vec::new() })
    }

    /// Frames of the arm's bus.
    pub(super) fn arm(&mut self, passages: &[Passage]) {
        self.take(ARM_INTERFACE, passages);
    }

    /// Frames of the host's bus.
    pub(super) fn host(&mut self, passages: &[Passage]) {
        self.take(HOST_INTERFACE, passages);
    }

    fn take(&mut self, interface: &str, passages: &[Passage]) {
        self.waiting.extend(passages.iter().map(|passage| {
            let time_us = passage.end / TICKS_PER_MICROSECOND;
            (passage.end, LogLine { time_us, interface: interface.into(), frame: AnyFrame::Data(passage.frame) })
        }));
    }

    /// Writes everything that both buses have carried by `now`, through to the file: at the end nobody is left to take
    /// an error.
    pub(super) fn write_until(&mut self, now: Ticks) -> Result<(), OutputError> {
        self.write(now).map_err(|cause| OutputError::System { file: self.path.clone(), cause })
    }

    fn write(&mut self, now: Ticks) -> std::io::Result<()> {
        // Stable: frames that end at the same moment stay in the order of the calls.
        self.waiting.sort_by_key(|(end, _)| *end);
        let due = self.waiting.partition_point(|(end, _)| *end <= now);
        for (_, line) in self.waiting.drain(..due) {
            writeln!(self.file, "{line}")?;
        }
        // What is still on the wire when the arm is switched off never arrives.
        self.file.flush()
    }
}
