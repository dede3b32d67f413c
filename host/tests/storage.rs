//! An image that a device's flash has lost is told by `tactus list` and `tactus status`, and an upload brings it back.

use std::path::Path;

use serde_json::{Value, json};

use crate::common;
use crate::tool::{Refusal, learned, refusal, said, succeeds, tactus};

const DEVICE: &str = "--device sil:world=simple,flash=arm.flash --non-interactive";

#[track_caller]
fn words(folder: &Path, line: &str) -> String {
    let output = tactus(folder, line);
    assert!(output.status.success(), "{line}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[track_caller]
fn told(folder: &Path, command: &str) -> Value {
    serde_json::from_str(&words(folder, &format!("{DEVICE} --json {command}"))).unwrap()
}

#[test]
fn h11_an_image_that_the_flash_has_lost_is_named_and_an_upload_brings_it_back() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    common::demonstration(at, 3.0);
    words(at, "learn demo.csv -o reach.toml");
    words(at, &format!("{DEVICE} upload reach.toml"));
    words(at, &format!("{DEVICE} rename reach grasp"));
    words(at, &format!("{DEVICE} upload reach.toml"));
    words(at, &format!("{DEVICE} calibrate payload hand"));
    let sound = json!({
        "works": true, "formatted": false, "bad_sector": null, "lost": [], "settings_lost": [], "unread": 0
    });
    assert_eq!(told(at, "list")["storage"], sound);

    // A bit falls over in the weights of the last image, and one in what was declared.
    let mut flash = std::fs::read(at.join("arm.flash")).unwrap();
    let find = |what: &[u8]| flash.windows(what.len()).rposition(|bytes| bytes == what).unwrap();
    let (image, weight) = (find(b"TACP") + 1000, find(b"TacW") + 30);
    flash[image] ^= 0x10;
    flash[weight] ^= 0x10;
    std::fs::write(at.join("arm.flash"), flash).unwrap();

    for command in ["list", "status"] {
        let storage = told(at, command)["storage"].clone();
        assert_eq!(storage["lost"], json!([{ "place": 1, "name": "reach", "older": false }]), "{command}");
        assert_eq!(storage["settings_lost"], json!(["weight"]), "{command}");
        let said = words(at, &format!("{DEVICE} {command}"));
        for word in ["'reach' of place 1 is lost: `tactus upload`", "`tactus config restore FILE`"] {
            assert!(said.contains(word), "{command}: {said}");
        }
    }
    words(at, &format!("{DEVICE} upload reach.toml"));
    words(at, &format!("{DEVICE} calibrate payload hand"));
    assert_eq!(told(at, "status")["storage"], sound);
    let stored = told(at, "list")["primitives"].as_array().unwrap().len();
    assert_eq!(stored, 2);
}

/// Damages the last value of the flash that begins in this way.
fn damage(file: &Path, begins: &[u8], offset: usize) {
    let mut flash = std::fs::read(file).unwrap();
    let place = flash.windows(begins.len()).rposition(|bytes| bytes == begins).unwrap();
    flash[place + offset] ^= 0x10;
    std::fs::write(file, flash).unwrap();
}

/// `run reach` played the older image without a word, and of one that was lost as a whole it was said that there is
/// none.
///
/// The changes that make it fail: `run` takes what `get` takes; `get::failure` does not ask for losses.
#[test]
fn h11_a_run_by_name_does_not_play_an_image_of_before_and_tells_of_a_lost_one() {
    let folder = learned(3.0);
    let at = folder.path();
    succeeds(at, "learn demo.csv --name reach --kernels 30 -o newer.toml");
    succeeds(at, &format!("{DEVICE} upload reach.toml"));
    succeeds(at, &format!("{DEVICE} --force upload newer.toml"));
    damage(&at.join("arm.flash"), b"TACP", 1000);
    let Refusal { exit, code, message, help } = refusal(at, &format!("{DEVICE} --json run reach"));
    assert!(exit == 6 && code == "E656" && message.contains("place 0"), "{code}: {message}");
    assert!(help.contains("`tactus upload FILE`") && help.contains("`tactus get reach`"), "{help}");
    // Whoever wants the one of before gets it, and is told.
    let got = said(&succeeds(at, &format!("{DEVICE} get reach -o before.toml")));
    assert!(got.contains("warning: this is an image of before"), "{got}");
    succeeds(at, &format!("{DEVICE} run before.toml --dry-run"));
    // What was lost last is good again with an upload.
    succeeds(at, &format!("{DEVICE} --force upload newer.toml"));
    succeeds(at, &format!("{DEVICE} run reach --dry-run"));

    let other = "--device sil:world=simple,flash=other.flash --non-interactive";
    succeeds(at, &format!("{other} upload reach.toml"));
    damage(&at.join("other.flash"), b"TACP", 1000);
    for line in ["run reach", "get reach -o a.toml", "delete reach", "rename reach grasp"] {
        let Refusal { code, message, help, .. } = refusal(at, &format!("{other} --json {line}"));
        assert!(code == "E513" && message.contains("is lost ('reach')"), "{line}: {code}: {message}");
        assert!(help.contains("`tactus upload reach.toml` brings it back"), "{line}: {help}");
    }
}

/// A file said of a home that a board has lost that there is none, without a word; restored to the next board it made
/// that one forget its own.
///
/// The change that makes it fail: nobody asks what the device has lost.
#[test]
fn h11_settings_that_the_flash_has_lost_are_told_where_settings_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    succeeds(at, &format!("{DEVICE} config set home.joint_4_rad=3.1"));
    let sound = said(&succeeds(at, &format!("{DEVICE} config dump -o sound.toml")));
    assert!(!sound.contains("warning"), "{sound}");
    damage(&at.join("arm.flash"), b"TacH", 12);
    for line in ["config get", "config dump -o lost.toml", "config dump"] {
        let told = said(&succeeds(at, &format!("{DEVICE} {line}")));
        assert!(told.contains("warning: home: what the device was told last is lost"), "{line}: {told}");
    }
    succeeds(at, &format!("{DEVICE} config restore sound.toml"));
    let told = said(&succeeds(at, &format!("{DEVICE} config get")));
    assert!(!told.contains("warning"), "{told}");
}
