//! A newcomer's first hour: words that mislead, files that are left lying about, and logs that end too early.
#![cfg(unix)]

#[path = "../../crates/lab/tests/common/mod.rs"]
mod common;

use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

fn command(folder: &Path, line: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tactus"));
    command.current_dir(folder).env("XDG_CONFIG_HOME", folder).env_remove("TACTUS_DEVICE");
    command.args(line.split_whitespace()).stdin(Stdio::null());
    command
}

fn tactus(folder: &Path, line: &str) -> Output {
    command(folder, line).output().unwrap()
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// The program under a shell that lets no file grow: it stands for a full disk.
fn without_room(folder: &Path, line: &str) -> Output {
    let mut command = Command::new("sh");
    command.args(["-c", &format!("ulimit -f 0; exec \"$0\" {line}"), env!("CARGO_BIN_EXE_tactus")]);
    command.current_dir(folder).env_remove("TACTUS_DEVICE").stdin(Stdio::null()).output().unwrap()
}

#[test]
fn a_primitive_that_a_file_keeps_is_not_said_to_be_lost() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    common::demonstration(folder, 2.0);
    assert!(tactus(folder, "learn demo.csv -o reach.toml").status.success());
    let lost = "this simulated device ends with the command";
    let kept = tactus(folder, "--device sil:world=simple,flash=arm.flash upload reach.toml");
    assert!(kept.status.success() && !said(&kept).contains(lost), "{}", said(&kept));
    let forgotten = tactus(folder, "--device sil:world=simple upload reach.toml");
    assert!(forgotten.status.success() && said(&forgotten).contains(lost), "{}", said(&forgotten));
}

#[test]
fn a_log_of_the_buses_without_its_last_lines_is_no_success() {
    let folder = tempfile::tempdir().unwrap();
    let output = without_room(folder.path(), "--device sil:world=simple,bus=bus.log list");
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(said(&output).contains("E235") && said(&output).contains("bus.log"), "{}", said(&output));
}

/// Names of unfinished files in a folder.
fn parts(folder: &Path) -> Vec<String> {
    let names = folder.read_dir().unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    names.filter(|name| name.ends_with(".part")).collect()
}

/// Sends a signal by the system's own program.
fn signal(child: &Child, signal: &str) {
    assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
}

#[test]
fn a_drawing_that_is_interrupted_leaves_nothing_unfinished() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    common::demonstration(folder, 60.0);
    let deadline = Instant::now() + Duration::from_secs(60);
    for name in ["-INT", "-TERM", "-HUP"] {
        // A drawing may be faster than this test: another try then.
        loop {
            assert!(Instant::now() < deadline, "no drawing was caught unfinished");
            let mut child = command(folder, "plot --force -d demo.csv -o a.svg -o b.png")
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .unwrap();
            while parts(folder).is_empty() && child.try_wait().unwrap().is_none() {
                std::thread::sleep(Duration::from_micros(200));
            }
            if child.try_wait().unwrap().is_none() {
                signal(&child, name);
            }
            let ended = child.wait().unwrap();
            assert_eq!(parts(folder), Vec::<String>::new(), "{name}");
            if ended.code().is_none() {
                break;
            }
        }
    }
}
