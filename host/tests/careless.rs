//! The lines of careless people: nothing is lost, and what is wrong is named, for people and for scripts.

#[path = "../../crates/lab/tests/common/mod.rs"]
mod common;

use std::path::Path;
use std::process::{Child, Command, Output, Stdio};

use serde_json::Value;

const DEVICE: &str = "--device sil:world=simple --non-interactive";

fn tactus(folder: &Path, line: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tactus"));
    command.current_dir(folder).env("XDG_CONFIG_HOME", folder).env_remove("TACTUS_DEVICE").arg("--json");
    command.args(line.split_whitespace()).stdin(Stdio::null()).output().unwrap()
}

#[track_caller]
fn succeeds(folder: &Path, line: &str) {
    let output = tactus(folder, line);
    assert!(output.status.success(), "{line}: {}", String::from_utf8_lossy(&output.stderr));
}

/// Exit code, code, message and help of a command that fails.
#[track_caller]
fn refused(folder: &Path, line: &str) -> (i32, String, String, String) {
    let output = tactus(folder, line);
    assert!(!output.status.success(), "{line}");
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    let word = |key: &str| told["error"][key].as_str().unwrap_or_default().to_owned();
    (output.status.code().unwrap(), word("code"), word("message"), word("help"))
}

/// A program that ends with its test, whatever becomes of that.
struct Ended(Child);

impl Drop for Ended {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn learned() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    common::demonstration(folder.path(), 3.0);
    succeeds(folder.path(), "learn demo.csv -o reach.toml");
    folder
}

#[test]
fn a_script_is_told_what_is_wrong_with_a_command_line_as_a_person_is() {
    let folder = tempfile::tempdir().unwrap();
    for (line, words) in [
        ("learn", "<DEMO>"),
        ("statistics reach.toml", "<RECORDING>"),
        ("completions foo", "possible values: bash"),
        ("check --sped 1 a.toml", "--speed"),
        ("check a.toml --speed 7", "between 0.1 and 2"),
        ("hand", "a command or an option is missing"),
    ] {
        let (exit, code, message, _) = refused(folder.path(), line);
        assert!(exit == 2 && code == "E200" && message.contains(words), "{line}: {code}: {message}");
        assert!(!message.contains("Usage") && !message.contains('\n'), "{line}: {message}");
    }
}

/// The device would refuse it: it has been written, and the primitive could not be run any more.
#[test]
fn statistics_are_not_put_into_a_primitive_that_no_device_would_take_then() {
    let folder = learned();
    let at = folder.path();
    succeeds(at, &format!("{DEVICE} run reach.toml --record run.csv"));
    let before = std::fs::read(at.join("reach.toml")).unwrap();
    let (exit, code, _, help) = refused(at, "statistics reach.toml run.csv");
    assert!(exit == 6 && code == "E635" && help.contains("tactus rehearse reach.toml"), "{exit} {code}: {help}");
    assert_eq!(std::fs::read(at.join("reach.toml")).unwrap(), before);
    succeeds(at, &format!("{DEVICE} run reach.toml"));
}

#[test]
fn a_file_where_a_folder_is_expected_is_named_and_the_primitive_stays_as_it_is() {
    let folder = learned();
    let at = folder.path();
    std::fs::write(at.join("there"), "precious").unwrap();
    let before = std::fs::read(at.join("reach.toml")).unwrap();
    for line in [
        format!("{DEVICE} rehearse reach.toml --record-dir there"),
        format!("{DEVICE} run reach.toml --keep there"),
        "manual there".to_owned(),
    ] {
        let (exit, code, message, help) = refused(at, &line);
        assert!(exit == 2 && code == "E231" && message.contains("there"), "{line}: {exit} {code}: {message}");
        assert!(help.contains("folder"), "{line}: {help}");
    }
    assert_eq!(std::fs::read(at.join("reach.toml")).unwrap(), before);
    assert_eq!(std::fs::read(at.join("there")).unwrap(), b"precious");
}

#[test]
fn an_image_that_is_not_there_is_a_wrong_command_line_and_the_reason_is_told() {
    let folder = tempfile::tempdir().unwrap();
    for (line, code, words) in [
        ("flash --dry-run --image nothing.elf", "E233", "No such file"),
        ("flash --dry-run --image .", "E236", "Is a directory"),
    ] {
        let (exit, found, message, _) = refused(folder.path(), line);
        assert!(exit == 2 && found == code && message.contains(words), "{line}: {exit} {found}: {message}");
    }
}

