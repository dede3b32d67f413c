//! The commands as a user or a script sees them: exit codes, what is said where, JSON.

use assert_cmd::assert::Assert;
use serde_json::Value;

use crate::common;
use crate::tool::{judged as tactus, stderr, stdout};

fn json(assert: &Assert) -> Value {
    let text = stdout(assert);
    assert_eq!(text.lines().count(), 1, "one object on one line: {text}");
    serde_json::from_str(&text).unwrap()
}

#[test]
fn learn_check_plot_work_one_after_the_other() {
    let folder = tempfile::tempdir().unwrap();
    common::demonstration(folder.path(), 4.0);
    let learned = tactus(folder.path(), &["learn", "demo.csv", "-o", "reach.toml"]).success();
    let text = stdout(&learned);
    assert!(text.starts_with("reach: 50 kernels, "), "{text}");
    assert!(text.contains("posture J7") && text.contains("force z"), "{text}");
    assert_eq!(stderr(&learned), "wrote reach.toml\n");

    let checked = tactus(folder.path(), &["check", "reach.toml"]).success();
    assert!(stdout(&checked).ends_with("passed\n"), "{}", stdout(&checked));
    assert_eq!(stderr(&checked), "");

    let plotted =
        tactus(folder.path(), &["plot", "-d", "demo.csv", "-p", "reach.toml", "-o", "figure.png", "-o", "figure.svg"])
            .success();
    assert_eq!(stdout(&plotted), "figure.png\nfigure.svg\n");
    let png = std::fs::read(folder.path().join("figure.png")).unwrap();
    assert_eq!(&png[..8], b"\x89PNG\r\n\x1a\n");
    assert_eq!(u32::from_be_bytes(png[16..20].try_into().unwrap()), 1600);
    let svg = std::fs::read_to_string(folder.path().join("figure.svg")).unwrap();
    assert!(svg.contains("<svg") && svg.contains("Position x") && svg.contains("demonstration and plan"));
}

#[test]
fn cli_13_json_is_one_object_on_stdout_with_what_the_text_says() {
    let folder = tempfile::tempdir().unwrap();
    common::demonstration(folder.path(), 3.0);
    let learned = json(&tactus(folder.path(), &["--json", "learn", "demo.csv", "--name", "a"]).success());
    assert_eq!(learned["file"], "demo.toml");
    assert_eq!(learned["fit"]["rows"].as_array().unwrap().len(), 17);
    assert!(learned["fit"]["position_rms_m"].as_f64().unwrap() < 1e-3);
    let checked = json(&tactus(folder.path(), &["check", "demo.toml", "--json"]).success());
    assert_eq!(checked["name"], "a");
    assert_eq!(checked["violations"].as_array().unwrap().len(), 0);
    assert_eq!(checked["margins"][5]["limit"], "joint_position");
}

#[test]
fn the_same_input_gives_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    common::demonstration(folder.path(), 3.0);
    let twice: Vec<(Vec<u8>, Vec<u8>, Vec<u8>)> = (0..2)
        .map(|_| {
            let learned = tactus(folder.path(), &["learn", "demo.csv", "--json", "--force"]).success();
            let checked = tactus(folder.path(), &["check", "demo.toml", "--json"]).success();
            let file = std::fs::read(folder.path().join("demo.toml")).unwrap();
            (learned.get_output().stdout.clone(), checked.get_output().stdout.clone(), file)
        })
        .collect();
    assert_eq!(twice[0], twice[1]);
}

#[test]
fn cli_7_a_bad_demonstration_ends_with_6_and_names_file_line_and_column() {
    let folder = tempfile::tempdir().unwrap();
    let file = common::demonstration(folder.path(), 3.0);
    let text = std::fs::read_to_string(&file).unwrap();
    let mut lines: Vec<String> = text.lines().map(String::from).collect();
    let fields: Vec<&str> = lines[99].split(',').collect();
    let mut fields: Vec<String> = fields.into_iter().map(String::from).collect();
    fields[8] = "NaN".to_owned();
    lines[99] = fields.join(",");
    std::fs::write(&file, lines.join("\n")).unwrap();
    let failed = tactus(folder.path(), &["learn", "demo.csv"]).failure().code(6);
    assert_eq!(
        stderr(&failed),
        "error[E620]: learn refused: demo.csv: line 100, column 9 (q3_rad): the value NaN is not finite\n  \
         help: docs/recording-format.md describes the file\n"
    );
    assert_eq!(stdout(&failed), "");
    assert!(!folder.path().join("demo.toml").exists());
    let failed = json(&tactus(folder.path(), &["learn", "demo.csv", "--json"]).failure().code(6));
    assert_eq!(failed["error"]["code"], "E620");
    assert_eq!(failed["error"]["exit"], 6);
}

