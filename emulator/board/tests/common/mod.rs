//! Common parts of the tests: the image, an arm, a chip in this process or in another, and a reader of the log.
#![allow(dead_code, reason = "each test file uses a part of it")]

use std::path::PathBuf;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::{Arc, Mutex};

use emulated_board::host::{Inquirer, READY, SharedLearned};
use emulated_board::image::Image;
use emulated_board::run::run;
use emulated_board::setup::{Outcome, Setup};
use emulated_board::world::{Host, InProcess};
use puck::{Action, CanFrame, Group, MotorMode, Node, PropertyId, PuckTorque, Request, set, zero_torques};
use sim::{
    FreeJoints, HOME, Lockstep, OperatorConfig, Passage, PendantAction, PlainLine, Plant, PlantConfig, Served,
    TICKS_PER_MICROSECOND, TICKS_PER_SECOND,
};

/// The image under test: `TACTUS_BOARD_IMAGE`, or the one that `cargo xtask build --board stm32h743` makes.
pub(crate) fn image_path() -> PathBuf {
    let built = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../target/images/arm-stm32h743.elf");
    let path = std::env::var_os("TACTUS_BOARD_IMAGE").map_or_else(built, PathBuf::from);
    assert!(path.exists(), "{}: no image; make it with `cargo xtask build --board stm32h743`", path.display());
    path
}

/// The image, read.
pub(crate) fn image() -> Arc<Image> {
    Arc::new(Image::read(&image_path()).expect("an image of this board"))
}

/// An arm in the simplest world that was up before the board came on, and that somebody activates at once: it is ready
/// after 0.57 s, and one that has yet to be switched on, as in `check`, after 2.13 s.
pub(crate) fn plant() -> Plant {
    with_operator(OperatorConfig::prompt())
}

/// The same with a person who does this.
fn with_operator(operator: OperatorConfig) -> Plant {
    Plant::new(PlantConfig { started: true, operator, ..PlantConfig::default() }, Box::new(FreeJoints::new(HOME)))
}

/// A host that asks, and keeps every frame of the arm's bus.
struct Recorder {
    inquirer: Inquirer,
    passages: Arc<Mutex<Vec<Passage>>>,
}

impl Host for Recorder {
    fn talk(&mut self, now: u64, bytes: &[u8]) -> Vec<u8> {
        self.inquirer.talk(now, bytes)
    }

    fn see(&mut self, passage: &Passage) {
        self.inquirer.see(passage);
        self.passages.lock().unwrap().push(*passage);
    }
}

/// A run in this process and what was seen of it.
pub(crate) struct Story {
    pub(crate) outcome: Outcome,
    pub(crate) learned: SharedLearned,
    pub(crate) passages: Vec<Passage>,
}

impl Story {
    /// Frames of the chip that began from `us` on, with their times in us.
    pub(crate) fn sent_since(&self, us: u64) -> Vec<(u64, CanFrame)> {
        self.passages
            .iter()
            .filter(|passage| passage.sender == Node::HOST && passage.start >= us * TICKS_PER_MICROSECOND)
            .map(|passage| (passage.start / TICKS_PER_MICROSECOND, passage.frame))
            .collect()
    }

    /// Times of the restarts, us, with their causes.
    pub(crate) fn resets(&self) -> Vec<(u64, &str)> {
        self.outcome.measured.resets.iter().map(|(at, cause)| (at / 1000, cause.as_str())).collect()
    }

    /// True if the log holds this text.
    pub(crate) fn log_says(&self, text: &str) -> bool {
        self.log().iter().any(|line| line.contains(text))
    }

    /// The readable part of the log.
    pub(crate) fn log(&self) -> Vec<String> {
        self.outcome.log.split(|byte| *byte == 0).map(readable).collect()
    }

    /// True if the start-up of the arm's bus has come to its end again; a person activates the arm, not the image.
    pub(crate) fn is_up(&self) -> bool {
        let learned = self.learned.lock();
        learned.status.as_ref().is_some_and(|status| matches!(status.startup_stage, WAITING_FOR_ACTIVE | READY))
    }
}

/// A stage of the start-up: everything but the person has been waited for.
const WAITING_FOR_ACTIVE: u8 = 9;

/// Runs the image for these seconds.
pub(crate) fn tell(seconds: f64, setup: Setup) -> Story {
    tell_to(seconds, setup, plant(), |inquirer| inquirer)
}

/// The same with faults, and with a host that has the arm hold as soon as it can.
pub(crate) fn tell_holding(seconds: f64, faults: &[String]) -> Story {
    let faults = faults.iter().map(|text| text.parse().expect("a fault")).collect();
    tell_to(seconds, Setup { faults, ..Setup::default() }, plant(), Inquirer::holding)
}

