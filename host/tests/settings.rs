//! The settings that a device keeps of its arm are read, changed, written to a file, compared and restored, by name.

use std::path::Path;
use std::process::Output;

use serde_json::{Value, json};

use crate::tool::command;

fn tactus_at(device: &str, folder: &Path, arguments: &[&str]) -> Output {
    command(folder, arguments).env("TACTUS_DEVICE", device).output().unwrap()
}

/// A device that keeps what it is told in a file.
fn tactus(folder: &Path, arguments: &[&str]) -> Output {
    tactus_at("sil:world=simple,flash=arm.flash", folder, arguments)
}

#[track_caller]
fn object(folder: &Path, arguments: &[&str], exit: i32) -> Value {
    let output = tactus(folder, &[&["--json"], arguments].concat());
    assert_eq!(output.status.code(), Some(exit), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[track_caller]
fn refused(folder: &Path, arguments: &[&str], code: &str, words: &str) {
    let before = object(folder, &["config", "get"], 0);
    let output = tactus(folder, arguments);
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(told.contains(code) && told.contains(words) && !output.status.success(), "{arguments:?}: {told}");
    assert_eq!(object(folder, &["config", "get"], 0), before, "{arguments:?}: nothing has changed");
}

#[test]
fn cli_11_settings_are_read_changed_compared_and_restored_with_a_report_of_differences() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    // Nothing is kept: the model's values count.
    let fresh = object(folder, &["config", "get", "home.stored", "home.joint_4_rad", "weight.stored"], 0);
    let expected = json!({ "home.joint_4_rad": null, "home.stored": false, "weight.stored": false });
    assert_eq!(fresh["settings"], expected);
    object(folder, &["config", "dump", "-o", "fresh.toml"], 0);

    let set = object(folder, &["config", "set", "home.joint_4_rad=3.1", "weight.link_2_mass_share=0.03"], 0);
    let changes = set["changes"].as_array().unwrap();
    let change = |key: &str| changes.iter().find(|change| change["key"] == key).unwrap_or(&Value::Null).clone();
    assert_eq!(change("home.joint_4_rad"), json!({ "key": "home.joint_4_rad", "before": null, "after": 3.1 }));
    assert_eq!(change("home.stored"), json!({ "key": "home.stored", "before": false, "after": true }));
    assert_eq!(changes.len(), 8 + 30, "with home and weight all their numbers are kept: {changes:?}");

    // Another process, another start of the device: kept. The calibration's own commands say the same.
    let home = object(folder, &["calibrate", "show"], 0);
    assert!((home["home_rad"][3].as_f64().unwrap() - 3.1).abs() < 1e-6 && home["stored"] == true, "{home}");
    object(folder, &["config", "dump", "-o", "arm.toml"], 0);
    let same = object(folder, &["config", "diff", "arm.toml"], 0);
    assert_eq!((&same["changes"], &same["missing"]), (&json!([]), &json!([])));

    object(folder, &["config", "set", "home.joint_4_rad=3.12"], 0);
    let differs = object(folder, &["config", "diff", "arm.toml"], 6);
    let difference = json!([{ "key": "home.joint_4_rad", "before": 3.12, "after": 3.1 }]);
    assert_eq!((&differs["error"]["code"], &differs["result"]["changes"]), (&json!("E647"), &difference));
    let restored = object(folder, &["config", "restore", "arm.toml"], 0);
    assert_eq!(restored["changes"], difference);
    assert_eq!(object(folder, &["config", "diff", "arm.toml"], 0)["changes"], json!([]));
    assert_eq!(object(folder, &["config", "restore", "arm.toml"], 0)["changes"], json!([]), "nothing to change");

    // A file of a device that keeps nothing has the device forget.
    object(folder, &["config", "restore", "fresh.toml"], 0);
    assert_eq!(object(folder, &["config", "get", "home.stored", "weight.stored"], 0)["settings"]["home.stored"], false);
    assert_eq!(object(folder, &["config", "diff", "fresh.toml"], 0)["changes"], json!([]));
}

#[test]
fn cli_11_what_cannot_be_restored_is_named_and_nothing_changes() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    object(folder, &["config", "set", "home.joint_2_rad=-1.95", "weight.with_hand=true"], 0);
    object(folder, &["config", "dump", "-o", "arm.toml"], 0);
    let text = std::fs::read_to_string(folder.join("arm.toml")).unwrap();
    let file = |name: &str, from: &str, to: &str| {
        assert!(text.contains(from), "{from}: {text}");
        std::fs::write(folder.join(name), text.replacen(from, to, 1)).unwrap();
    };
    file("unknown.toml", "joint_2_rad", "joint_2_deg");
    refused(folder, &["config", "restore", "unknown.toml"], "E645", "home.joint_2_deg");
    file("impossible.toml", "joint_2_rad = -1.95", "joint_2_rad = 1.95");
    refused(folder, &["config", "restore", "impossible.toml"], "E645", "J2 is more than 0.35 rad");
    file("nan.toml", "joint_2_rad = -1.95", "joint_2_rad = nan");
    refused(folder, &["config", "restore", "nan.toml"], "E645", "J2 is not a number");
    // The first half of the file is sound: it is not restored without the second.
    file("weight.toml", "link_7_shift_z_m = 0.0", "link_7_shift_z_m = 9.0");
    std::fs::write(
        folder.join("half.toml"),
        std::fs::read_to_string(folder.join("weight.toml")).unwrap().replace("-1.95", "-1.93"),
    )
    .unwrap();
    refused(folder, &["config", "restore", "half.toml"], "E645", "link 7");
    file("model.toml", "model = \"0x", "model = \"0xf");
    refused(folder, &["config", "restore", "model.toml", "--force"], "E432", "robot model");
    refused(folder, &["config", "restore", "nowhere.toml"], "E233", "nowhere.toml");
    refused(folder, &["config", "set", "home.joint_9_rad=0"], "E238", "home.joint_9_rad");
    refused(folder, &["config", "set", "home.joint_1_rad"], "E238", "no `=`");
    refused(folder, &["config", "set", "home.joint_1_rad=far"], "E238", "far");
    refused(folder, &["config", "set", "home.joint_1_rad=0.1", "home.stored=false"], "E238", "contradicts");
    refused(folder, &["config", "get", "elbow"], "E238", "elbow");

    // A key that is not in the file keeps its value, and is told.
    file("short.toml", "joint_2_rad = -1.95\n", "");
    object(folder, &["config", "set", "home.joint_2_rad=-1.96", "home.joint_1_rad=0.01"], 0);
    let restored = object(folder, &["config", "restore", "short.toml"], 0);
    assert_eq!(restored["missing"], json!(["home.joint_2_rad"]));
    let read = object(folder, &["config", "get", "home.joint_1_rad", "home.joint_2_rad"], 0);
    assert_eq!(read["settings"], json!({ "home.joint_1_rad": 0.0, "home.joint_2_rad": -1.96 }));
}