#[test]
fn a_speed_of_standing_still_that_is_none_is_refused_by_the_name_of_its_option() {
    let folder = learned();
    for value in ["nan", "inf", "-1", "0", "1e9"] {
        let (exit, code, message, _) =
            refused(folder.path(), &format!("learn demo.csv -o a.toml --still-speed {value}"));
        assert!(exit == 2 && code == "E221" && message.contains("--still-speed"), "{value}: {code}: {message}");
    }
}

/// The report of the empty hand is what later measurements are compared with.
#[test]
fn a_measurement_does_not_replace_the_report_that_it_is_compared_with() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let told = |kilograms: f64| {
        serde_json::json!({ "beyond_hand": {
            "mass_kg": kilograms, "mass_standard_error_kg": 0.01, "moment_kgm": [0.0, 0.0, 0.0],
            "moment_standard_error_kgm": [0.01, 0.01, 0.01], "repeat_standard_error": [0.01, 0.01, 0.01, 0.01],
        } })
    };
    let report = serde_json::json!({
        "action": "payload", "serial": "simulated",
        "found": { "sensor": told(0.0), "joints": told(0.0), "contradiction": null },
    });
    std::fs::write(at.join("empty.json"), report.to_string()).unwrap();
    let line = format!("{DEVICE} calibrate payload --measure --without empty.json --report ./empty.json --force");
    let (exit, code, ..) = refused(at, &line);
    assert_eq!((exit, code.as_str()), (2, "E232"));
    assert_eq!(std::fs::read_to_string(at.join("empty.json")).unwrap(), report.to_string());
}

/// Two terminals: the second `sim` is refused, and the first one's log goes on.
#[test]
fn a_second_arm_at_the_same_place_is_refused_and_the_log_of_the_first_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut first = Command::new(env!("CARGO_BIN_EXE_tactus"));
    first.current_dir(at).args(["--device", "sil:world=simple,bus=arm.log", "sim", "--listen", "unix:arm.sock"]);
    first.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let first = Ended(first.spawn().unwrap());
    let grown = |bytes: u64| {
        let begun = std::time::Instant::now();
        while std::fs::metadata(at.join("arm.log")).map_or(0, |found| found.len()) < bytes {
            assert!(begun.elapsed().as_secs() < 60, "the log does not grow");
            std::thread::yield_now();
        }
    };
    grown(8_000);
    for (line, code) in [
        ("--device sil:world=simple,bus=arm.log --force sim --listen unix:arm.sock", "E3"),
        ("--device sil:world=simple,bus=arm.log --force sim --listen unix:other.sock --duration 1", "E208"),
        ("--device sil:world=simple,bus=arm.log --force list", "E208"),
    ] {
        let (_, found, message, _) = refused(at, line);
        assert!(found.starts_with(code), "{line}: {found}: {message}");
    }
    assert!(!at.join("other.sock").exists(), "the place of an arm that did not start is free again");
    assert!(at.join("arm.sock").exists());
    succeeds(at, "--device unix:arm.sock --non-interactive hand --at-home init");
    grown(60_000);
    drop(first);
    let log = std::fs::read(at.join("arm.log")).unwrap();
    assert!(log.starts_with(b"(0") && !log.contains(&0), "it has a hole where it was cut");
}

#[test]
fn an_arm_can_be_stopped_beside_a_configuration_file_that_cannot_be_used() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::create_dir(at.join("tactus")).unwrap();
    std::fs::write(at.join("tactus/config.toml"), "timeout = \"x\"\n").unwrap();
    let stopped = tactus(at, &format!("{DEVICE} stop"));
    let said = String::from_utf8_lossy(&stopped.stderr).into_owned();
    assert!(stopped.status.success() && said.contains("warning: ") && said.contains("config.toml"), "{said}");
    for line in [format!("{DEVICE} list"), "stop".to_owned()] {
        assert_eq!(refused(at, &line).1, "E250", "{line}");
    }
}

#[test]
fn a_recording_that_could_not_be_read_again_is_not_made() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for command in ["record", "teach"] {
        for seconds in ["0.0001", "0.19", "nan", "3601"] {
            let (_, code, message, _) = refused(at, &format!("{DEVICE} {command} --duration {seconds} -o a.csv"));
            assert!(code == "E200" && message.contains("between 0.2 and 3600 s"), "{command}: {message}");
        }
        succeeds(at, &format!("{DEVICE} {command} --duration 0.2 -o {command}.csv"));
        lab::demonstration::Recording::read(&at.join(format!("{command}.csv"))).unwrap();
    }
    assert!(!at.join("a.csv").exists());
}
