//! A simulated arm in a process of its own, with a fault script, and commands to it.

use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// The program with this command line, at the arm that is served in the folder.
fn command(folder: &Path, line: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tactus"));
    command.current_dir(folder).env("TACTUS_DEVICE", "unix:arm.sock").stdin(Stdio::null());
    command.args(line.split_whitespace());
    command
}

/// Its output.
pub(crate) fn tactus(folder: &Path, line: &str) -> Output {
    command(folder, line).output().unwrap()
}

/// The arm; it ends with the test.
pub(crate) struct Arm(Child);

impl Arm {
    /// Serves an arm in the folder, to which this script happens.
    pub(crate) fn start(folder: &Path, script: &str) -> Arm {
        std::fs::write(folder.join("script.toml"), script).unwrap();
        let serve = "--device sil:world=simple sim --listen unix:arm.sock --faults script.toml";
        let arm = Arm(command(folder, serve).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap());
        let started = Instant::now();
        while !folder.join("arm.sock").exists() {
            assert!(started.elapsed() < Duration::from_secs(20), "the simulated arm does not listen");
            std::thread::sleep(Duration::from_millis(20));
        }
        arm
    }
}

impl Drop for Arm {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