#[test]
fn cli_11_another_arms_settings_need_force() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    object(folder, &["config", "set", "home.joint_2_rad=-1.95"], 0);
    object(folder, &["config", "dump", "-o", "arm.toml"], 0);
    let text = std::fs::read_to_string(folder.join("arm.toml")).unwrap();
    let other = text.replace("serial = \"simulated\"", "serial = \"WAM-7\"").replace("-1.95", "-1.9");
    std::fs::write(folder.join("other.toml"), &other).unwrap();
    refused(folder, &["config", "restore", "other.toml"], "E646", "'WAM-7', this is 'simulated'");
    refused(folder, &["config", "restore", "other.toml"], "E646", "board: `tactus config restore other.toml --force`");
    let forced = object(folder, &["config", "restore", "other.toml", "--force"], 0);
    assert_eq!(forced["changes"], json!([{ "key": "home.joint_2_rad", "before": -1.95, "after": -1.9 }]));
}

#[test]
fn cli_11_a_file_that_is_written_anew_keeps_its_comments_and_nothing_is_replaced_unasked() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    object(folder, &["config", "set", "home.joint_2_rad=-1.95"], 0);
    object(folder, &["config", "dump", "-o", "arm.toml"], 0);
    let path = folder.join("arm.toml");
    let noted = std::fs::read_to_string(&path).unwrap().replace("= -1.95", "= -1.95 # after the new cable");
    std::fs::write(&path, &noted).unwrap();
    object(folder, &["config", "set", "home.joint_2_rad=-1.9"], 0);
    refused(folder, &["config", "dump", "-o", "arm.toml"], "E230", "exists");
    assert_eq!(std::fs::read_to_string(&path).unwrap(), noted);
    object(folder, &["config", "dump", "-o", "arm.toml", "--force"], 0);
    assert_eq!(std::fs::read_to_string(&path).unwrap(), noted.replace("= -1.95 #", "= -1.9 #"));
    // What is no file of settings is not written over, whatever is forced.
    std::fs::write(folder.join("notes.txt"), "mine").unwrap();
    refused(folder, &["config", "dump", "-o", "notes.txt", "--force"], "E645", "");
    assert_eq!(std::fs::read_to_string(folder.join("notes.txt")).unwrap(), "mine");

    // To standard output: the same text as in the file, without the comments.
    let plain = tactus(folder, &["config", "dump"]);
    assert_eq!(
        String::from_utf8(plain.stdout).unwrap().trim(),
        noted.replace("-1.95 # after the new cable", "-1.9").trim()
    );
}