#[test]
fn a_missing_file_is_a_wrong_command_line_and_the_reason_is_told() {
    let folder = tempfile::tempdir().unwrap();
    for line in [
        &["learn", "nothing.csv"][..],
        &["check", "nothing.csv"],
        &["plot", "-d", "nothing.csv", "-o", "a.png"],
        &["compare", "nothing.csv", "nothing.csv"],
        &["can", "decode", "nothing.csv"],
        &["statistics", "nothing.csv", "nothing.csv"],
    ] {
        let failed = tactus(folder.path(), line).failure().code(2);
        let said = stderr(&failed);
        assert!(said.starts_with("error[E233]") && said.contains("nothing.csv"), "{line:?}: {said}");
        assert!(said.contains("No such file"), "{line:?}: {said}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn a_turn_too_far_ends_with_6_and_the_command_that_helps() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("turn.csv"), common::foreign(4.5)).unwrap();
    let failed = tactus(folder.path(), &["learn", "turn.csv"]).failure().code(6);
    let text = stderr(&failed);
    assert!(text.starts_with("error[E622]: learn refused: turn.csv: line "), "{text}");
    assert!(text.ends_with("help: tactus learn turn.csv --rotation-vector\n"), "{text}");
    let learned = tactus(folder.path(), &["learn", "--rotation-vector", "turn.csv"]).success();
    assert!(stderr(&learned).contains("warning: the recording has no joint angles"));
    // And what the warning says is so.
    let checked = stderr(&tactus(folder.path(), &["check", "turn.toml"]).failure().code(6));
    assert!(checked.contains("does not belong to the start posture"), "{checked}");
}

#[test]
fn the_command_that_helps_keeps_every_option_and_can_be_pasted() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a turn.csv"), common::foreign(4.5)).unwrap();
    let line = ["learn", "a turn.csv", "-o", "turn.toml", "--dwell", "2", "--hand-goal", "0,1,1,1"];
    let said = stderr(&tactus(folder.path(), &line).failure().code(6));
    let help = "help: tactus learn 'a turn.csv' -o turn.toml --dwell 2 --hand-goal 0,1,1,1 --rotation-vector\n";
    assert!(said.ends_with(help), "{said}");
}

#[test]
fn the_help_of_learn_tells_the_sensitivity_that_it_gives() {
    let folder = tempfile::tempdir().unwrap();
    common::demonstration(folder.path(), 3.0);
    tactus(folder.path(), &["learn", "demo.csv"]).success();
    let file = lab::primitive_file::PrimitiveFile::read(&folder.path().join("demo.toml")).unwrap();
    let k1 = &file.feedback.as_ref().unwrap().k1[0];
    let turn = k1[3..6].iter().copied().fold(0.0, f64::max);
    let share = |k1: f64, k: f64| (k1 / k * 1e3).round() / 1e3;
    let position = share(k1[0], file.gains.position.stiffness);
    let fingers = share(k1[9], file.gains.hand.stiffness);
    let help = String::from_utf8(tactus(folder.path(), &["learn", "--help"]).success().get_output().stdout.clone());
    let help = help.unwrap().split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(help.contains(&format!("{position} K in the horizontal")), "{help}");
    assert!(help.contains(&format!("fingers {fingers} K")), "{help}");
    if turn > 0.0 {
        assert!(
            help.contains(&format!("{} K about the vertical", share(turn, file.gains.orientation.stiffness))),
            "{help}"
        );
    }
}

#[test]
fn cli_1_a_changed_primitive_ends_with_6_and_another_model_with_4() {
    let folder = tempfile::tempdir().unwrap();
    common::demonstration(folder.path(), 3.0);
    tactus(folder.path(), &["learn", "demo.csv"]).success();
    let file = folder.path().join("demo.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, text.replacen("alpha = 4.6", "alpha = 4.7", 1)).unwrap();
    let failed = tactus(folder.path(), &["check", "demo.toml"]).failure().code(6);
    assert!(stderr(&failed).starts_with("error[E632]"), "{}", stderr(&failed));
    let hash = format!("0x{:08x}", control::MODEL_HASH);
    let mut other = lab::primitive_file::PrimitiveFile::parse(&file, &text).unwrap();
    other.model_hash ^= 0xff;
    other.write(&file).unwrap();
    let failed = tactus(folder.path(), &["check", "demo.toml"]).failure().code(4);
    assert!(stderr(&failed).starts_with("error[E430]") && stderr(&failed).contains(&hash), "{}", stderr(&failed));
}

#[test]
fn a_violation_ends_with_6_and_the_report_is_still_given() {
    let folder = tempfile::tempdir().unwrap();
    common::demonstration(folder.path(), 1.0);
    tactus(folder.path(), &["learn", "demo.csv"]).success();
    let failed = tactus(folder.path(), &["check", "demo.toml", "--speed", "2"]).failure().code(6);
    assert!(stdout(&failed).contains("violation"), "{}", stdout(&failed));
    assert!(stderr(&failed).contains("error[E631]") && stderr(&failed).contains("--speed 1`"), "{}", stderr(&failed));
    let failed = json(&tactus(folder.path(), &["check", "demo.toml", "--speed", "2", "--json"]).failure().code(6));
    assert!(!failed["result"]["violations"].as_array().unwrap().is_empty());
}

#[test]
fn a_wrong_command_line_ends_with_2() {
    let folder = tempfile::tempdir().unwrap();
    for arguments in [
        &["dance"][..],
        &["learn"],
        &["learn", "demo.csv", "--kernels", "1000"],
        &["learn", "demo.csv", "--hand-goal", "1,2"],
        &["learn", "demo.csv", "--name", "no blanks"],
        &["check", "a.toml", "--speed", "7"],
        &["plot"],
        &["plot", "-o", "figure.png"],
    ] {
        tactus(folder.path(), arguments).failure().code(2);
    }
    common::demonstration(folder.path(), 2.0);
    tactus(folder.path(), &["plot", "-d", "demo.csv", "-o", "figure.gif"]).failure().code(2);
}

#[test]
fn quiet_says_nothing_but_the_result() {
    let folder = tempfile::tempdir().unwrap();
    common::demonstration(folder.path(), 2.0);
    let learned = tactus(folder.path(), &["learn", "demo.csv", "--quiet"]).success();
    assert_eq!(stderr(&learned), "");
    assert!(!stdout(&learned).is_empty());
}

#[test]
fn a_rehearsed_primitive_adapts_and_one_that_was_not_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("demo.csv"), common::text(&common::rows(3.0))).unwrap();
    tactus(at, &["learn", "demo.csv", "-o", "grasp.toml"]).success();
    let device = ["--device", "sil:world=simple", "--quiet", "--json"];
    let refused = tactus(at, &[&device[..], &["run", "grasp.toml", "--mode", "adapt"]].concat()).failure().code(6);
    assert!(stderr(&refused).contains("tactus rehearse grasp.toml"), "{}", stderr(&refused));

    let rehearsed = tactus(at, &[&device[..], &["rehearse", "grasp.toml", "--record-dir", "kept"]].concat()).success();
    let report = json(&rehearsed);
    assert_eq!(report["expectation"]["trials"], 3);
    assert_eq!(report["weighted"], true);
    assert!(at.join("kept/grasp-3.csv").is_file());
    let run = ["run", "grasp.toml", "--mode", "adapt", "--speed-at", "1:0.8", "--record", "run.csv"];
    let run = json(&tactus(at, &[&device[..], &run].concat()).success());
    assert_eq!((&run["mode"], &run["flags"]["stale"]), (&"adapt".into(), &0.into()));
    // In free motion the adaptation finds nothing to do.
    assert!(run["tracking"]["position_max_m"].as_f64().unwrap() < 0.05, "{run}");

    let kept = ["kept/grasp-1.csv", "kept/grasp-2.csv", "kept/grasp-3.csv"];
    let gathered = json(&tactus(at, &[&["--json", "statistics", "grasp.toml"][..], &kept].concat()).success());
    assert_eq!(gathered["statistics"]["trials"], 3);
    // A run whose speed was changed on the way is no run of the same duration. The command's former name still works.
    tactus(at, &["experience", "grasp.toml", kept[0], "run.csv"]).failure().code(6);
}
