//! `tactus flash` and `tactus logs`, with a stand-in for probe-rs that writes down what it was asked to do.
#![cfg(unix)]

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use assert_cmd::assert::Assert;
use link::ImageMetadata;
use link::metadata::MemoryRegion;

use crate::elf::{elf, real};
use crate::tool::{command, judge, stderr, stdout};

/// A folder with an image and, if `status` is given, a probe-rs that ends with it.
fn laboratory(image: &[u8], status: Option<u8>) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("arm.elf"), image).unwrap();
    fs::create_dir(folder.path().join("bin")).unwrap();
    if let Some(status) = status {
        for program in ["probe-rs", "defmt-print"] {
            stand_in(folder.path(), program, status);
        }
    }
    folder
}

/// A program that writes down its arguments, and what it reads, and ends with `status`.
fn stand_in(folder: &Path, program: &str, status: u8) {
    let path = folder.join("bin").join(program);
    let calls = folder.join("calls");
    let script = format!("#!/bin/sh\necho {program} \"$@\" >> {0}\n/bin/cat >> {0}\nexit {status}\n", calls.display());
    fs::write(&path, script).unwrap();
    fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
}

/// The calls that the stand-ins received.
fn calls(folder: &Path) -> Vec<String> {
    let text = fs::read_to_string(folder.join("calls")).unwrap_or_default();
    text.lines().map(str::to_owned).collect()
}

fn tactus(folder: &Path, arguments: &[&str]) -> Assert {
    let mut command = command(folder, arguments);
    command.env("PATH", folder.join("bin"));
    judge(command)
}

#[test]
fn cli_16_an_image_is_written_verified_and_started_and_every_command_is_shown() {
    let folder = laboratory(&elf(Some(&real().encode()), 0x0800_0000), Some(0));
    let done = tactus(folder.path(), &["flash", "--image", "arm.elf"]).success();
    let expected = ["probe-rs download --chip STM32H743ZITx --verify arm.elf", "probe-rs reset --chip STM32H743ZITx"];
    assert_eq!(calls(folder.path()), expected);
    assert_eq!(stderr(&done).lines().collect::<Vec<_>>(), expected);
    let text = stdout(&done);
    assert!(text.contains("nucleo-h743zi2") && text.contains("0.1.0 (1a2b3c4)"), "{text}");
    assert!(text.ends_with("stored primitives were left alone\n"), "{text}");
}

#[test]
fn cli_16_nothing_that_is_run_could_erase_the_stored_primitives() {
    let folder = laboratory(&elf(Some(&real().encode()), 0x0800_0000), Some(0));
    tactus(folder.path(), &["flash", "--image", "arm.elf", "--probe", "0483:374e"]).success();
    for call in calls(folder.path()) {
        assert!(!call.contains("erase") && !call.contains("restore"), "{call}");
        assert!(call.contains("--probe 0483:374e"), "{call}");
    }
}

#[test]
fn a_dry_run_touches_no_probe_and_needs_none() {
    let folder = laboratory(&elf(Some(&real().encode()), 0x0800_0000), None);
    let done = tactus(folder.path(), &["--json", "flash", "--image", "arm.elf", "--dry-run"]).success();
    let report: serde_json::Value = serde_json::from_str(&stdout(&done)).unwrap();
    assert_eq!(report["written"], false);
    assert_eq!(report["chip"], "STM32H743ZITx");
    assert_eq!(report["model_hash"], "0x12345678");
    assert_eq!(report["bytes"], 64);
    assert_eq!(report["commands"][0], "probe-rs download --chip STM32H743ZITx --verify arm.elf");
    assert!(calls(folder.path()).is_empty());
}

#[test]
fn a_missing_probe_rs_is_an_error_that_says_how_to_get_it() {
    let folder = laboratory(&elf(Some(&real().encode()), 0x0800_0000), None);
    let refused = tactus(folder.path(), &["flash", "--image", "arm.elf"]).code(3);
    let text = stderr(&refused);
    assert!(text.contains("error[E330]") && text.contains("cargo install probe-rs-tools --locked"), "{text}");
}

#[test]
fn a_probe_that_fails_stops_before_anything_is_started() {
    let folder = laboratory(&elf(Some(&real().encode()), 0x0800_0000), Some(1));
    let refused = tactus(folder.path(), &["flash", "--image", "arm.elf"]).code(3);
    assert!(stderr(&refused).contains("error[E331]"), "{}", stderr(&refused));
    assert_eq!(calls(folder.path()).len(), 1, "no reset after a download that failed");
}

