//! `tactus faults`: the last second before a fault, read from beside, after the clear, and on paper.

use std::path::Path;

use control::{Fault, RATE_HZ, State};
use lab::fault_guide::FaultGuide;
use serde_json::Value;

use crate::common;
use crate::served_arm::{Arm, tactus};

/// The replies of one puck are lost for 50 ms, 1.5 s after the first torque: on the way to the start of the movement.
const SCRIPT: &str = "
title = \"six lost cycles\"
bar = \"stops\"
today = \"held\"

[[scenario]]
name = \"the replies of the elbow are lost\"
from = \"run\"
watch = 3.0
inject = [{ at = 1.5, lasts = 0.05, what.drop = { kind = \"position\", from = [4] } }]
expect = { state = [\"soft stop\"] }
";

#[track_caller]
fn object(folder: &Path, line: &str) -> Value {
    let output = tactus(folder, &format!("--json {line}"));
    assert!(output.status.success(), "{line}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn cli_2_every_fault_has_a_name_a_cause_a_check_and_a_way_on() {
    let folder = tempfile::tempdir().unwrap();
    for fault in Fault::ALL.into_iter().filter(|fault| *fault != Fault::None) {
        let FaultGuide { cause, check, clear, .. } = FaultGuide::of(fault);
        for words in [fault.explanation(), cause, check, clear] {
            assert!(words.len() > 10 && !words.ends_with('.'), "{fault:?}: {words}");
        }
        assert!(clear.contains("clear-fault") || fault == Fault::OtherPayload, "{fault:?}");
        let output = tactus(folder.path(), &format!("explain {fault:?}"));
        let said = String::from_utf8(output.stdout).unwrap();
        assert!(output.status.success() && said.contains(cause) && said.contains(clear), "{said}");
    }
}

/// Seen: `stop --clear-fault` told "stopped; state: gravity". A moment later the arm was in a soft stop again, and
/// `status` counted a host that had fallen silent.
///
/// The change that makes it fail: `stop --clear-fault` leaves an arm that floats to the device.
#[test]
fn cli_2_a_fault_of_a_run_is_told_unprompted_and_its_last_second_can_be_read_before_and_after_the_clear() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    common::demonstration(folder, 3.0);
    assert!(tactus(folder, "learn demo.csv -o reach.toml").status.success());
    let _arm = Arm::start(folder, SCRIPT);
    let quiet = object(folder, "faults");
    assert_eq!((&quiet["present"], &quiet["last"]), (&Value::Null, &Value::Null));
    let nothing = tactus(folder, "faults --record fault.csv");
    assert!(nothing.status.code() == Some(6) && !folder.join("fault.csv").exists());
    assert!(String::from_utf8_lossy(&nothing.stderr).contains("E690"));

    let run = tactus(folder, "run reach.toml --non-interactive");
    let said = String::from_utf8(run.stderr).unwrap();
    assert_eq!(run.status.code(), Some(5), "{said}");
    assert!(said.contains(Fault::RepliesLost.explanation()) && said.contains("`tactus faults`"), "{said}");
    assert!(said.contains(FaultGuide::of(Fault::RepliesLost).check), "{said}");

    let told = object(folder, "faults --record fault.csv");
    assert_eq!((&told["present"]["name"], &told["last"]["fault"]["code"]), (&"RepliesLost".into(), &1.into()));
    let cycles = told["last"]["cycles"].as_array().unwrap();
    assert_eq!((cycles.len(), &told["last"]["latched"]), (RATE_HZ as usize, &true.into()));
    let (fault, before) = cycles.split_last().unwrap();
    assert_eq!((&fault["fault"], &fault["state"]), (&1.into(), &State::SoftStop.name().into()));
    // Six cycles without the elbow end in the fault; the approach went well before.
    let lost: Vec<u64> = before.iter().map(|cycle| cycle["lost_replies"].as_u64().unwrap()).collect();
    let (well, five) = lost.split_at(lost.len() - 5);
    assert_eq!((five, well[..well.len() - 4].iter().sum()), (&[1; 5][..], 0), "{lost:?}");
    assert!(before.iter().all(|cycle| cycle["fault"] == 0));
    assert_eq!(
        (&before[280]["state"], &before[298]["state"]),
        (&State::Approach.name().into(), &State::Coast.name().into())
    );
    let numbers: Vec<u64> = cycles.iter().map(|cycle| cycle["cycle"].as_u64().unwrap()).collect();
    assert!(numbers.windows(2).all(|pair| pair[1] == pair[0] + 1), "a second without a gap");

    // What reads recordings reads it, and it is not replaced unasked.
    let plot = tactus(folder, "plot --run fault.csv --output fault.svg");
    assert!(plot.status.success(), "{}", String::from_utf8_lossy(&plot.stderr));
    let before = std::fs::read(folder.join("fault.csv")).unwrap();
    assert_eq!(tactus(folder, "faults --record fault.csv").status.code(), Some(2));
    assert_eq!(std::fs::read(folder.join("fault.csv")).unwrap(), before);

    // Cleared, and the arm runs again: the record is still that of the fault.
    let stopped = object(folder, "stop --clear-fault");
    assert_eq!((&stopped["state"], &stopped["fault"]), (&State::SoftStop.name().into(), &1.into()), "{stopped}");
    let left = object(folder, "status");
    assert_eq!((&left["state"], &left["silences"]), (&stopped["state"], &0.into()), "{left}");
    let again = tactus(folder, "run reach.toml --non-interactive");
    assert!(again.status.success(), "{}", String::from_utf8_lossy(&again.stderr));
    let later = object(folder, "faults");
    assert_eq!((&later["present"], &later["last"]["latched"]), (&Value::Null, &false.into()));
    assert_eq!(later["last"]["cycles"], told["last"]["cycles"]);
    assert_eq!(later["pendant"]["supervised"]["heartbeat"], "ok");
    let words = String::from_utf8(tactus(folder, "faults").stdout).unwrap();
    assert!(words.contains("last fault, cleared: RepliesLost") && words.lines().count() == 29, "{words}");
}

/// A1: a single lost reply is bridged, in gravity as everywhere.
#[test]
fn a1_a_lost_reply_does_not_end_a_demonstration() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let lost = SCRIPT
        .replace("from = \"run\"", "from = \"power-up\"")
        .replace("at = 1.5, lasts = 0.05", "at = 12.0, lasts = 0.01");
    std::fs::write(folder.join("one.toml"), lost.replace("from = [4] }", "from = [4], most = 1 }")).unwrap();
    let taught = tactus(folder, "--device sil:world=simple,faults=one.toml teach --duration 10 -o demo.csv");
    assert!(taught.status.success(), "{}", String::from_utf8_lossy(&taught.stderr));
    let rows = std::fs::read_to_string(folder.join("demo.csv")).unwrap();
    assert_eq!(rows.lines().filter(|row| row.contains(State::Coast.name())).count(), 1);
}
