//! Every command with `--json`: one object on stdout, words on stderr.

use std::path::Path;

use serde_json::Value;
use system_tests::command::{one_object, tactus};
use system_tests::{PRIMITIVE, expect, taught};

/// Fast, and without the MuJoCo world.
const DEVICE: &str = "sil:world=simple";

fn object(folder: &Path, arguments: &[&str]) -> Value {
    let mut all = vec!["--json", "--device", DEVICE];
    all.extend(arguments);
    one_object(&tactus(folder, &all).success().get_output().stdout)
}

#[test]
fn cli_13_every_command_gives_one_json_object_and_nothing_else() {
    let folder = expect(tempfile::tempdir());
    let folder = folder.path();
    expect(taught().write(&folder.join("primitive.toml")));

    let object = |arguments: &[&str]| object(folder, arguments);
    let simulated = object(&["sim", "--listen", "unix:arm.sock", "--duration", "0.5", "--fast"]);
    assert!(simulated["simulated_s"].as_f64().is_some_and(|seconds| (0.5..0.6).contains(&seconds)), "{simulated}");
    let taught = object(&["teach", "--duration", "1", "-o", "floating.csv"]);
    assert_eq!((&taught["samples"], &taught["gaps"]), (&Value::from(control::RATE_HZ), &Value::from(0)));
    let recorded = object(&["record", "--duration", "0.5", "-o", "still.csv"]);
    assert_eq!(
        (&recorded["samples"], &recorded["file"]),
        (&Value::from(control::RATE_HZ / 2), &Value::from("still.csv"))
    );
    assert_eq!(object(&["list"])["primitives"], Value::Array(Vec::new()));
    let uploaded = object(&["upload", "primitive.toml"]);
    assert_eq!((&uploaded["name"], &uploaded["sent"]), (&Value::from(PRIMITIVE), &Value::from(true)));
    assert_eq!(object(&["check", "primitive.toml"])["violations"], Value::Array(Vec::new()));
    let run = object(&["run", "primitive.toml", "--speed", "2", "--record", "run.csv", "--bus-log", "bus.log"]);
    assert_eq!((&run["missed_deadlines"], &run["bus"]["invalid_frames"]), (&Value::from(0), &Value::from(0)));
    let log = expect(std::fs::read_to_string(folder.join("bus.log")));
    assert!(log.lines().all(|line| line.starts_with('(') && line.contains(" can0 ") && line.contains('#')));
    let learned = object(&["learn", "run.csv", "-o", "again.toml"]);
    assert_eq!(learned["file"], "again.toml");
    assert!(object(&["stop"])["state"].is_string());
    let plotted = object(&["plot", "-d", "run.csv", "-p", "again.toml", "-o", "figure.svg"]);
    assert!(plotted.to_string().contains("figure.svg"), "{plotted}");
}

/// It has no wrist: its gauges are all that can be tared.
#[test]
fn a_hand_alone_tares_its_gauges() {
    let folder = expect(tempfile::tempdir());
    let tared =
        one_object(&tactus(folder.path(), &["--json", "--device", "hand:", "tare"]).success().get_output().stdout);
    for (when, largest) in [("before", 0.05), ("after", 0.005)] {
        let reading = &tared[when];
        assert!(reading["force_n"].is_null() && reading["torque_nm"].is_null(), "{tared}");
        let gauges = expect(reading["gauges_nm"].as_array().ok_or("no gauges"));
        assert!(gauges.iter().all(|gauge| gauge.as_f64().is_some_and(|gauge| gauge.abs() < largest)), "{tared}");
    }
}

#[test]
fn failures_are_one_json_object_with_number_and_exit_code() {
    let folder = expect(tempfile::tempdir());
    expect(std::fs::write(folder.path().join("nonsense.toml"), "this is = [not a primitive"));
    for (arguments, exit) in [
        (&["--json", "list"][..], 2),
        (&["--json", "--device", "unix:nowhere.sock", "list"], 3),
        (&["--json", "--device", DEVICE, "upload", "nonsense.toml"], 6),
        (&["--json", "check", "nonsense.toml"], 6),
        (&["--json", "learn", "nowhere.csv"], 2),
    ] {
        let failed = tactus(folder.path(), arguments).code(exit);
        let object = one_object(&failed.get_output().stdout);
        assert!(object.to_string().contains("\"E"), "{arguments:?}: {object}");
        assert!(!failed.get_output().stderr.is_empty(), "{arguments:?} says nothing");
    }
}
