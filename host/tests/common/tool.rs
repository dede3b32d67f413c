//! The command itself, as tests start it: in a folder of its own, without the settings of whoever runs them.

use std::path::Path;
use std::process::{Child, Command, Output, Stdio};

use assert_cmd::assert::Assert;
use serde_json::Value;

use crate::common;

/// The words of a command line.
pub(crate) trait Words {
    /// Each of them.
    fn words(&self) -> Vec<&str>;
}

/// A line with blanks between its words.
impl Words for str {
    fn words(&self) -> Vec<&str> {
        self.split_whitespace().collect()
    }
}

impl Words for String {
    fn words(&self) -> Vec<&str> {
        self.as_str().words()
    }
}

/// Words that may have blanks.
impl Words for [&str] {
    fn words(&self) -> Vec<&str> {
        self.to_vec()
    }
}

impl<const COUNT: usize> Words for [&str; COUNT] {
    fn words(&self) -> Vec<&str> {
        self.to_vec()
    }
}

impl Words for Vec<&str> {
    fn words(&self) -> Vec<&str> {
        self.clone()
    }
}

/// The command with these words. Nobody says anything to it.
pub(crate) fn command(folder: &Path, line: &(impl Words + ?Sized)) -> Command {
    prepared(Command::new(env!("CARGO_BIN_EXE_tactus")), folder, line)
}

/// The same, heeding a signal: what a test program starts ignores Ctrl-C where the test itself was started by a shell
/// in the background.
pub(crate) fn heeding(signal: &str, folder: &Path, line: &(impl Words + ?Sized)) -> Command {
    let mut command = Command::new("env");
    command.arg(format!("--default-signal={signal}")).arg(env!("CARGO_BIN_EXE_tactus"));
    prepared(command, folder, line)
}

/// The same, ignoring a signal, as what `nohup` starts ignores that of a terminal that is closed.
pub(crate) fn ignoring(signal: &str, folder: &Path, line: &(impl Words + ?Sized)) -> Command {
    let mut command = Command::new("env");
    command.arg(format!("--ignore-signal={signal}")).arg(env!("CARGO_BIN_EXE_tactus"));
    prepared(command, folder, line)
}

fn prepared(mut command: Command, folder: &Path, line: &(impl Words + ?Sized)) -> Command {
    command.current_dir(folder).env("XDG_CONFIG_HOME", folder);
    for name in ["TACTUS_DEVICE", "TACTUS_TIMEOUT", "TACTUS_SECRET_FILE"] {
        command.env_remove(name);
    }
    command.args(line.words()).stdin(Stdio::null());
    command
}

/// All that it says and its exit code.
pub(crate) fn tactus(folder: &Path, line: &(impl Words + ?Sized)) -> Output {
    command(folder, line).output().unwrap()
}

/// The same, to be judged.
pub(crate) fn judged(folder: &Path, line: &(impl Words + ?Sized)) -> Assert {
    judge(command(folder, line))
}

/// The end of a command, to be judged.
pub(crate) fn judge(command: Command) -> Assert {
    assert_cmd::Command::from_std(command).assert()
}

/// The words that it writes for people.
pub(crate) fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Its data, as text.
pub(crate) fn stdout(assert: &Assert) -> String {
    String::from_utf8(assert.get_output().stdout.clone()).unwrap()
}

/// Its words, as text.
pub(crate) fn stderr(assert: &Assert) -> String {
    String::from_utf8(assert.get_output().stderr.clone()).unwrap()
}

/// A command that has to succeed.
#[track_caller]
pub(crate) fn succeeds(folder: &Path, line: &(impl Words + ?Sized)) -> Output {
    let output = tactus(folder, line);
    assert!(output.status.success(), "{:?}: {}", line.words(), said(&output));
    output
}

/// The failure of a command.
pub(crate) struct Refusal {
    /// Its exit code.
    pub(crate) exit: i32,
    /// Code of the error, such as `E631`.
    pub(crate) code: String,
    /// Its words.
    pub(crate) message: String,
    /// The remedy; empty if there is none.
    pub(crate) help: String,
}

/// A command that has to fail, as a script hears of it: the line has `--json`.
#[track_caller]
pub(crate) fn refusal(folder: &Path, line: &str) -> Refusal {
    let output = tactus(folder, line);
    assert!(!output.status.success(), "{line}");
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    let word = |key: &str| told["error"][key].as_str().unwrap_or_default().to_owned();
    Refusal { exit: output.status.code().unwrap(), code: word("code"), message: word("message"), help: word("help") }
}

/// A folder with a demonstration of so many seconds, `demo.csv`, and the primitive that is learned from it,
/// `reach.toml`.
pub(crate) fn learned(duration: f64) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    common::demonstration(folder.path(), duration);
    succeeds(folder.path(), "learn demo.csv -o reach.toml");
    folder
}

/// The names in a folder, sorted.
pub(crate) fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// A program that ends with its test, whatever becomes of that.
pub(crate) struct Ended(pub(crate) Child);

impl Drop for Ended {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
