//! What the tests share: the image, and a chip in another process in lock step with a simulated arm.
#![allow(dead_code, reason = "each test file uses a part of it")]

use std::path::PathBuf;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::Arc;

use emulated_board::image::Image;
use sim::{FreeJoints, HOME, Lockstep, PlainLine, Plant, PlantConfig, Served, TICKS_PER_SECOND};

/// The image under test: `TACTUS_BOARD_IMAGE`, or the one that `cargo xtask build --board stm32h743` makes.
pub fn image_path() -> PathBuf {
    let built = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../target/images/arm-stm32h743.elf");
    let path = std::env::var_os("TACTUS_BOARD_IMAGE").map_or_else(built, PathBuf::from);
    assert!(path.exists(), "{}: no image; make it with `cargo xtask build --board stm32h743`", path.display());
    path
}

/// The image, read.
pub fn image() -> Arc<Image> {
    Arc::new(Image::read(&image_path()).expect("an image of this board"))
}

/// An arm that somebody switches on and activates, in the simplest world.
pub fn plant(seed: u64) -> Plant {
    let mut plant = Plant::new(PlantConfig { seed, ..PlantConfig::default() }, Box::new(FreeJoints::new(HOME)));
    plant.record_bus();
    plant
}

/// The chip in a process of its own.
pub struct Process {
    pub child: Child,
    pub lockstep: Lockstep<ChildStdout, ChildStdin>,
    pub plant: Plant,
}

impl Process {
    /// `serve` with these further arguments.
    pub fn start(arguments: &[&str]) -> Self {
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
        let mut plant = plant(1);
        plant.set_link_line(Box::new(PlainLine::default()));
        Self { child, lockstep, plant }
    }

    /// Serves until virtual time reaches `seconds`.
    pub fn run_to(&mut self, seconds: f64) {
        while (self.plant.now() as f64) < seconds * TICKS_PER_SECOND as f64 {
            match self.lockstep.serve_one(&mut self.plant) {
                Ok(Served::EndOfStream) => panic!("the emulator ended: {:?}", self.child.wait()),
                Ok(_) => {}
                Err(error) => panic!("{error}"),
            }
        }
    }

    /// Power off; the exit status.
    pub fn power_off(self) -> i32 {
        let Self { mut child, lockstep, .. } = self;
        drop(lockstep);
        child.wait().expect("the emulator ends").code().expect("a status")
    }
}
