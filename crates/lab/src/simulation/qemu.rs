//! The engine of `sim:`: the firmware image under QEMU, in lock step with the plant.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use flash::FlashChip;
use sim::{Lockstep, Plant, Ticks};

use super::processor::{SharedProcessor, out_of_reach};
use super::words::Words;
use super::{Execute, SimulationError};

/// The machine of the arm image.
pub(super) const ARM_MACHINE: &str = "mps2-an500";

/// The machine of the hand image: a Cortex-M3.
pub(super) const HAND_MACHINE: &str = "mps2-an385";

/// The machine, with everything QEMU would add by itself switched off.
///
/// `shift=3`: one instruction takes 8 ns of virtual time (125 million a second). `sleep=off`: virtual time never
/// waits for the wall clock. Together they make a run a function of the image and of what the simulator answers.
const OPTIONS: &[&str] = &[
    "-nodefaults",
    "-nic",
    "none",
    "-display",
    "none",
    "-serial",
    "none",
    "-monitor",
    "none",
    "-semihosting-config",
    "enable=on,target=native",
    "-icount",
    "shift=3,sleep=off",
    "-kernel",
];

/// A running QEMU and the streams to it.
pub(super) struct Qemu {
    child: Child,
    _processor: SharedProcessor,
    lockstep: Lockstep<BufReader<ChildStdout>, ChildStdin>,
    words: Words,
}

impl Qemu {
    /// Boots `image` on `machine` with this flash; the firmware's log goes to the file `log`.
    pub(super) fn spawn(
        machine: &str,
        image: &Path,
        log: Option<&Path>,
        flash: FlashChip,
    ) -> Result<Self, SimulationError> {
        let file = log.map(File::create).transpose().map_err(SimulationError::Log)?;
        let mut child = out_of_reach(&mut Command::new("qemu-system-arm"))
            .args(["-machine", machine])
            .args(OPTIONS)
            .arg(image)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(SimulationError::NoQemu)?;
        let (Some(to), Some(from), Some(stderr)) = (child.stdin.take(), child.stdout.take(), child.stderr.take())
        else {
            unreachable!("all three streams were asked for as pipes")
        };
        let words = Words::of(stderr, file);
        let processor = SharedProcessor::share(&child);
        let lockstep = Lockstep::new(BufReader::new(from), to).with_flash(flash);
        Ok(Self { child, _processor: processor, lockstep, words })
    }

    /// Why the firmware fell silent.
    fn ended(&mut self) -> SimulationError {
        let status = match self.child.wait() {
            Ok(status) => format!(" ({status})"),
            Err(_) => String::new(),
        };
        SimulationError::Ended { status, words: printable(&self.words.last()) }
    }
}

impl Execute for Qemu {
    fn advance(&mut self, plant: &mut Plant, _limit: Ticks) -> Result<Ticks, SimulationError> {
        // One exchange; the firmware itself decides how far it comes. It speaks at least once a slot, so a limit is
        // overrun by less than 1.2 ms of virtual time.
        match self.lockstep.serve_one(plant) {
            Ok(served) if !served.is_last() => Ok(plant.now()),
            Ok(_) => Err(self.ended()),
            Err(sim::LockstepError::Truncated { .. }) => Err(self.ended()),
            Err(sim::LockstepError::PowerFailed) => {
                // It waits for an answer that will not come; whoever asks on finds its stream ended.
                let _ = self.child.kill();
                Err(SimulationError::PowerFailed)
            }
            // Killed between its request and our answer.
            Err(sim::LockstepError::Stream(cause)) if cause.kind() == std::io::ErrorKind::BrokenPipe => {
                Err(self.ended())
            }
            Err(error) => Err(error.into()),
        }
    }
}

impl Drop for Qemu {
    fn drop(&mut self) {
        // While it waits for an answer QEMU ignores SIGTERM; `kill` sends SIGKILL.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The text in a log of binary frames: runs of at least four printable characters.
fn printable(bytes: &[u8]) -> String {
    let runs = bytes.split(|byte| !(b' '..=b'~').contains(byte)).filter(|run| run.len() >= 4);
    let text: Vec<_> = runs.map(|run| String::from_utf8_lossy(run).into_owned()).collect();
    if text.is_empty() { "none".to_owned() } else { text.join(" ") }
}
