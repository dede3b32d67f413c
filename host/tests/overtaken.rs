//! Commands that are interrupted, or whose files somebody changes meanwhile: what was measured stays, nothing goes
//! unasked.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::tool::{heeding, ignoring, learned, said, succeeds};

const DEVICE: &str = "--device sil:world=simple --non-interactive";

fn command(folder: &Path, line: &str) -> Command {
    heeding("INT", folder, line)
}

fn begun(folder: &Path, line: &str) -> Child {
    command(folder, line).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

/// Waits until a file has so many bytes.
#[track_caller]
fn grows(child: &mut Child, file: &Path, bytes: u64) {
    let begun = Instant::now();
    while !std::fs::metadata(file).is_ok_and(|file| file.len() >= bytes) {
        assert!(begun.elapsed() < Duration::from_secs(60), "{} does not grow", file.display());
        assert_eq!(child.try_wait().unwrap(), None, "it ended by itself");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// The change that makes it fail: a trial is written when it is complete.
#[test]
fn what_an_interrupted_rehearsal_has_measured_is_kept() {
    let folder = learned(20.0);
    let at = folder.path();
    let mut rehearsal = begun(at, &format!("{DEVICE} rehearse reach.toml --record-dir kept"));
    let part = at.join("kept/reach-1.csv.part");
    grows(&mut rehearsal, &part, 50_000);
    assert!(Command::new("kill").args(["-s", "INT", &rehearsal.id().to_string()]).status().unwrap().success());
    let ended = rehearsal.wait_with_output().unwrap();
    assert_eq!(ended.status.code(), Some(130), "{}", said(&ended));
    assert!(part.is_file() && said(&ended).contains("reach-1.csv.part"), "{}", said(&ended));
    assert!(std::fs::read_to_string(&part).unwrap().lines().count() > 20, "its samples");
    let left: Vec<_> = at.join("kept").read_dir().unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(left.len(), 1, "of the trials that never began nothing is left: {left:?}");
}

/// Seen: `nohup tactus run ... &`, and the terminal was closed: the run was stopped in the middle, with 130.
///
/// The change that makes it fail: a signal that was to be ignored is heeded all the same.
#[test]
fn a_run_that_was_started_with_nohup_outlives_its_terminal() {
    let folder = learned(20.0);
    let at = folder.path();
    let mut run = ignoring("HUP", at, &format!("{DEVICE} run reach.toml --record run.csv"));
    let mut run = run.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    grows(&mut run, &at.join("run.csv.part"), 50_000);
    assert!(Command::new("kill").args(["-s", "HUP", &run.id().to_string()]).status().unwrap().success());
    let ended = run.wait_with_output().unwrap();
    assert!(ended.status.success() && at.join("run.csv").is_file(), "{}", said(&ended));
}

/// The change that makes it fail: the primitive is always put back.
#[test]
fn a_primitive_that_is_changed_while_it_is_rehearsed_is_not_overwritten() {
    let folder = learned(3.0);
    let at = folder.path();
    succeeds(at, "learn demo.csv --name reach --kernels 30 -o other.toml");
    let other = std::fs::read(at.join("other.toml")).unwrap();
    let mut rehearsal = begun(at, &format!("{DEVICE} --json rehearse reach.toml --record-dir kept"));
    grows(&mut rehearsal, &at.join("kept/reach-1.csv.part"), 0);
    std::fs::write(at.join("reach.toml"), &other).unwrap();
    let ended = rehearsal.wait_with_output().unwrap();
    let told: Value = serde_json::from_slice(&ended.stdout).unwrap();
    assert_eq!(told["error"]["code"], "E230", "{told}");
    assert!(std::fs::read(at.join("reach.toml")).unwrap() == other, "what somebody wrote is there");
    let kept = std::fs::read_to_string(at.join("reach.toml.part")).unwrap();
    assert!(kept.contains("[expectation]"), "what was learned is beside it");
}

/// The change that makes it fail: a recording that cannot be put at its place ends the command before its report.
#[test]
fn a_run_that_was_played_tells_how_it_went_though_its_recording_has_no_place() {
    let folder = learned(20.0);
    let at = folder.path();
    let mut run = begun(at, &format!("{DEVICE} --json run reach.toml --record run.csv"));
    grows(&mut run, &at.join("run.csv.part"), 50_000);
    std::fs::write(at.join("run.csv"), "mine").unwrap();
    let ended = run.wait_with_output().unwrap();
    let told: Value = serde_json::from_slice(&ended.stdout).unwrap();
    assert_eq!((told["error"]["code"].as_str(), ended.status.code()), (Some("E230"), Some(2)), "{told}");
    assert!(told["result"]["tracking"]["samples"].as_u64().is_some_and(|samples| samples > 1000), "{told}");
    assert!(told["result"]["preconditions"].as_array().is_some_and(|list| !list.is_empty()), "{told}");
    assert_eq!(std::fs::read_to_string(at.join("run.csv")).unwrap(), "mine");
}

/// The changes that make it fail: `Failure::kept` names any file; or `run` does not look whether its folder is there.
#[test]
fn what_has_gone_with_its_folder_is_not_said_to_be_kept() {
    let folder = learned(20.0);
    let at = folder.path();
    for options in ["--record kept/run.csv", "--keep kept"] {
        std::fs::create_dir(at.join("kept")).unwrap();
        let mut run = begun(at, &format!("{DEVICE} --json run reach.toml {options}"));
        let inside = || at.join("kept").read_dir().unwrap().next().map(|entry| entry.unwrap().path());
        let waiting = Instant::now();
        let found = loop {
            assert!(waiting.elapsed() < Duration::from_secs(60), "nothing is written");
            match inside() {
                Some(found) => break found,
                None => std::thread::yield_now(),
            }
        };
        let part = if found.is_dir() { found.join("run.csv.part") } else { found };
        grows(&mut run, &part, 50_000);
        std::fs::remove_dir_all(at.join("kept")).unwrap();
        let ended = run.wait_with_output().unwrap();
        let told: Value = serde_json::from_slice(&ended.stdout).unwrap();
        assert_eq!((told["error"]["code"].as_str(), ended.status.code()), (Some("E233"), Some(2)), "{told}");
        assert!(told["error"].get("kept").is_none(), "{told}");
        let words = said(&ended);
        assert!(!words.contains("kept: ") && !words.contains("everything about this run"), "{words}");
    }
}

/// The change that makes it fail: a rehearsal does not look at what is there.
#[test]
fn a_rehearsal_says_what_it_replaces_in_the_device_and_what_the_device_lacks_then() {
    let folder = learned(3.0);
    let at = folder.path();
    let device = "--device sil:world=simple,flash=arm.flash --non-interactive";
    succeeds(at, &format!("{device} upload reach.toml"));
    let first = said(&succeeds(at, &format!("{device} rehearse reach.toml --trials 1")));
    assert!(!first.contains("replaces") && first.contains("`tactus upload reach.toml` gives it that"), "{first}");
    // What the device has is this file, with all that it remembers.
    succeeds(at, &format!("{device} upload reach.toml --force"));
    let again = said(&succeeds(at, &format!("{device} rehearse reach.toml --trials 1")));
    assert!(!again.contains("replaces"), "{again}");
    succeeds(at, "learn demo.csv --name reach --kernels 30 -o other.toml");
    let other = said(&succeeds(at, &format!("{device} rehearse other.toml --trials 1")));
    assert!(other.contains("replaces another version of 'reach'"), "{other}");
    let forgotten = said(&succeeds(at, &format!("{DEVICE} rehearse other.toml --trials 1")));
    assert!(!forgotten.contains("tactus upload"), "nothing stays there: {forgotten}");
}

/// The change that makes it fail: a path goes into a command line as it is.
#[test]
fn an_advised_command_names_a_path_with_spaces_as_one_word() {
    let folder = learned(3.0);
    let at = folder.path();
    std::fs::rename(at.join("demo.csv"), at.join("my demo.csv")).unwrap();
    let output = command(at, "check").arg("my demo.csv").output().unwrap();
    assert!(said(&output).contains("`tactus learn 'my demo.csv'`"), "{}", said(&output));
    let output = command(at, "manual").arg("my pages").output().unwrap();
    let told = String::from_utf8_lossy(&output.stdout);
    assert!(told.contains("`man 'my pages/tactus-run.1'`"), "{told}");
    let output = command(at, "manual -- -p").output().unwrap();
    let told = String::from_utf8_lossy(&output.stdout);
    assert!(told.contains("`man ./-p/tactus-run.1`"), "{told}");
}
