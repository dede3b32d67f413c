//! `tactus calibrate payload --measure` on arms that are not the model's: what it tells, what it does not believe, and
//! what it advises.

use std::path::Path;
use std::process::Output;

use serde_json::Value;

use crate::tool;

/// An arm whose links, hand and friction are not the model's; never weighed.
const ARM: &str = "sil:world=simple,arm=12";

/// The same with half a kilogram beside the middle of its hand.
const HOLDING: &str = "sil:world=simple,arm=12,held=0.5@0.02:-0.015:0.15";

const MEASURE: [&str; 3] = ["calibrate", "payload", "--measure"];

fn tactus(folder: &Path, device: &str, arguments: &[&str]) -> Output {
    tool::tactus(folder, &[&["--device", device, "--json", "-q"], arguments].concat())
}

#[track_caller]
fn found(folder: &Path, device: &str, options: &[&str]) -> Value {
    let output = tactus(folder, device, &[&MEASURE, options].concat());
    let words = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{words}{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_str(&words).unwrap()
}

#[track_caller]
fn refused(folder: &Path, device: &str, options: &[&str], code: &str) -> Value {
    let output = tactus(folder, device, &[&MEASURE, options].concat());
    let words = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(output.status.code(), Some(6), "{words}");
    let refused: Value = serde_json::from_str(&words).unwrap();
    assert_eq!(refused["error"]["code"], code, "{words}");
    refused
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// Distance of a body's centre from where it is, m.
fn apart(body: &Value, truth: [f64; 3]) -> f64 {
    let part = |axis: usize| number(&body["centre_m"][axis]) - truth[axis];
    (0..3).fold(0.0, |sum: f64, axis| sum.hypot(part(axis)))
}

fn object(file: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(file).unwrap()).unwrap()
}

#[test]
fn what_an_arm_takes_up_is_told_by_sensor_and_joints_within_the_bar_with_the_command_that_remembers_it() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let empty = found(folder, ARM, &["--report", "empty.json"]);
    assert_eq!((&empty["finding"], &empty["object"]), (&Value::from("hand"), &Value::Null), "{empty}");
    let report = object(&folder.join("empty.json"));
    assert_eq!((&report["action"], &report["found"]), (&Value::from("payload"), &empty));
    assert_eq!(report["kept"], Value::Bool(false));

    let holding = found(folder, HOLDING, &["--without", "empty.json"]);
    let held = &holding["object"];
    assert_eq!((&held["subtracted"], &holding["finding"]), (&Value::from("measured"), &Value::from("more")));
    let truth = [0.02, -0.015, 0.15];
    let (mass, apart_by_sensor) = (number(&held["sensor"]["mass_kg"]), apart(&held["sensor"], truth));
    assert!((mass - 0.5).abs() < 0.01 && apart_by_sensor < 0.004, "{holding}");
    // Friction of up to 2.6 N m is in each pass: without the other way it would be a quarter of a kilogram.
    let (mass, apart_by_joints) = (number(&held["joints"]["mass_kg"]), apart(&held["joints"], truth));
    assert!((mass - 0.5).abs() < 0.02 && apart_by_joints < 0.01, "{holding}");
    let joints = &holding["joints"]["beyond_hand"];
    let error = number(&joints["mass_kg"]) - number(&holding["sensor"]["beyond_hand"]["mass_kg"]);
    assert!(error.abs() < 3.0 * number(&joints["mass_standard_error_kg"]), "{holding}");
    // Tool and sensor axes differ by half a turn about z.
    let advice = holding["next"].as_str().unwrap();
    let payload = advice.split("--payload ").nth(1).and_then(|rest| rest.split('`').next()).unwrap();
    let told: Vec<f64> = payload.split(',').map(|number| number.parse().unwrap()).collect();
    for (told, truth) in told.iter().zip([0.5, -0.02, 0.015, 0.024]) {
        assert!((told - truth).abs() < 0.01, "{advice}");
    }

    // Without the report it is the model's hand that is subtracted, and said so.
    let holding = found(folder, HOLDING, &[]);
    assert_eq!(holding["object"]["subtracted"], "model-hand");
    let own = number(&empty["sensor"]["beyond_hand"]["mass_kg"]);
    assert!((number(&holding["object"]["sensor"]["mass_kg"]) - 0.5 - own).abs() < 0.01, "{holding}");
}

