//! A hand of which a puck falls silent, or that somebody stops: whichever command finds it says so, and names the puck.

use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::served_arm::{Arm, command, tactus};
use crate::tool::{Refusal, refusal, succeeds};

/// A script of which nothing happens within a test.
const NEVER: &str = "
[[scenario]]
name = \"nothing\"
from = \"power-up\"
inject = [{ at = 3600, what = \"bus-off\" }]
";

/// An arm of whose hand the first finger's puck (node 11) is silent from so many seconds after the power-up on.
fn arm(folder: &Path, seconds: f64) -> String {
    let script = format!(
        "[[scenario]]\nname = \"a silent finger\"\nfrom = \"power-up\"\n\
         inject = [{{ at = {seconds:.1}, what.drop = {{ kind = \"any\", from = [11] }} }}]\n"
    );
    std::fs::write(folder.join("silent.toml"), script).unwrap();
    "--device sil:world=simple,faults=silent.toml --non-interactive".to_owned()
}

/// A finger that was lost on its way was "stopped by something", at angles of zero, and the command succeeded.
///
/// The change that makes it fail: a move of the hand does not look whether the hand is still there.
#[test]
fn a_hand_that_is_lost_in_its_move_has_met_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let Refusal { exit, code, message, help } = refusal(at, &format!("{} --json hand close", arm(at, 5.0)));
    assert!(exit == 5 && code == "E595" && message.contains("lost in its move"), "{code}: {message}");
    assert!(help.contains("cable") && help.contains("`tactus hand init`"), "{help}");
    succeeds(at, &format!("{} hand close", arm(at, 30.0)));
}

/// "Free the fingers" was all that it said of a cable.
///
/// The change that makes it fail: nobody keeps what the device tells of its hand meanwhile.
#[test]
fn a_puck_that_falls_silent_in_the_initialisation_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let Refusal { code, message, help, .. } = refusal(at, &format!("{} --json hand init", arm(at, 2.0)));
    assert!(code == "E595" && message.contains("its puck 11 "), "{code}: {message}");
    assert!(help.contains("check the hand's cable"), "{help}");
    // Before anything was asked of a hand whose puck never answered there is none.
    for action in ["init", "open", "to 0,1,1,1"] {
        let Refusal { code, help, .. } = refusal(at, &format!("{} --json hand {action}", arm(at, 0.0)));
        assert!(code == "E596" && help.contains("check the hand's cable"), "{action}: {code}: {help}");
    }
}

/// A hand that was stopped on its way by `tactus stop` of somebody else was "stopped by something", and the command
/// succeeded.
///
/// The change that makes it fail: a move of the hand looks for faults alone, and not at the state of the device.
#[test]
fn a_hand_that_somebody_stops_in_its_move_has_met_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let _arm = Arm::start(at, NEVER);
    let opened = tactus(at, "--non-interactive hand --at-home open");
    assert!(opened.status.success(), "{}", String::from_utf8_lossy(&opened.stderr));
    let close = command(at, "--non-interactive --json hand close").stdout(Stdio::piped()).spawn().unwrap();
    let begun = Instant::now();
    let finger = || -> f64 {
        let told: Value = serde_json::from_slice(&tactus(at, "--json status").stdout).unwrap_or_default();
        told["hand_rad"][1].as_f64().unwrap_or_default()
    };
    while finger() < 0.3 {
        assert!(begun.elapsed() < Duration::from_secs(20), "the hand does not close");
    }
    assert!(tactus(at, "stop").status.success());
    let ended = close.wait_with_output().unwrap();
    let told: Value = serde_json::from_slice(&ended.stdout).unwrap();
    assert_eq!((ended.status.code(), &told["error"]["code"]), (Some(5), &"E593".into()), "{told}");
}

/// `hand init` told "initialised" of a hand that was ready, and did nothing: one that had met something in its first
/// initialisation counted from there until its power was switched off.
///
/// The change that makes it fail: a hand that is ready is left as it is.
#[test]
fn a_hand_that_is_ready_is_initialised_again_where_a_person_asks_for_it() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let _arm = Arm::start(at, NEVER);
    for (action, expected) in [("to 0,1,1,1", 1.0), ("init", 0.0)] {
        let output = tactus(at, &format!("--non-interactive --json hand --at-home {action}"));
        let told: Value = serde_json::from_slice(&output.stdout).unwrap();
        let finger = told["hand_rad"][1].as_f64().unwrap_or(f64::NAN);
        assert!((finger - expected).abs() < 0.1, "{action}: {told}");
    }
}
