//! An arm that stays: `tactus sim` in one process, the other commands in others, over a socket and in real time.

use std::path::Path;
use std::process::Output;

use serde_json::Value;
use system_tests::command::{Running, one_object, start, tactus};
use system_tests::{PRIMITIVE, expect, taught};

/// A simulated arm that listens on `arm.sock` in the folder.
fn served(folder: &Path) -> Running {
    let arguments = ["--json", "--device", "sil:world=simple", "sim", "--listen", "unix:arm.sock"];
    let mut arm = start(folder, &arguments);
    arm.hear("listens");
    arm
}

const ARM: [&str; 3] = ["--json", "--device", "unix:arm.sock"];

fn object(folder: &Path, arguments: &[&str]) -> Value {
    let all = [&ARM[..], arguments].concat();
    one_object(&tactus(folder, &all).success().get_output().stdout)
}

#[track_caller]
fn assert_exit(output: &Output, code: i32) {
    assert_eq!(output.status.code(), Some(code), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn an_arm_that_stays_serves_one_command_after_the_other() {
    let folder = expect(tempfile::tempdir());
    let folder = folder.path();
    expect(taught().write(&folder.join("primitive.toml")));
    let arm = served(folder);

    assert_eq!(object(folder, &["list"])["primitives"], Value::Array(Vec::new()));
    assert_eq!(object(folder, &["upload", "primitive.toml"])["sent"], true);
    assert_eq!(object(folder, &["upload", "primitive.toml"])["sent"], false, "it is there already");
    assert_eq!(object(folder, &["list"])["primitives"][0]["name"], PRIMITIVE);

    // Ctrl-C in the middle of a run stops the arm first, and says so with its exit code.
    let mut run = start(folder, &[&ARM[..], &["run", "primitive.toml", "--record", "first.csv"]].concat());
    run.hear("running");
    run.interrupt();
    let output = run.finish();
    assert_exit(&output, 130);
    assert!(String::from_utf8_lossy(&output.stderr).contains("the arm has stopped"));
    let stopped = object(folder, &["stop"]);
    assert_eq!(stopped["state"], "soft stop", "{stopped}");

    let ran = object(folder, &["run", "primitive.toml", "--speed", "2"]);
    assert_eq!((&ran["name"], &ran["missed_deadlines"]), (&Value::from(PRIMITIVE), &Value::from(0)));
    assert_eq!(ran["bus"], Value::Null, "nobody can look into a device behind a socket");

    arm.interrupt();
    let output = arm.finish();
    assert_exit(&output, 0);
    assert!(one_object(&output.stdout)["simulated_s"].as_f64().is_some_and(|seconds| seconds > 15.0));
    assert!(!folder.join("arm.sock").exists(), "the socket was left behind");
}

#[test]
fn a_second_terminal_looks_on_and_stops_the_run_of_the_first_and_can_do_nothing_else() {
    let folder = expect(tempfile::tempdir());
    let folder = folder.path();
    expect(taught().write(&folder.join("primitive.toml")));
    let arm = served(folder);
    let mut run = start(folder, &[&ARM[..], &["run", "primitive.toml", "--speed", "0.3"]].concat());
    run.hear("running");
    assert_eq!(object(folder, &["list"])["primitives"][0]["loaded"], true);
    let deleted = tactus(folder, &[&ARM[..], &["delete", PRIMITIVE]].concat()).code(5);
    assert!(String::from_utf8_lossy(&deleted.get_output().stderr).contains("E504"), "the arm is the first one's");
    // Whether the first one is still there when the second asks depends on how quickly it leaves.
    object(folder, &["stop"]);
    let output = run.finish();
    assert_exit(&output, 5);
    let words = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(words.contains("E593") && words.contains("soft stop"), "{words}");
    let after = object(folder, &["stop"]);
    assert_eq!((&after["others"], &after["state"]), (&Value::from(false), &Value::from("soft stop")));
    arm.interrupt();
    assert_exit(&arm.finish(), 0);
}
