//! An image that a device's flash has lost is told by `tactus list` and `tactus status`, and an upload brings it back.

use std::path::Path;

use serde_json::{Value, json};

use crate::common;
use crate::tool::tactus;

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
