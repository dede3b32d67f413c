//! Says what happens and runs it: steps with elapsed time, commands whose failure names the cause and how to repeat it.

use std::ffi::OsStr;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

/// The moment the program started; every announcement shows the time since then.
static START: OnceLock<Instant> = OnceLock::new();

/// Starts the clock of the announcements. Called once, first thing in `main`.
pub(crate) fn start_clock() {
    START.get_or_init(Instant::now);
}

/// Time since [`start_clock`].
pub(crate) fn elapsed() -> Duration {
    START.get_or_init(Instant::now).elapsed()
}

/// Announces a step on stderr (stdout belongs to data: tables, JSON), with the time and the processor time until then.
pub(crate) fn step(text: &str) {
    let processors =
        processor_time().map_or_else(String::new, |time| format!(", {:5.0} s of work", time.as_secs_f64()));
    eprintln!("[{:7.1} s{processors}] {text}", elapsed().as_secs_f64());
}

/// Processor time of all programs that were started here and have ended; on Linux only.
fn processor_time() -> Option<Duration> {
    // Linux counts it in hundredths of a second for programs, whatever it uses itself (proc(5): cutime, cstime).
    const TICK: Duration = Duration::from_millis(10);
    let told = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The name of this program comes before, in parentheses, and may contain anything.
    let fields: Vec<&str> = told.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = |index: usize| fields.get(index)?.parse::<u32>().ok();
    Some(TICK * (ticks(13)? + ticks(14)?))
}

/// Adds a detail below the last step.
pub(crate) fn note(text: &str) {
    eprintln!("            {text}");
}

/// Root folder of the workspace.
pub(crate) fn root() -> PathBuf {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR"));
    manifest.parent().unwrap_or(manifest).to_path_buf()
}

/// Build folder of the workspace: `CARGO_TARGET_DIR` if set, else `target/` at the root.
pub(crate) fn target_dir() -> PathBuf {
    match std::env::var_os("CARGO_TARGET_DIR") {
        Some(folder) => root().join(folder),
        None => root().join("target"),
    }
}

/// `cargo` as the user started it (so that a `+toolchain` choice stays in force).
pub(crate) fn cargo() -> Command {
    let program = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(program);
    command.current_dir(root());
    command
}

/// The command as a line a person can paste into a shell.
pub(crate) fn line(command: &Command) -> String {
    let mut text = String::new();
    if let Some(folder) = command.get_current_dir() {
        let _ = write!(text, "cd {} && ", quoted(folder.as_os_str()));
    }
    for (name, value) in command.get_envs() {
        if let Some(value) = value {
            let _ = write!(text, "{}={} ", name.to_string_lossy(), quoted(value));
        }
    }
    let _ = write!(text, "{}", quoted(command.get_program()));
    for argument in command.get_args() {
        let _ = write!(text, " {}", quoted(argument));
    }
    text
}

fn quoted(word: &OsStr) -> String {
    let word = word.to_string_lossy();
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.into_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

/// Runs a command with our own terminal; an unsuccessful end is an error that says how to repeat it.
pub(crate) fn run(command: &mut Command) -> Result<()> {
    let status = command.status().with_context(|| format!("cannot start: {}", line(command)))?;
    check(command, status)
}

/// Runs a command without showing its output, and returns its stdout.
pub(crate) fn capture(command: &mut Command) -> Result<String> {
    let output = command.stdin(Stdio::null()).output().with_context(|| format!("cannot start: {}", line(command)))?;
    if !output.status.success() {
        eprint!("{}", String::from_utf8_lossy(&output.stderr));
    }
    check(command, output.status)?;
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Runs a command and says whether it succeeded; not being able to start it counts as failure.
pub(crate) fn succeeds(command: &mut Command) -> bool {
    command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}

/// Runs a command for at most `limit`; a command that takes longer is killed and counts as failed.
pub(crate) fn succeeds_within(command: &mut Command, limit: Duration) -> bool {
    let Ok(mut child) = command.stdin(Stdio::null()).spawn() else {
        return false;
    };
    let end = Instant::now() + limit;
    loop {
        match child.try_wait() {
            Ok(Some(status)) => return status.success(),
            Ok(None) if Instant::now() < end => std::thread::sleep(Duration::from_millis(50)),
            _ => {
                let _ = child.kill();
                let _ = child.wait();
                return false;
            }
        }
    }
}

fn check(command: &Command, status: ExitStatus) -> Result<()> {
    if !status.success() {
        bail!("{status}{}\n  to repeat: {}", full_disk(), line(command));
    }
    Ok(())
}

/// Space below which a failure is probably the disk's: one linked test takes 0.1 GB.
const SCARCE: u64 = 500 << 20;

/// Says that the disk of the build folder is full, with the command that frees it; empty while there is room.
fn full_disk() -> String {
    match free_space() {
        Some(free) if free < SCARCE => {
            format!("\n  only {} MB are free for the build folder; to make room: cargo clean", free >> 20)
        }
        _ => String::new(),
    }
}

/// Free space for the build folder, bytes; nothing where `df` cannot tell.
pub(crate) fn free_space() -> Option<u64> {
    kilobytes(Command::new("df").arg("-Pk").arg(root()), 1, 3)
}

/// Space that a folder takes, bytes; nothing where `du` cannot tell.
pub(crate) fn size_of(folder: &Path) -> Option<u64> {
    kilobytes(Command::new("du").arg("-sk").arg(folder), 0, 0)
}

/// A number of kilobytes that a command prints, in bytes.
fn kilobytes(command: &mut Command, line: usize, column: usize) -> Option<u64> {
    let output = command.stdin(Stdio::null()).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    let kilobytes: u64 = text.lines().nth(line)?.split_whitespace().nth(column)?.parse().ok()?;
    Some(kilobytes << 10)
}