#[test]
fn sensor_and_joints_that_contradict_each_other_are_not_believed_and_named() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(
        folder.join("sensor.toml"),
        r#"
        [[scenario]]
        from = "hold"
        inject = [{ at = 1.0, what.freeze = { kind = "force" } }]
        [[scenario]]
        from = "hold"
        inject = [{ at = 1.0, what.sensor = { drift = [0.0, 0.05, 0.05, 0, 0, 0] } }]
        [[scenario]]
        from = "hold"
        inject = [{ at = 1.0, what.sensor = { error = [1.0, 2.0, -1.0, 0.1, 0.0, 0.0] } }]
        "#,
    )
    .unwrap();
    let with = |scenario: u8| format!("{ARM},faults=sensor.toml:{scenario}");
    let frozen = refused(folder, &with(1), &["--report", "frozen.json"], "E653");
    let message = frozen["error"]["message"].as_str().unwrap();
    assert!(message.contains("the wrist sensor tells -1.2") && message.contains("the joints"), "{message}");
    assert!(frozen["result"]["contradiction"].is_string() && frozen["result"]["next"].is_null(), "{frozen}");
    // What was not believed is told all the same, and is nothing to subtract.
    assert_eq!(object(&folder.join("frozen.json"))["found"], frozen["result"]);
    refused(folder, ARM, &["--without", "frozen.json"], "E654");
    let drifts = refused(folder, &with(2), &[], "E653");
    assert!(drifts["error"]["message"].as_str().unwrap().contains("the sensor drifts"), "{drifts}");
    // A sensor that is off by the same in every posture is no contradiction: its bias is told along.
    assert_eq!(found(folder, &with(3), &[])["finding"], "hand");
}

#[test]
fn the_verdict_goes_by_what_is_declared_and_by_the_weight_in_use() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let (empty, holding) = (format!("{ARM},flash=arm.flash"), format!("{HOLDING},flash=arm.flash"));
    let undeclared = found(folder, &empty, &["--report", "empty.json"]);
    assert_eq!(undeclared["declared"], "undeclared");
    assert!(undeclared["next"].as_str().unwrap().contains("`tactus calibrate payload hand`"), "{undeclared}");
    assert!(tactus(folder, &empty, &["calibrate", "payload", "hand"]).status.success());
    let declared = found(folder, &empty, &[]);
    assert_eq!((&declared["declared"], &declared["next"]), (&Value::from("hand"), &Value::Null));

    // More than is declared: what stays mounted is weighed with the arm, which then carries it.
    let more = found(folder, &holding, &[]);
    assert!(more["next"].as_str().unwrap().contains("`tactus calibrate gravity`"), "{more}");
    let weighed = tactus(folder, &holding, &["calibrate", "gravity"]);
    assert!(weighed.status.success(), "{}", String::from_utf8_lossy(&weighed.stdout));
    let carried = found(folder, &holding, &[]);
    assert!(carried["next"].as_str().unwrap().contains("nothing is to be done"), "{carried}");
    assert!(number(&carried["since_weighed"]["mass_kg"]).abs() < 0.03, "{carried}");

    // What a report of the empty hand tells is of the model's links: it counts on a weighed arm too.
    let held = found(folder, &holding, &["--without", "empty.json"]);
    assert!((number(&held["object"]["joints"]["mass_kg"]) - 0.5).abs() < 0.02, "{held}");
    let heavy = found(folder, &format!("{ARM},held=0.75"), &[]);
    assert!(heavy["next"].as_str().unwrap().starts_with("put it down"), "{heavy}");
}

#[test]
fn what_cannot_be_asked_for_or_subtracted_is_refused_before_the_arm_moves() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    // Nothing is measured where something is declared: a report would not be written, and nobody would know.
    let lines: [&[&str]; 6] = [
        &["hand", "--measure"],
        &["--without", "empty.json"],
        &["--report", "report.json"],
        &["hand", "--report", "report.json"],
        &["hand", "--without", "empty.json"],
        &["hand", "--at-home"],
    ];
    for line in lines {
        let output = tactus(folder, ARM, &[&["calibrate", "payload"], line].concat());
        assert_eq!(output.status.code(), Some(2), "{line:?}");
    }
    std::fs::write(folder.join("empty.json"), r#"{"action": "gravity"}"#).unwrap();
    refused(folder, ARM, &["--without", "empty.json"], "E654");
    let unheld = tactus(folder, "sil:world=simple,held=heavy", &MEASURE);
    let unheld = String::from_utf8_lossy(&unheld.stdout).into_owned();
    assert!(unheld.contains("E201") && unheld.contains("held=0.5"), "{unheld}");
}
