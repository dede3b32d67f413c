//! A simulated arm in a process of its own, with a fault script, and commands to it.

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use crate::tool::{self, Ended};

/// The program with this command line, at the arm that is served in the folder.
pub(crate) fn command(folder: &Path, line: &str) -> Command {
    let mut command = tool::command(folder, line);
    command.env("TACTUS_DEVICE", "unix:arm.sock");
    command
}

/// Its output.
pub(crate) fn tactus(folder: &Path, line: &str) -> Output {
    command(folder, line).output().unwrap()
}

/// The arm; it ends with the test.
pub(crate) struct Arm(#[expect(dead_code, reason = "it is kept only to end")] Ended);

impl Arm {
    /// Serves an arm in the folder, to which this script happens.
    pub(crate) fn start(folder: &Path, script: &str) -> Arm {
        std::fs::write(folder.join("script.toml"), script).unwrap();
        let serve = "--device sil:world=simple sim --listen unix:arm.sock --faults script.toml";
        let program = command(folder, serve).stdout(Stdio::null()).stderr(Stdio::null()).spawn();
        let arm = Arm(Ended(program.unwrap()));
        let started = Instant::now();
        while !folder.join("arm.sock").exists() {
            assert!(started.elapsed() < Duration::from_secs(20), "the simulated arm does not listen");
            std::thread::sleep(Duration::from_millis(20));
        }
        arm
    }
}
