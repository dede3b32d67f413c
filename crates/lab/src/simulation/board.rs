//! The engine of `board:`: the image for the real board on the emulated chip, in lock step with the plant.
//!
//! The emulator is a process of its own (`emulated-board serve`). It keeps the time of the chip, its flash and its
//! host line; bus, world and people stay on this side, as with QEMU. The end of its input is the power switch: it
//! then writes bank 2 and its report.

use std::io::{BufRead, BufReader, Write as _};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use sim::{Lockstep, LockstepError, PlainLine, Plant, Ticks};

use super::board_can::RECORD_BYTES;
use super::options::{BoardEngine, FlashSource, SimulationOptions};
use super::processor::{SharedProcessor, out_of_reach};
use super::words::Words;
use super::{Execute, SimulationError};
use crate::image_file::{ImageFile, ImageFileError};
use crate::transport::LineKind;

/// The board whose image the emulator executes, as its image says it.
const BOARD: &str = "nucleo-h743zi2";

/// Longest time for an emulator that says nothing more to end.
const END_TIMEOUT: Duration = Duration::from_secs(10);

/// Longest time for it to write bank 2 and its report when the power is switched off. Much, because one that is killed
/// instead forgets what was stored: a busy machine has needed more than 10 s.
const KEEPING_TIMEOUT: Duration = Duration::from_secs(120);

/// Exit status of an emulator that cannot begin: its options or the image are not to its liking.
const REFUSED: i32 = 2;

/// The words for the emulator.
fn command(engine: &BoardEngine, options: &SimulationOptions) -> Result<Command, SimulationError> {
    let mut command = Command::new(&engine.emulator);
    out_of_reach(&mut command).arg("serve").arg("--image").arg(&engine.image);
    match &options.flash {
        FlashSource::New => {}
        FlashSource::File(path) => {
            command.arg("--bank2").arg(path);
        }
        FlashSource::Chip(_) => return Err(SimulationError::FlashOfItsOwn),
    }
    command.args(["--host-line", if options.line == LineKind::Can { "can" } else { "serial" }]);
    let files = [("--log", &options.firmware_log), ("--report", &options.board_report)];
    for (name, file) in files {
        if let Some(path) = file {
            command.arg(name).arg(path);
        }
    }
    if let Some(reading) = engine.chip.cancellation {
        command.args(["--cancellation", reading.name()]);
    }
    if let Some(revision) = engine.chip.revision {
        command.args(["--revision", &format!("{revision:#06x}")]);
    }
    for fault in &engine.chip.faults {
        command.args(["--fault", fault]);
    }
    Ok(command)
}

/// A running emulator and the streams to it.
pub(super) struct EmulatedBoard {
    child: Child,
    _processor: SharedProcessor,
    /// `None` once it has ended, or is being switched off.
    lockstep: Option<Lockstep<BufReader<ChildStdout>, ChildStdin>>,
    words: Words,
}

impl EmulatedBoard {
    /// Switches the board on and gives the plant a line without delay.
    pub(super) fn spawn(
        engine: &BoardEngine,
        options: &SimulationOptions,
        plant: &mut Plant,
    ) -> Result<Self, SimulationError> {
        check_image(&engine.image)?;
        let mut child = command(engine, options)?
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|cause| SimulationError::Emulator(engine.emulator.clone(), cause))?;
        let (Some(to), Some(from), Some(stderr)) = (child.stdin.take(), child.stdout.take(), child.stderr.take())
        else {
            unreachable!("all three streams were asked for as pipes")
        };
        let processor = SharedProcessor::share(&child);
        let words = Words::of(stderr, None);
        let mut from = BufReader::new(from);
        // Whether it begins at all is told here and not in the middle of a conversation.
        let begins = from.fill_buf().is_ok_and(|bytes| !bytes.is_empty());
        let mut board = Self { child, _processor: processor, lockstep: begins.then(|| Lockstep::new(from, to)), words };
        if !begins {
            return Err(board.ended());
        }
        plant.set_link_line(Box::new(match options.line {
            LineKind::Serial => PlainLine::default(),
            LineKind::Can => PlainLine::of_records(RECORD_BYTES),
        }));
        Ok(board)
    }

    /// Why the emulator has ended by itself.
    fn ended(&mut self) -> SimulationError {
        self.lockstep = None;
        let status = self.wait(END_TIMEOUT);
        let words = self.last_output();
        match status {
            Some(status) if status.code() == Some(REFUSED) => SimulationError::BoardRefused(words),
            Some(status) => SimulationError::BoardEnded { status: format!(" ({status})"), words },
            None => SimulationError::BoardEnded { status: " (it had to be killed)".to_owned(), words },
        }
    }

    fn last_output(&mut self) -> String {
        let words = self.words.last();
        let words = String::from_utf8_lossy(&words);
        if words.trim().is_empty() { "nothing".to_owned() } else { words.trim().to_owned() }
    }

    /// Waits for it to end by itself; `None`: it did not within this time and was killed.
    fn wait(&mut self, longest: Duration) -> Option<ExitStatus> {
        let deadline = Instant::now() + longest;
        loop {
            match self.child.try_wait() {
                Ok(Some(status)) => return Some(status),
                Ok(None) if Instant::now() < deadline => std::thread::sleep(Duration::from_millis(2)),
                _ => break,
            }
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
        None
    }
}

/// Refuses an image that says it is for another board, or nothing at all.
fn check_image(image: &Path) -> Result<(), SimulationError> {
    let file = ImageFile::read(image).map_err(|error: ImageFileError| SimulationError::BoardImage(Box::new(error)))?;
    let board = file.description.board;
    if board == BOARD {
        return Ok(());
    }
    Err(SimulationError::OtherBoard { image: image.to_owned(), board, expected: BOARD })
}

impl Execute for EmulatedBoard {
    fn advance(&mut self, plant: &mut Plant, _limit: Ticks) -> Result<Ticks, SimulationError> {
        // One exchange, as with QEMU: the emulator decides how far it comes, and asks at least once a slot.
        let Some(lockstep) = &mut self.lockstep else {
            return Err(self.ended());
        };
        match lockstep.serve_one(plant) {
            Ok(served) if !served.is_last() => Ok(plant.now()),
            Ok(_) | Err(LockstepError::Truncated { .. }) => Err(self.ended()),
            Err(LockstepError::Stream(cause)) if cause.kind() == std::io::ErrorKind::BrokenPipe => Err(self.ended()),
            Err(error) => Err(error.into()),
        }
    }
}

impl Drop for EmulatedBoard {
    /// Switches the power off and waits until bank 2 and the report are written.
    fn drop(&mut self) {
        let Some(lockstep) = self.lockstep.take() else {
            // It has ended and was waited for.
            return;
        };
        // Its output stays open meanwhile: a request that is under way must not fail.
        let (_output, input) = lockstep.into_streams();
        drop(input);
        let ended = self.wait(KEEPING_TIMEOUT);
        if !ended.is_some_and(|status| status.success()) {
            // Nobody is left to take an error, but a bank 2 or a report that was not written must not go unnoticed.
            let how = ended.map_or_else(|| "had to be killed".to_owned(), |status| format!("ended with {status}"));
            // Nobody may be there any more to hear it.
            let mut terminal = std::io::stderr();
            let said = self.last_output();
            let _ = writeln!(terminal, "warning: when it was switched off, the emulated board {how}; it said: {said}");
        }
    }
}
