//! Every command with `--json`: one object on stdout, words on stderr.

use std::path::Path;

use serde_json::Value;
use system_tests::command::{one_object, stderr, tactus};
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

#[test]
fn figures_only_draws_results_that_are_there_and_teaches_nothing() {
    let folder = expect(tempfile::tempdir());
    expect(taught().write(&folder.path().join("primitive.toml")));
    let line = ["experiment", "flashlight", "--figures-only", "--out", "none"];
    let empty = tactus(folder.path(), &line).failure().code(2);
    assert!(stderr(&empty).contains("error[E242]"), "{}", stderr(&empty));
    let empty = tactus(folder.path(), &[&line[..], &["--primitive", "primitive.toml"]].concat()).failure().code(2);
    assert!(stderr(&empty).contains("there are no results in none"), "{}", stderr(&empty));
    assert!(!folder.path().join("none").join("results.jsonl").exists());
}

#[test]
fn an_object_that_is_none_is_refused_before_anything_is_taught_or_written() {
    const CUP: &str = include_str!("../../../crates/sim/objects/cup.toml");
    let folder = expect(tempfile::tempdir());
    let folder = folder.path();
    expect(std::fs::write(folder.join("heavy.toml"), CUP.replacen("mass = 0.2", "mass = -0.2", 1)));
    expect(std::fs::write(folder.join("cup.toml"), CUP));
    for (object, code, exit, reason) in [
        ("teapot", "E271", 2, "there is no object 'teapot'; there are small-torch, flashlight"),
        ("none.toml", "E233", 2, "No such file"),
        ("heavy.toml", "E663", 6, "is -0.2; it must be from"),
        ("cup.toml", "E663", 6, "the name 'cup' is that of an object which is compiled in"),
    ] {
        let failed = tactus(folder, &["experiment", "cup", "--object", object, "--out", "results"]);
        let failed = stderr(&failed.failure().code(exit));
        assert!(failed.contains(&format!("error[{code}]")) && failed.contains(reason), "{failed}");
        assert!(!folder.join("results").exists(), "{object}");
    }
}
