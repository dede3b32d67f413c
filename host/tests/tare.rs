//! `tactus tare`: a sensor that has drifted gets its zero again, a load does not become one unasked.

use std::path::Path;

use serde_json::Value;

use crate::served_arm::{Arm, tactus};

#[track_caller]
fn object(folder: &Path, line: &str, code: i32) -> Value {
    let output = tactus(folder, &format!("--json {line}"));
    assert_eq!(output.status.code(), Some(code), "{line}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Half a second after the first torque the force sensor is wrong by so many newtons along its third axis.
fn drift(newtons: f64) -> String {
    format!(
        "title = \"drift\"\nbar = \"none\"\ntoday = \"held\"\n[[scenario]]\nname = \"drift\"\nfrom = \"hold\"\nwatch = 3.0\n\
         inject = [{{ at = 0.5, what.sensor.error = [0, 0, {newtons}, 0, 0, 0] }}]\nexpect = {{ state = [\"hold\"] }}\n"
    )
}

/// Size of the force of a reading, N.
fn force(reading: &Value) -> f64 {
    let axis = |axis: usize| reading["force_n"][axis].as_f64().unwrap();
    axis(0).hypot(axis(1)).hypot(axis(2))
}

#[test]
fn a_drift_becomes_zero_at_once_and_a_load_only_when_a_person_says_so() {
    for (newtons, is_load) in [(0.7, false), (3.0, true)] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let _arm = Arm::start(folder, &drift(newtons));
        object(folder, "hand open", 0);
        if is_load {
            let refused = object(folder, "tare", 6);
            assert_eq!(refused["error"]["code"], "E655");
            assert!(refused["error"]["message"].as_str().unwrap().contains("3.0 N"), "{refused}");
            assert!(refused["error"]["help"].as_str().unwrap().contains("tactus tare --loaded"), "{refused}");
        }
        let tared = object(folder, if is_load { "tare --loaded" } else { "tare" }, 0);
        let (before, after) = (force(&tared["before"]), force(&tared["after"]));
        assert!((before - newtons).abs() < 0.2 && after < 0.1, "{tared}");
        assert!(
            tared["after"]["gauges_nm"].as_array().unwrap().iter().all(|gauge| gauge.as_f64().unwrap().abs() < 0.02)
        );
        let again = object(folder, "tare", 0);
        assert!(force(&again["before"]) < 0.1, "{again}");
        let shown = String::from_utf8(tactus(folder, "tare").stdout).unwrap();
        assert!(shown.starts_with("zero of") && shown.contains("gauge F3"), "{shown}");
    }
}

#[test]
fn a_hand_that_is_not_initialised_is_said_to_have_got_no_zero() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let _arm = Arm::start(folder, &drift(0.2));
    let output = tactus(folder, "--json tare --at-home");
    let tared: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(tared["after"]["gauges_nm"].is_null(), "{tared}");
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("the hand is not initialised") && said.contains("tactus hand init"), "{said}");
}

#[test]
fn an_arm_that_ends_with_the_command_says_that_its_zero_does_too() {
    let folder = tempfile::tempdir().unwrap();
    let tared = object(folder.path(), "--device sil:world=simple tare", 0);
    assert!(force(&tared["after"]) < 0.1, "{tared}");
    let said = String::from_utf8(tactus(folder.path(), "--device sil:world=simple tare").stderr).unwrap();
    assert!(said.contains("its zero with it"), "{said}");
}
