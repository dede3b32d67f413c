//! The library of a device by command, and looking on beside a run: over a socket and in real time.

use std::collections::BTreeMap;
use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use control::RATE_HZ;
use serde_json::Value;

use crate::common;
use crate::tool;

fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = tool::command(folder, arguments);
    command.env("TACTUS_DEVICE", "unix:arm.sock");
    command
}

fn tactus(folder: &Path, arguments: &[&str]) -> Output {
    command(folder, arguments).output().unwrap()
}

#[track_caller]
fn object(folder: &Path, arguments: &[&str]) -> Value {
    let output = tactus(folder, &[&["--json"][..], arguments].concat());
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Fails with this code, and says these words.
#[track_caller]
fn refused(folder: &Path, arguments: &[&str], code: &str, words: &str) {
    let output = tactus(folder, arguments);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && said.contains(code) && said.contains(words), "{arguments:?}: {said}");
}

/// A process that is killed when the test is over.
struct Running(Child);

impl Running {
    /// Starts the command and waits until it says these words.
    fn start(folder: &Path, arguments: &[&str], words: &str) -> Running {
        let mut child = command(folder, arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut lines = BufReader::new(child.stderr.take().unwrap());
        let mut line = String::new();
        while !line.contains(words) {
            line.clear();
            assert!(lines.read_line(&mut line).unwrap() > 0, "{arguments:?} ended before it said '{words}'");
        }
        // What it says later finds somebody who reads.
        std::thread::spawn(move || std::io::copy(&mut lines, &mut std::io::sink()));
        Running(child)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn served(folder: &Path) -> Running {
    Running::start(folder, &["--device", "sil:world=simple", "sim", "--listen", "unix:arm.sock"], "listens")
}

fn names(folder: &Path) -> Vec<String> {
    let listed = object(folder, &["list"]);
    let primitives = listed["primitives"].as_array().unwrap();
    primitives.iter().map(|primitive| primitive["name"].as_str().unwrap().to_owned()).collect()
}

#[test]
fn primitives_are_renamed_read_back_and_deleted_and_no_version_is_lost_unasked() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    common::demonstration(folder, 3.0);
    object(folder, &["learn", "demo.csv", "--name", "reach", "-o", "reach.toml"]);
    object(folder, &["learn", "demo.csv", "--name", "reach", "--kernels", "20", "-o", "other.toml"]);
    let _arm = served(folder);
    let stored = object(folder, &["upload", "reach.toml"]);

    refused(folder, &["upload", "other.toml"], "E230", stored["crc"].as_str().unwrap());
    assert_eq!(object(folder, &["list"])["primitives"][0]["kernels"], 50);

    object(folder, &["rename", "reach", "first"]);
    object(folder, &["upload", "other.toml"]);
    assert_eq!(names(folder), ["first", "reach"]);
    refused(folder, &["rename", "first", "reach"], "E230", "another primitive 'reach'");
    refused(folder, &["rename", "third", "fourth"], "E513", "tactus list");

    // Read back and sent again it is the same image, byte for byte, and a file is not lost either.
    assert_eq!(object(folder, &["get", "first"])["file"], "first.toml");
    assert_eq!(object(folder, &["upload", "first.toml"])["sent"], false);
    refused(folder, &["get", "first"], "E230", "first.toml exists");
    object(folder, &["get", "reach", "-o", "first.toml", "--force"]);
    assert_eq!(object(folder, &["upload", "first.toml"])["kernels"], 20);

    object(folder, &["rename", "first", "reach", "--force"]);
    let listed = object(folder, &["list"]);
    assert_eq!((&listed["primitives"][0]["kernels"], &listed["free"]), (&Value::from(50), &Value::from(7)));
    object(folder, &["upload", "other.toml", "--force"]);
    object(folder, &["delete", "reach"]);
    assert_eq!(names(folder), Vec::<String>::new());
    refused(folder, &["delete", "reach"], "E513", "no primitive of that name");
}

#[test]
fn a_full_device_says_which_command_frees_a_place() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    common::demonstration(folder, 3.0);
    let _arm = served(folder);
    for number in 0..8 {
        object(
            folder,
            &["learn", "demo.csv", "--kernels", "10", "--name", &format!("p{number}"), "-o", "p.toml", "--force"],
        );
        object(folder, &["upload", "p.toml"]);
    }
    object(folder, &["learn", "demo.csv", "--name", "ninth", "-o", "ninth.toml"]);
    refused(folder, &["upload", "ninth.toml"], "E514", "tactus delete");
    let listed = tactus(folder, &["list"]);
    assert!(String::from_utf8_lossy(&listed.stdout).ends_with("0 free; `tactus delete NAME` frees one\n"));
    object(folder, &["delete", "p3"]);
    assert_eq!(object(folder, &["upload", "ninth.toml"])["place"], 3);
}

#[test]
fn a_stored_primitive_runs_by_its_name_and_others_look_on_without_costing_it_a_cycle() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    common::demonstration(folder, 8.0);
    object(folder, &["learn", "demo.csv", "--name", "reach", "-o", "reach.toml"]);
    let _arm = served(folder);
    object(folder, &["upload", "reach.toml"]);
    refused(folder, &["run", "reach.txt"], "E513", "no primitive of that name");

