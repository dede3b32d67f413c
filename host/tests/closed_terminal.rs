//! A terminal that is closed ends what was shown in it.

#![cfg(target_os = "linux")]

use std::fs::File;
use std::io::{Read as _, read_to_string};
use std::path::Path;
use std::process::{Command, Stdio};
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
    let mut terminal = terminal.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let alive = folder.join("alive");
    let (sender, ended) = mpsc::channel();
    std::thread::spawn(move || sender.send(read_to_string(File::open(alive).unwrap())));
    let mut shown = terminal.stdout.take().unwrap();
    let (mut seen, mut bytes) = (Vec::new(), [0; 4096]);
    while !String::from_utf8_lossy(&seen).contains("joints") {
        let count = shown.read(&mut bytes).unwrap();
        assert!(count > 0, "{}", String::from_utf8_lossy(&seen));
        seen.extend_from_slice(&bytes[..count]);
    }
    terminal.kill().unwrap();
    terminal.wait().unwrap();
    let has_ended = ended.recv_timeout(TIMEOUT).is_ok();
    if !has_ended {
        let process = std::fs::read_to_string(folder.join("pid")).unwrap();
        let _ = Command::new("kill").args(["-9", process.trim()]).status();
    }
    has_ended
}

#[test]
fn a_monitor_ends_with_its_terminal() {
    for terminal in 0..TERMINALS {
        let folder = tempfile::tempdir().unwrap();
        assert!(ends_with_its_terminal(folder.path()), "terminal {terminal}: the monitor goes on");
    }
}
