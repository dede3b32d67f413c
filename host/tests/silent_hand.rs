//! A hand of which a puck falls silent: whichever command finds it says so, and names the puck.

use std::path::Path;

use crate::tool::{Refusal, refusal, succeeds};

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