    let arguments = ["--json", "run", "reach", "--record", "run.csv"];
    let mut run = Running::start(folder, &arguments, "running 'reach'");
    // It is said before it is asked for: an observer may be quicker.
    let mut states = (0..100).map(|_| object(folder, &["status"]));
    let state = states.find(|state| state["state"] == "run").expect("the run never began");
    assert_eq!(state["loaded"], "reach");
    assert_eq!(object(folder, &["list"])["primitives"][0]["loaded"], true);
    let seen = object(folder, &["record", "--duration", "2", "-o", "seen.csv"]);
    assert_eq!(seen["samples"], 2 * RATE_HZ);
    refused(folder, &["delete", "reach"], "E504", "has been using the arm for");
    let watched = tactus(folder, &["--json", "monitor", "--primitive", "reach.toml", "--duration", "1.5"]);
    let lines = String::from_utf8(watched.stdout).unwrap();
    let lines: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(lines.len() >= 4 && lines.iter().all(|line| line["state"] == "run"), "{lines:?}");

    let status = run.0.wait().unwrap();
    assert!(status.success(), "the run ended otherwise because others looked on");
    let mut told = String::new();
    std::io::Read::read_to_string(run.0.stdout.as_mut().unwrap(), &mut told).unwrap();
    let told: Value = serde_json::from_str(&told).unwrap();
    // What the device counts. A program that the system does not let read for half a second loses messages by itself.
    for counter in ["missed_deadlines", "lost_replies", "telemetry_dropped"] {
        assert_eq!(told[counter], 0, "{counter}: {told}");
    }
    // Both saw the same numbers in the same cycles.
    let rows = |file: &str| -> BTreeMap<String, Vec<String>> {
        let text = std::fs::read_to_string(folder.join(file)).unwrap();
        let rows = text.lines().filter(|line| line.starts_with(|first: char| first.is_ascii_digit()));
        // Cycle and time come first; time counts from the first line of the file.
        rows.map(|row| row.split(',').map(str::to_owned).collect::<Vec<_>>())
            .map(|row| (row[0].clone(), row[2..].to_vec()))
            .collect()
    };
    let (run, seen) = (rows("run.csv"), rows("seen.csv"));
    let both: Vec<_> = seen.iter().filter_map(|(cycle, row)| Some((row, run.get(cycle)?))).collect();
    assert!(both.len() > 500, "{} of {} cycles", both.len(), seen.len());
    assert!(both.iter().all(|(seen, run)| seen == run), "the observer saw another run");
}

#[test]
fn a_run_by_its_name_in_the_device_is_a_run_of_the_file_that_was_uploaded() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    common::demonstration(folder, 3.0);
    object(folder, &["learn", "demo.csv", "--name", "reach", "-o", "reach.toml"]);
    let device = "sil:world=simple,flash=arm.flash";
    object(folder, &["--device", device, "upload", "reach.toml"]);
    object(folder, &["--device", device, "run", "reach", "--record", "stored.csv"]);
    object(folder, &["--device", device, "run", "reach.toml", "--record", "file.csv"]);
    // The device holds 32 bits of each number: that is no other movement.
    object(folder, &["report", "stored.csv", "file.csv", "--primitive", "reach.toml", "-o", "report.html"]);
    object(folder, &["plot", "-r", "stored.csv", "-p", "reach.toml", "-o", "figure.svg"]);
    object(folder, &["compare", "stored.csv", "file.csv"]);
    object(folder, &["learn", "demo.csv", "--name", "reach", "--kernels", "30", "-o", "other.toml"]);
    refused(folder, &["report", "stored.csv", "--primitive", "other.toml", "-o", "other.html"], "E641", "other.toml");
}

/// Sends a signal to a process.
#[track_caller]
fn signal(process: u32, name: &str) {
    assert!(Command::new("kill").args(["-s", name, &process.to_string()]).status().unwrap().success());
}

#[test]
fn cli_3_a_second_interrupt_ends_a_run_whose_device_does_not_confirm_the_stop() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    common::demonstration(at, 20.0);
    assert!(tactus(at, &["learn", "demo.csv", "-o", "reach.toml"]).status.success());
    let device = served(at);
    let patient = ["run", "reach.toml", "--record", "run.csv", "--non-interactive", "--timeout", "600"];
    let mut run = command(at, &patient).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let begun = Instant::now();
    let part = at.join("run.csv.part");
    while !std::fs::metadata(&part).is_ok_and(|file| file.len() > 50_000) {
        assert!(begun.elapsed() < Duration::from_secs(120), "nothing is recorded");
        assert_eq!(run.try_wait().unwrap(), None, "it ended by itself");
        std::thread::sleep(Duration::from_millis(5));
    }
    // The device hears nothing any more: nobody confirms the stop that the first interrupt asks for. One that follows
    // at once is the same one, delivered twice.
    signal(device.0.id(), "STOP");
    let begun = Instant::now();
    let ended = loop {
        assert!(begun.elapsed() < Duration::from_secs(120), "it waits for the device");
        match run.try_wait().unwrap() {
            Some(ended) => break ended,
            None => signal(run.id(), "INT"),
        }
        std::thread::sleep(Duration::from_millis(50));
    };
    assert_eq!(ended.code(), Some(130));
    assert!(part.is_file(), "what was recorded is kept");
}
