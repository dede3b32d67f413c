//! Terminals and the programs that were started in them: a closed one ends what it showed, its Ctrl-Z gives it to the
//! shell for a while, and its Ctrl-C reaches those that know how to stop an arm.

#![cfg(target_os = "linux")]

use std::fs::File;
use std::io::{Read as _, Write as _, read_to_string};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::mpsc;
use std::time::Duration;

/// Longest wait for a program that has nothing to wait for.
const TIMEOUT: Duration = Duration::from_secs(30);

/// Terminals that are closed. One in fifteen was closed while the library for keys read it, which then never returned:
/// the monitor took a whole processor until somebody killed it.
const TERMINALS: usize = 40;

/// Shows an arm in a terminal, closes that, and waits for the end of the monitor; false if it goes on.
fn ends_with_its_terminal(folder: &Path) -> bool {
    // Only the monitor holds the other end of this pipe.
    assert!(Command::new("mkfifo").arg(folder.join("alive")).status().unwrap().success());
    let line = format!(
        "stty rows 24 cols 80; echo $$ > pid; exec {} --device sil:world=simple monitor 2> alive",
        env!("CARGO_BIN_EXE_tactus")
    );
    let mut terminal = Command::new("script");
    terminal.args(["-qfc", &line, "/dev/null"]).current_dir(folder).env("XDG_CONFIG_HOME", folder);
    let terminal = terminal.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn();
    let mut terminal = terminal.expect("`script` has to be installed: package bsdutils");
    let alive = folder.join("alive");
    let (sender, ended) = mpsc::channel();
    std::thread::spawn(move || sender.send(read_to_string(File::open(alive).unwrap())));
    until(terminal.stdout.as_mut().unwrap(), "joints");
    terminal.kill().unwrap();
    terminal.wait().unwrap();
    let has_ended = ended.recv_timeout(TIMEOUT).is_ok();
    if !has_ended {
        let process = std::fs::read_to_string(folder.join("pid")).unwrap();
        let _ = Command::new("kill").args(["-9", process.trim()]).status();
    }
    has_ended
}

/// Runs this line of a shell in a terminal of its own, for `TIMEOUT` at most; with what is typed and shown there.
fn in_a_terminal(folder: &Path, line: &str) -> (Child, ChildStdin, ChildStdout) {
    let mut terminal = Command::new("timeout");
    terminal.args(["--foreground", &TIMEOUT.as_secs().to_string(), "script", "-qfc", line, "/dev/null"]);
    terminal.current_dir(folder).env("XDG_CONFIG_HOME", folder).env("SHELL", "/bin/sh");
    let terminal = terminal.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn();
    let mut terminal = terminal.expect("`script` has to be installed: package bsdutils");
    let (typed, shown) = (terminal.stdin.take().unwrap(), terminal.stdout.take().unwrap());
    (terminal, typed, shown)
}

/// Reads what a terminal shows until these words have come.
fn until(shown: &mut ChildStdout, words: &str) {
    let (mut seen, mut bytes) = (Vec::new(), [0; 4096]);
    while !String::from_utf8_lossy(&seen).contains(words) {
        let count = shown.read(&mut bytes).unwrap();
        assert!(count > 0, "not '{words}': {}", String::from_utf8_lossy(&seen));
        seen.extend_from_slice(&bytes[..count]);
    }
}

/// Waits until every thread of the only child of this process is stopped. The shell has the terminal before: a thread
/// that waits in `read` still gets what is typed until its stop has reached it, and no person types so soon.
fn until_its_child_is_stopped(process: &str) {
    let child = std::fs::read_to_string(format!("/proc/{process}/task/{process}/children")).unwrap();
    let tasks = format!("/proc/{}/task", child.trim());
    let is_stopped = |thread: std::io::Result<std::fs::DirEntry>| {
        let told = std::fs::read_to_string(thread.unwrap().path().join("stat")).unwrap();
        told.rsplit_once(')').unwrap().1.trim_start().starts_with('T')
    };
    while !std::fs::read_dir(&tasks).unwrap().all(is_stopped) {
        std::thread::yield_now();
    }
}

