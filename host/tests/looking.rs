//! Commands that only tell: reports of runs, the meaning of codes, completions. None of them needs a device.

use crate::common;
use crate::tool::{judged as tactus, stderr, stdout};

#[test]
fn a_report_is_written_once_and_replaced_only_when_told_to() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    common::demonstration(folder, 3.0);
    tactus(folder, &["learn", "demo.csv", "-o", "reach.toml"]).success();
    let report = ["report", "demo.csv", "--primitive", "reach.toml", "-o", "page.html"];
    let written = tactus(folder, &report).success();
    assert_eq!(stdout(&written), "demo.csv: no movement was played\nwrote page.html\n");
    let page = std::fs::read_to_string(folder.join("page.html")).unwrap();
    assert!(page.starts_with("<!DOCTYPE html>") && page.contains("<title>reach</title>"));

    std::fs::write(folder.join("page.html"), "mine").unwrap();
    assert!(stderr(&tactus(folder, &report).code(2)).contains("E230"));
    assert_eq!(std::fs::read_to_string(folder.join("page.html")).unwrap(), "mine");
    tactus(folder, &[&report[..], &["--force"]].concat()).success();
    assert_eq!(std::fs::read_to_string(folder.join("page.html")).unwrap(), page, "the same input, the same page");

    assert!(stderr(&tactus(folder, &["report", "reach.toml", "-o", "other.html"]).code(6)).contains("E610"));
    // Joint angles alone do not tell how a run ended, nor that there was one.
    let demonstration = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/examples/reach.csv");
    let refused = stderr(&tactus(folder, &["report", demonstration, "-o", "other.html"]).code(6));
    assert!(refused.contains("missing columns state, phase") && refused.contains("tactus run --record"), "{refused}");
    assert!(!folder.join("other.html").exists());
}

/// The changes that make it fail: `once_each` gives all that it got, `tell_apart` is not called.
#[test]
fn a_run_that_is_given_twice_is_reported_once_and_runs_of_one_name_are_told_apart() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for name in ["one", "two"] {
        std::fs::create_dir(folder.join(name)).unwrap();
        std::fs::write(folder.join(name).join("run.csv"), common::text(&common::rows(3.0))).unwrap();
    }
    let told = tactus(folder, &["report", "one/run.csv", "two/run.csv", "one/../one/run.csv"]).success();
    assert_eq!(stderr(&told), "warning: one/../one/run.csv is given twice: it is drawn once\n");
    let lines = ["one/run.csv: no movement was played", "two/run.csv: no movement was played", "wrote report.html\n"];
    assert_eq!(stdout(&told), lines.join("\n"));
}

/// The change that makes it fail: a recording of two runs is looked at without a word.
#[test]
fn who_looks_at_a_recording_of_two_runs_is_told_that_the_last_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut rows = common::rows(3.0);
    for row in &mut rows {
        let run = [0.5..1.5, 2.5..3.5].iter().any(|played| played.contains(&row.time));
        row.telemetry.state = if run { control::State::Run } else { control::State::Hold }.code();
    }
    std::fs::write(folder.join("two.csv"), common::text(&rows)).unwrap();
    let commands: [&[&str]; 3] = [
        &["report", "two.csv", "-o", "page.html"],
        &["compare", "two.csv", "two.csv"],
        &["plot", "--run", "two.csv", "-o", "figure.svg"],
    ];
    for command in commands {
        let told = tactus(folder, command).success();
        assert!(
            stderr(&told).contains("two.csv holds 2 runs: the last one is taken"),
            "{command:?}: {}",
            stderr(&told)
        );
    }
    let compared: serde_json::Value =
        serde_json::from_str(&stdout(&tactus(folder, &["--json", "compare", "two.csv", "two.csv"]).success())).unwrap();
    assert_eq!(compared["whole"]["samples"], 300);
}

#[test]
fn cli_2_codes_and_faults_are_explained_without_a_device() {
    let folder = tempfile::tempdir().unwrap();
    let explained = |code: &str| stdout(&tactus(folder.path(), &["explain", code]).success());
    assert!(
        explained("E504").starts_with("E504: another host is connected to the device\n  help: end the program there")
    );
    assert_eq!(explained("504"), explained("e504"));
    assert!(explained("E702").contains("usual cause: no power"));
    assert!(explained("contactforce").starts_with("ContactForce: the contact force"));
    // A recording has the number of a fault.
    assert_eq!(explained("9"), explained("ContactForce"));
    for unknown in ["E999", "None", "0", "99", "", "E", "99999999"] {
        assert!(stderr(&tactus(folder.path(), &["explain", unknown]).code(2)).contains("E241"), "{unknown}");
    }
}

#[test]
fn cli_18_shells_complete_every_command() {
    let folder = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish"] {
        let text = stdout(&tactus(folder.path(), &["completions", shell]).success());
        assert!(["monitor", "rename", "explain"].iter().all(|word| text.contains(word)), "{shell}");
        let told = stdout(&tactus(folder.path(), &["completions", "--json", shell]).success());
        let told: serde_json::Value = serde_json::from_str(&told).expect("one object and nothing else");
        assert_eq!((told["shell"].as_str(), told["script"].as_str()), (Some(shell), Some(text.as_str())));
    }
}

#[test]
fn the_monitor_wants_a_terminal_or_json_before_it_looks_for_a_device() {
    let folder = tempfile::tempdir().unwrap();
    assert!(stderr(&tactus(folder.path(), &["monitor"]).code(2)).contains("E240"));
}

#[test]
fn cli_18_every_command_has_a_page_of_the_manual() {
    let folder = tempfile::tempdir().unwrap();
    let told = tactus(folder.path(), &["manual", "man1", "--json"]).success();
    let told: serde_json::Value = serde_json::from_str(&stdout(&told)).unwrap();
    let page = |name: &str| std::fs::read_to_string(folder.path().join("man1").join(name)).unwrap_or_default();
    assert!(page("tactus.1").contains("tactus\\-run(1)"), "the first page leads to the others");
    assert!(
        page("tactus-run.1").contains("Play a primitive on the arm") && page("tactus-run.1").contains("\\-\\-speed")
    );
    // Commands of commands, too.
    assert!(page("tactus-can-decode.1").contains("NAME"));
    let pages = std::fs::read_dir(folder.path().join("man1")).unwrap().count();
    assert_eq!(told["pages"].as_array().unwrap().len(), pages, "{told}");
    let help = stdout(&tactus(folder.path(), &["--help-all"]).success());
    let commands = help.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    for command in commands.filter_map(|line| line.strip_prefix("  ")?.split_whitespace().next()) {
        assert!(command == "help" || !page(&format!("tactus-{command}.1")).is_empty(), "no page of {command}");
    }

    std::fs::write(folder.path().join("man1/tactus.1"), "mine").unwrap();
    assert!(stderr(&tactus(folder.path(), &["manual", "man1"]).code(2)).contains("E230"));
    assert_eq!(page("tactus.1"), "mine");
    tactus(folder.path(), &["manual", "man1", "--force"]).success();
    assert_ne!(page("tactus.1"), "mine");
}

#[test]
fn a_folder_of_the_manual_that_is_a_file_is_named_and_kept() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("man1"), "mine").unwrap();
    for name in ["man1", "man1/deeper"] {
        let said = stderr(&tactus(folder.path(), &["manual", name]).code(2));
        assert!(said.starts_with("error[E23") && said.contains(name), "{said}");
    }
    assert_eq!(std::fs::read_to_string(folder.path().join("man1")).unwrap(), "mine");
}
