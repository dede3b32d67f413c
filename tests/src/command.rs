//! The `tactus` command as a user or a script runs it.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process;

use assert_cmd::Command;
use assert_cmd::assert::Assert;
use serde_json::Value;

/// The command that `cargo xtask build` left for this build folder: `target/tools/tactus`.
///
/// # Panics
/// It has not been built.
#[must_use]
pub fn program() -> PathBuf {
    let test = std::env::current_exe().expect("a running test has a path");
    let folder = test.ancestors().nth(3).expect("tests lie in target/<profile>/deps");
    let program = folder.join("tools/tactus");
    assert!(program.is_file(), "there is no {}; `cargo xtask build` puts it there", program.display());
    program
}

/// Runs the command to its end.
///
/// # Panics
/// It cannot be started.
#[must_use = "the assertion says whether it succeeded"]
pub fn tactus(folder: &Path, arguments: &[&str]) -> Assert {
    Command::new(program())
        .current_dir(folder)
        .env("XDG_CONFIG_HOME", folder)
        .env_remove("TACTUS_DEVICE")
        .env_remove("TACTUS_TIMEOUT")
        .args(arguments)
        .assert()
}

/// Starts the command and leaves it running; it is killed when the value is dropped.
///
/// # Panics
/// It cannot be started.
#[must_use]
pub fn start(folder: &Path, arguments: &[&str]) -> Running {
    let child = process::Command::new(program())
        .current_dir(folder)
        .env("XDG_CONFIG_HOME", folder)
        .env_remove("TACTUS_DEVICE")
        .args(arguments)
        .stdin(process::Stdio::null())
        .stdout(process::Stdio::piped())
        .stderr(process::Stdio::piped())
        .spawn();
    Running(Some(child.expect("tactus can be started")))
}

/// A command that runs beside the test.
pub struct Running(Option<process::Child>);

impl Running {
    /// Number of the process.
    #[must_use]
    pub fn id(&self) -> u32 {
        self.0.as_ref().map_or(0, process::Child::id)
    }

    /// Waits until the command says these words on stderr; what it said until then is not in [`Running::finish`]'s
    /// output.
    ///
    /// # Panics
    /// It ends without having said them.
    pub fn hear(&mut self, words: &str) {
        let stderr = self.0.as_mut().and_then(|child| child.stderr.as_mut()).expect("stderr is a pipe");
        let mut said = Vec::new();
        let mut byte = [0];
        // Byte by byte, so that nothing that comes later is taken away.
        while !String::from_utf8_lossy(&said).contains(words) {
            let count = stderr.read(&mut byte).expect("stderr can be read");
            assert!(count > 0, "the command ended with: {}", String::from_utf8_lossy(&said));
            said.push(byte[0]);
        }
    }

    /// The word that follows on stderr.
    ///
    /// # Panics
    /// It ends before.
    pub fn next_word(&mut self) -> String {
        let stderr = self.0.as_mut().and_then(|child| child.stderr.as_mut()).expect("stderr is a pipe");
        let (mut word, mut byte) = (Vec::new(), [0]);
        while stderr.read(&mut byte).expect("stderr can be read") > 0 && byte[0] > b' ' {
            word.push(byte[0]);
        }
        String::from_utf8(word).expect("text")
    }

    /// Presses Ctrl-C.
    ///
    /// # Panics
    /// There is no `kill`.
    pub fn interrupt(&self) {
        signal(self.id(), "-INT");
    }

    /// Waits for the end and gives all output.
    ///
    /// # Panics
    /// The system refuses to wait.
    #[must_use]
    pub fn finish(mut self) -> process::Output {
        let child = self.0.take().expect("only this takes it");
        child.wait_with_output().expect("a child can be waited for")
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if let Some(mut child) = self.0.take() {
            // It may have ended already.
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// Sends a signal to one process.
///
/// # Panics
/// There is no `kill`, or no such process.
pub fn signal(process: u32, signal: &str) {
    let status = process::Command::new("kill").args([signal, &process.to_string()]).status();
    assert!(status.expect("kill is part of every system").success(), "no process {process}");
}

/// The stdout of a command.
#[must_use]
pub fn stdout(assert: &Assert) -> String {
    String::from_utf8_lossy(&assert.get_output().stdout).into_owned()
}

/// The stderr of a command.
#[must_use]
pub fn stderr(assert: &Assert) -> String {
    String::from_utf8_lossy(&assert.get_output().stderr).into_owned()
}

/// The one JSON object that stdout holds, and nothing else.
///
/// # Panics
/// There is anything else on stdout.
#[track_caller]
#[must_use]
pub fn one_object(stdout: &[u8]) -> Value {
    let text = String::from_utf8_lossy(stdout);
    assert_eq!(text.lines().count(), 1, "one line is expected on stdout, not: {text}");
    let value: Value = serde_json::from_str(&text).expect("JSON on stdout");
    assert!(value.is_object(), "{text}");
    value
}