#[test]
fn an_image_for_the_emulator_is_never_flashed() {
    let emulated = ImageMetadata { simulated: true, board: "mps2-an500", store: None, ..real() };
    let folder = laboratory(&elf(Some(&emulated.encode()), 0x0800_0000), Some(0));
    let refused = tactus(folder.path(), &["flash", "--image", "arm.elf"]).code(6);
    assert!(stderr(&refused).contains("error[E682]"), "{}", stderr(&refused));
    assert!(calls(folder.path()).is_empty());
}

#[test]
fn an_image_that_reaches_into_the_store_is_refused() {
    for address in [0x080F_FFE0, 0x0810_0000, 0x2000_0000] {
        let folder = laboratory(&elf(Some(&real().encode()), address), Some(0));
        let refused = tactus(folder.path(), &["flash", "--image", "arm.elf"]).code(6);
        assert!(stderr(&refused).contains("error[E683]"), "{address:#x}: {}", stderr(&refused));
        assert!(calls(folder.path()).is_empty());
    }
    let greedy = ImageMetadata { image: MemoryRegion { start: 0x0800_0000, length: 0x20_0000 }, ..real() };
    let folder = laboratory(&elf(Some(&greedy.encode()), 0x0800_0000), Some(0));
    let refused = tactus(folder.path(), &["flash", "--image", "arm.elf"]).code(6);
    assert!(stderr(&refused).contains("error[E683]"), "{}", stderr(&refused));
}

#[test]
fn files_that_are_no_images_are_refused_by_name() {
    let mut damaged = real().encode();
    damaged[60] ^= 1;
    let files: [&[u8]; 4] =
        [b"not an image", &elf(None, 0x0800_0000), &elf(Some(&damaged), 0x0800_0000), &elf(Some(b"TACTUS"), 0)];
    for file in files {
        let folder = laboratory(file, Some(0));
        let refused = tactus(folder.path(), &["flash", "--image", "arm.elf"]).code(6);
        let text = stderr(&refused);
        assert!(text.contains("error[E681]") && text.contains("arm.elf") && text.contains("help: "), "{text}");
    }
    let folder = laboratory(b"", Some(0));
    // A missing file is a wrong command line, as for every command.
    let missing = tactus(folder.path(), &["flash", "--image", "elsewhere.elf"]).code(2);
    assert!(stderr(&missing).contains("error[E233]"), "{}", stderr(&missing));
}

#[test]
fn a_device_that_runs_another_image_is_noticed_after_flashing() {
    let folder = laboratory(&elf(Some(&real().encode()), 0x0800_0000), Some(0));
    let refused = tactus(folder.path(), &["--device", "sil:world=simple", "flash", "--image", "arm.elf"]).code(4);
    let text = stderr(&refused);
    assert!(text.contains("error[E413]") && text.contains("0.1.0 (1a2b3c4)"), "{text}");
}

#[test]
fn logs_attach_only_when_told_that_this_may_restart_the_board() {
    let folder = laboratory(&elf(Some(&real().encode()), 0x0800_0000), Some(0));
    let refused = tactus(folder.path(), &["logs", "--image", "arm.elf"]).code(2);
    let text = stderr(&refused);
    assert!(text.contains("error[E223]") && text.contains("watchdog") && text.contains("--attach-may-reset"), "{text}");
    tactus(folder.path(), &["logs", "--image", "arm.elf", "--dry-run"]).success();
    assert!(calls(folder.path()).is_empty(), "the probe was touched without consent");
    tactus(folder.path(), &["logs", "--image", "arm.elf", "--attach-may-reset"]).success();
    // Once attached: no halt at a fault or a reset.
    let expected = "probe-rs attach --chip STM32H743ZITx --no-catch-hardfault --no-catch-reset arm.elf";
    assert_eq!(calls(folder.path()), [expected]);
}

#[test]
fn a_log_kept_in_a_file_is_decoded_with_its_image() {
    let emulated = ImageMetadata { simulated: true, board: "mps2-an500", store: None, ..real() };
    let folder = laboratory(&elf(Some(&emulated.encode()), 0), Some(0));
    fs::write(folder.path().join("run.log"), "frames\n").unwrap();
    tactus(folder.path(), &["logs", "--image", "arm.elf", "--file", "run.log"]).success();
    assert_eq!(calls(folder.path()), ["defmt-print -e arm.elf", "frames"]);
    let refused = tactus(folder.path(), &["logs", "--image", "arm.elf", "--file", "none.log"]).code(6);
    assert!(stderr(&refused).contains("error[E684]"));
}
