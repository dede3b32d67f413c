//! A run leaves a folder with everything about it, whatever its end, and one that does not move leaves none.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::tool::{judged as tactus, learned, names};

/// The only folder in `runs`.
fn only(base: &Path) -> PathBuf {
    let names = names(base);
    assert_eq!(names.len(), 1, "{names:?}");
    base.join(&names[0])
}

const DEVICE: &str = "--device sil:world=simple --non-interactive";

#[test]
fn a_run_is_kept_with_primitive_recording_result_and_report_and_all_of_them_can_be_used() {
    let folder = learned(3.0);
    let at = folder.path();
    tactus(at, &format!("{DEVICE} run reach.toml --keep --dry-run")).success();
    assert!(!at.join("runs").exists(), "nothing moved, nothing is kept");

    let ran = tactus(at, &format!("{DEVICE} --json run reach.toml --keep --speed 1.5")).success();
    let report: Value = serde_json::from_slice(&ran.get_output().stdout).unwrap();
    let kept = only(&at.join("runs"));
    assert_eq!(report["folder"].as_str().map(|folder| at.join(folder)), Some(kept.clone()));
    assert!(kept.file_name().unwrap().to_str().unwrap().ends_with("-reach"), "{}", kept.display());
    assert_eq!(names(&kept), ["primitive.toml", "report.html", "run.csv", "run.json"]);
    let told: Value = serde_json::from_slice(&std::fs::read(kept.join("run.json")).unwrap()).unwrap();
    assert_eq!((&told["schema"], &told["result"]["name"]), (&"tactus-run/1".into(), &"reach".into()));
    assert_eq!(told["device"]["serial"], "simulated");
    assert!(told["command"].as_array().unwrap().iter().any(|word| word == "1.5"), "{}", told["command"]);
    let sum = |file: &str| {
        let checked = tactus(at, &format!("--json check {file}")).success();
        serde_json::from_slice::<Value>(&checked.get_output().stdout).unwrap()["image"][1].clone()
    };
    let inside = |name: &str| kept.join(name).display().to_string();
    assert_eq!(sum(&inside("primitive.toml")), sum("reach.toml"), "the very movement that ran");
    tactus(at, &format!("compare {} {}", inside("run.csv"), inside("run.csv"))).success();
    assert!(std::fs::read_to_string(kept.join("report.html")).unwrap().contains("arrived, and held the goal"));
    tactus(at, &format!("{DEVICE} run reach.toml --keep --record run.csv")).code(2);
}

#[test]
fn a_run_that_fails_is_kept_as_well_with_its_failure_and_what_was_recorded() {
    let folder = learned(3.0);
    let at = folder.path();
    let script = "[[scenario]]\nname = \"a stuck encoder\"\nfrom = \"run\"\n\
        inject = [{ at = 8.5, what.freeze = { kind = \"position\", from = [4] } }]\n";
    std::fs::write(at.join("stuck.toml"), script).unwrap();
    let line = "--device sil:world=simple,faults=stuck.toml --non-interactive --json run reach.toml --keep here";
    let failed = tactus(at, line).failure().code(5);
    let told: Value = serde_json::from_slice(&failed.get_output().stdout).unwrap();
    let kept = only(&at.join("here"));
    assert_eq!(names(&kept), ["primitive.toml", "report.html", "run.csv", "run.json"], "{told}");
    assert_eq!(told["error"]["kept"].as_str().map(|file| at.join(file)), Some(kept.join("run.csv")));
    let written: Value = serde_json::from_slice(&std::fs::read(kept.join("run.json")).unwrap()).unwrap();
    assert_eq!(written["error"], told["error"]);
    let page = std::fs::read_to_string(kept.join("report.html")).unwrap();
    assert!(page.contains("stopped by a fault (EncoderStuck)"), "the page names the fault");
    let said = String::from_utf8_lossy(&failed.get_output().stderr).into_owned();
    assert!(said.contains("everything about this run is in here"), "{said}");
}

/// The change that makes it fail: the folder is made behind the upload.
#[test]
fn a_folder_that_cannot_be_made_is_told_before_anything_is_sent() {
    let folder = learned(3.0);
    let at = folder.path();
    std::fs::write(at.join("runs"), "a file").unwrap();
    for (place, words) in [("", "making the folder runs: a file has that name"), (" /proc/runs", "/proc/runs")] {
        let refused = tactus(at, &format!("{DEVICE} run reach.toml --keep{place}")).failure().code(2);
        let said = String::from_utf8_lossy(&refused.get_output().stderr).into_owned();
        assert!(said.contains("run refused: ") && said.contains(words), "{said}");
        assert!(!said.contains("is in the device") && !said.contains("running 'reach'"), "{said}");
    }
    assert_eq!(std::fs::read_to_string(at.join("runs")).unwrap(), "a file");
}

/// The change that makes it fail: nobody calls `discard`.
#[test]
fn a_run_whose_primitive_the_device_does_not_take_leaves_no_folder() {
    let folder = learned(3.0);
    let at = folder.path();
    let device = "--device sil:world=simple,flash=arm.flash --non-interactive";
    tactus(at, "secret new lab.secret").success();
    tactus(at, &format!("{device} secret set lab.secret")).success();
    tactus(at, &format!("{device} run reach.toml --keep")).failure().code(5);
    assert_eq!(names(&at.join("runs")), Vec::<String>::new());
    tactus(at, &format!("{device} --secret-file lab.secret run reach.toml --keep")).success();
    assert_eq!(names(&only(&at.join("runs"))).len(), 4);
}

/// The change that makes it fail: `hint` gives nothing, or does not look at what is a folder.
#[test]
fn a_primitive_that_an_option_has_taken_for_its_folder_is_told_with_the_line_to_type() {
    let folder = learned(3.0);
    let at = folder.path();
    let told = |line: &str| {
        let refused = tactus(at, line).failure().code(2);
        let output = refused.get_output();
        let data = serde_json::from_slice::<Value>(&output.stdout).unwrap_or_default();
        (String::from_utf8_lossy(&output.stderr).into_owned(), data["error"]["help"].as_str().unwrap_or("").to_owned())
    };
    let hint = "`--keep` took reach.toml as its folder: `tactus --json run reach.toml --keep --speed 1.5`";
    let (said, help) = told("--json run --keep reach.toml --speed 1.5");
    assert!(said.contains(&format!("  help: {hint}")) && help == hint, "{said}: {help}");
    std::fs::create_dir(at.join("runs")).unwrap();
    for line in
        ["--json run --keep runs", "--json run --keep", "--json run --speed 1.5", "--json run --keep a --sped 1"]
    {
        let (said, help) = told(line);
        assert!(!said.contains("as its folder") && !help.contains("as its folder"), "{line}: {said}: {help}");
    }
}