/// Ctrl-Z did nothing in the monitor; stopped from outside, it drew later only what had changed. Whatever has started
/// the monitor (`cargo run`, here a shell) is stopped with it: else nobody gets the terminal.
#[test]
fn a_monitor_that_is_suspended_gives_the_terminal_to_the_shell_and_draws_all_of_it_when_it_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let line = format!(
        "stty rows 24 cols 80; set -m; sh -c 'echo $$ > pid; {} --device sil:world=simple monitor; :'; \
         echo shell $((6 * 7)); read line; fg; echo shell $((8 * 8)); read line; fg; echo shell $((9 * 9))",
        env!("CARGO_BIN_EXE_tactus")
    );
    let (mut terminal, mut typed, mut shown) = in_a_terminal(folder.path(), &line);
    until(&mut shown, "joints");
    let process = std::fs::read_to_string(folder.path().join("pid")).unwrap();
    typed.write_all(b"\x1a").unwrap();
    until(&mut shown, "shell 42");
    until_its_child_is_stopped(process.trim());
    typed.write_all(b"\n").unwrap();
    // What never changes is drawn once more.
    until(&mut shown, "joints");
    assert!(Command::new("kill").args(["-STOP", "--", &format!("-{}", process.trim())]).status().unwrap().success());
    until(&mut shown, "shell 64");
    until_its_child_is_stopped(process.trim());
    typed.write_all(b"\n").unwrap();
    until(&mut shown, "joints");
    typed.write_all(b"Q").unwrap();
    until(&mut shown, "shell 81");
    terminal.wait().unwrap();
}

/// QEMU ended with the first Ctrl-C, before the arm in it had been stopped: `tactus run` ended with E102.
#[test]
fn ctrl_c_does_not_reach_the_emulator_of_a_simulated_arm() {
    use std::os::unix::fs::PermissionsExt as _;
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::create_dir(at.join("bin")).unwrap();
    // Tells its group and that of the program which started it; what a terminal sends goes to a group.
    let emulator = at.join("bin/qemu-system-arm");
    let group = |process: &str| format!("awk '{{ print $5 }}' /proc/{process}/stat");
    let script = format!("#!/bin/sh\n{} > emulator\n{} > tool\n", group("$$"), group("$PPID"));
    std::fs::write(&emulator, script).unwrap();
    std::fs::set_permissions(&emulator, std::fs::Permissions::from_mode(0o755)).unwrap();
    std::fs::write(at.join("arm.elf"), "").unwrap();
    let path = format!("{}:{}", at.join("bin").display(), std::env::var("PATH").unwrap());
    let mut tactus = Command::new(env!("CARGO_BIN_EXE_tactus"));
    tactus.current_dir(at).env("PATH", path).env("TACTUS_IMAGE", at.join("arm.elf")).env("XDG_CONFIG_HOME", at);
    tactus.args(["--device", "sim:world=simple", "list"]).stdin(Stdio::null());
    let said = String::from_utf8_lossy(&tactus.output().unwrap().stderr).into_owned();
    let told = |name: &str| std::fs::read_to_string(at.join(name)).unwrap_or_else(|_| panic!("no emulator: {said}"));
    let (emulator, tool) = (told("emulator"), told("tool"));
    assert!(emulator.trim().parse::<u32>().is_ok() && tool.trim().parse::<u32>().is_ok(), "{emulator}{tool}");
    assert_ne!(emulator, tool, "they get the same signals");
}

/// Seen: an Enter that was pressed while the arm started ended the demonstration at its first sample, and the command
/// with success: with `--force` the demonstration of before was gone.
///
/// The change that makes it fail: whatever is typed before the movement is shown is kept until then.
#[test]
fn an_enter_of_before_the_demonstration_does_not_end_it() {
    let folder = tempfile::tempdir().unwrap();
    let line = format!(
        "stty rows 24 cols 120; echo begun; exec {} --device sil:world=simple teach --at-home -o demo.csv",
        env!("CARGO_BIN_EXE_tactus")
    );
    let (mut terminal, mut typed, mut shown) = in_a_terminal(folder.path(), &line);
    until(&mut shown, "begun");
    typed.write_all(b"\n").unwrap();
    until(&mut shown, "press Enter");
    std::thread::sleep(Duration::from_millis(500));
    typed.write_all(b"\n").unwrap();
    until(&mut shown, "samples");
    terminal.wait().unwrap();
    let samples = std::fs::read_to_string(folder.path().join("demo.csv")).unwrap().lines().count();
    assert!(samples > 60, "{samples} lines");
}

#[test]
fn a_monitor_ends_with_its_terminal() {
    for terminal in 0..TERMINALS {
        let folder = tempfile::tempdir().unwrap();
        assert!(ends_with_its_terminal(folder.path()), "terminal {terminal}: the monitor goes on");
    }
}