/// The same, and the host has weights kept.
pub(crate) fn tell_keeping(seconds: f64, faults: &[String]) -> Story {
    let faults = faults.iter().map(|text| text.parse().expect("a fault")).collect();
    tell_to(seconds, Setup { faults, ..Setup::default() }, plant(), Inquirer::keeping)
}

/// The same, and a person presses Shift-Idle and Shift-Activate again at this time.
pub(crate) fn tell_armed_again(seconds: f64, setup: Setup, again_us: u64) -> Story {
    let at = again_us * TICKS_PER_MICROSECOND;
    let later = at + TICKS_PER_SECOND / 10;
    let script = vec![(at, PendantAction::ShiftIdle), (later, PendantAction::ShiftActivate)];
    let plant = with_operator(OperatorConfig { script, ..OperatorConfig::prompt() });
    tell_to(seconds, setup, plant, Inquirer::holding)
}

/// True if the frame makes a joint pull.
pub(crate) fn is_torque(frame: &CanFrame) -> bool {
    let Ok(Request { action: Action::PackedTorques { torques, .. }, .. }) = Request::decode(frame) else {
        return false;
    };
    torques.iter().any(|torque| *torque != PuckTorque::ZERO)
}

/// The same for any host.
fn tell_to(seconds: f64, setup: Setup, plant: Plant, host: impl Fn(Inquirer) -> Inquirer) -> Story {
    let image = image();
    let learned = SharedLearned::default();
    let passages = Arc::new(Mutex::new(Vec::new()));
    let inquirer = host(Inquirer::new(image.model_hash, learned.clone()));
    let world = InProcess::new(plant, Box::new(Recorder { inquirer, passages: passages.clone() }));
    let setup = Setup { until: Some((seconds * 1e9) as u64), ..setup };
    let outcome = run(&image, &setup, Box::new(world)).expect("the emulation runs");
    assert_eq!(outcome.cut_short, None, "the run ended early");
    let passages = std::mem::take(&mut *passages.lock().unwrap());
    Story { outcome, learned, passages }
}

/// The same, with faults.
pub(crate) fn tell_with(seconds: f64, faults: &[&str]) -> Story {
    let faults = faults.iter().map(|text| text.parse().expect("a fault")).collect();
    tell(seconds, Setup { faults, ..Setup::default() })
}

/// Zero torques and idle to arm and hand: what leaves when the image cannot go on, and when it begins.
pub(crate) fn safe_frames() -> [CanFrame; 4] {
    let [arm, wrist] = zero_torques();
    let idle = MotorMode::Idle.value();
    [arm, wrist, set(Group::ARM, PropertyId::MODE, idle), set(Group::HAND, PropertyId::MODE, idle)]
}

/// One frame of the log without its packing (rzCOBS: groups of seven bytes with a map of their zeros, read from the
/// end), as far as it is text.
fn readable(frame: &[u8]) -> String {
    let mut rest = frame.iter().rev().copied();
    let mut bytes = Vec::new();
    while let Some(head) = rest.next() {
        match head {
            0 => break,
            0x01..=0x7F => {
                bytes.extend((0..7).map(|bit| if head & 1 << (6 - bit) == 0 { rest.next().unwrap_or(0) } else { 0 }))
            }
            0x80..=0xFE => {
                bytes.push(0);
                bytes.extend((0..(head & 0x7F) + 7).filter_map(|_| rest.next()));
            }
            0xFF => bytes.extend((0..134).filter_map(|_| rest.next())),
        }
    }
    bytes.reverse();
    String::from_utf8_lossy(&bytes).into_owned()
}

/// The chip in a process of its own.
pub(crate) struct Process {
    pub(crate) child: Child,
    pub(crate) lockstep: Lockstep<ChildStdout, ChildStdin>,
    pub(crate) plant: Plant,
}

impl Process {
    /// `serve` with these further arguments.
    pub(crate) fn start(arguments: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_emulated-board"))
            .arg("serve")
            .arg("--image")
            .arg(image_path())
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the emulator starts");
        let lockstep = Lockstep::new(child.stdout.take().unwrap(), child.stdin.take().unwrap());
        let mut plant = plant();
        plant.set_link_line(Box::new(PlainLine::default()));
        Self { child, lockstep, plant }
    }

    /// Serves until virtual time reaches `seconds`.
    pub(crate) fn run_to(&mut self, seconds: f64) {
        while (self.plant.now() as f64) < seconds * TICKS_PER_SECOND as f64 {
            match self.lockstep.serve_one(&mut self.plant) {
                Ok(Served::EndOfStream) => panic!("the emulator ended: {:?}", self.child.wait()),
                Ok(_) => {}
                Err(error) => panic!("{error}"),
            }
        }
    }

    /// Power off; the exit status.
    pub(crate) fn power_off(self) -> i32 {
        let Self { mut child, lockstep, .. } = self;
        drop(lockstep);
        child.wait().expect("the emulator ends").code().expect("a status")
    }
}
