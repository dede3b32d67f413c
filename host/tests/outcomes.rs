//! "Ok" is true: a command that ends with 0 did what was asked, and one that did not says by how much.

use assert_cmd::Command;
use assert_cmd::assert::Assert;
use serde_json::Value;

use crate::common;
use crate::tool::{judged as tactus, stderr};

fn json(assert: &Assert) -> Value {
    serde_json::from_slice(&assert.get_output().stdout).unwrap()
}

fn learned(duration: f64, options: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    common::demonstration(folder.path(), duration);
    tactus(folder.path(), &format!("learn demo.csv -o reach.toml {options}")).success();
    folder
}

const DEVICE: &str = "--device sil:world=simple --non-interactive";

#[test]
fn cli_5_a_goal_out_of_reach_is_refused_by_check_and_by_a_dry_run() {
    let folder = learned(3.0, "");
    for line in [
        "check reach.toml --goal=5,5,5".to_owned(),
        format!("{DEVICE} run reach.toml --goal=5,5,5 --dry-run"),
        format!("{DEVICE} run reach.toml --goal-at 1:5,5,5 --dry-run"),
    ] {
        let refused = tactus(folder.path(), &line).failure().code(6);
        assert!(stderr(&refused).contains("error[E631]"), "{line}: {}", stderr(&refused));
    }
    let report = json(&tactus(folder.path(), "--json check reach.toml --goal=5,5,5").code(6));
    assert_eq!(report["result"]["goal_m"], serde_json::json!([5.0, 5.0, 5.0]));
}

/// The change that makes it fail: `run` sends what it is asked for, and the device takes compliant gains unsaid.
#[test]
fn a_plan_that_bends_is_not_run_with_stiff_gains() {
    let folder = learned(3.0, "");
    let refused = tactus(folder.path(), &format!("{DEVICE} run reach.toml --stiff --mode adapt")).failure().code(2);
    let text = stderr(&refused);
    assert!(text.contains("error[E200]") && text.contains("leave out `--stiff`"), "{text}");
    tactus(folder.path(), &format!("{DEVICE} run reach.toml --stiff --mode open")).success();
}

#[test]
fn a_figure_that_nobody_measured_is_null_and_not_zero() {
    let folder = learned(3.0, "");
    let at = folder.path();
    let clean = json(&tactus(at, &format!("{DEVICE} --json run reach.toml")).success());
    assert!(clean["tracking"]["position_end_m"].as_f64().unwrap() < 0.005);
    // In this process nobody measures.
    for name in ["worst_instructions", "mean_instructions", "worst_computation_us", "worst_latency_us", "stack_used"] {
        assert_eq!(clean[name], Value::Null, "{name}");
    }
}

#[test]
fn a_hand_posture_out_of_its_range_is_refused_with_the_finger_and_the_range() {
    let folder = learned(3.0, "--name wide --hand-goal 0,3,0,0");
    let refused = tactus(folder.path(), "check reach.toml").failure().code(6);
    assert!(stderr(&refused).contains("finger 1 range: 3.0"), "{}", stderr(&refused));
    let refused = tactus(folder.path(), &format!("{DEVICE} hand to 0,0,0,2.8")).failure().code(2);
    assert!(stderr(&refused).contains("finger 3: 2.8 rad is outside 0.00 to 2.4"), "{}", stderr(&refused));
}

#[test]
fn every_primitive_has_its_own_image_checksum_and_the_device_tells_the_same() {
    let folder = learned(3.0, "");
    let at = folder.path();
    tactus(at, "learn demo.csv --name other --kernels 40 -o other.toml").success();
    let sum = |file: &str| json(&tactus(at, &format!("--json check {file}")).success())["image"][1].clone();
    assert_ne!(sum("reach.toml"), sum("other.toml"));
    let uploaded = json(&tactus(at, &format!("{DEVICE} --json upload reach.toml")).success());
    assert_eq!(uploaded["crc"], sum("reach.toml"));
}

#[test]
fn a_change_after_the_end_of_the_run_is_refused_before_anything_moves() {
    let folder = learned(3.0, "");
    for (change, taken) in [
        ("--speed-at 100:0.5", false),
        ("--goal-at 5:0.5,0.1,0.2", false),
        ("--speed 0.5 --speed-at 5:0.6", true),
        ("--speed-at 1:0.5 --speed-at 4:1", true),
        ("--speed-at 1:2 --speed-at 3:1", false),
    ] {
        let run = tactus(folder.path(), &format!("{DEVICE} run reach.toml {change} --dry-run"));
        if taken {
            run.success();
        } else {
            let run = run.failure().code(2);
            assert!(stderr(&run).contains("error[E237]"), "{change}: {}", stderr(&run));
        }
    }
}

#[test]
fn a_primitive_that_leaves_the_way_it_was_shown_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    // Far more to and fro than two kernels can hold.
    let rows: Vec<String> = (0..3000)
        .map(|k| {
            let t = f64::from(k) / 300.0;
            let x = 0.5 + 0.15 * (4.0 * t).sin() * (t * 0.314).sin();
            format!("{t},{x},0.1,0.2,1,0,0,0")
        })
        .collect();
    std::fs::write(folder.path().join("wild.csv"), format!("t_s,x_m,y_m,z_m,qw,qx,qy,qz\n{}\n", rows.join("\n")))
        .unwrap();
    let refused = tactus(folder.path(), "learn wild.csv --kernels 2 -o wild.toml").failure().code(6);
    let said = stderr(&refused);
    assert!(said.contains("error[E625]") && said.contains(" mm and ") && said.contains("--kernels"), "{said}");
    assert!(!folder.path().join("wild.toml").exists());
}

#[test]
fn recordings_say_where_they_come_from_and_no_command_mixes_movements() {
    let folder = learned(3.0, "");
    let at = folder.path();
    std::fs::write(at.join("longer.csv"), common::text(&common::rows(3.05))).unwrap();
    tactus(at, "learn longer.csv --name longer -o longer.toml").success();
    tactus(at, &format!("{DEVICE} run reach.toml --speed 0.9 --record reach.csv")).success();
    tactus(at, &format!("{DEVICE} run longer.toml --record other.csv")).success();
    let recording = lab::demonstration::Recording::read(&at.join("reach.csv")).unwrap();
    let origin = recording.origin;
    let primitive = lab::primitive_file::PrimitiveFile::read(&at.join("reach.toml")).unwrap();
    let played = origin.primitive.unwrap();
    assert_eq!((played.name.as_str(), played.movement), ("reach", primitive.movement_checksum()));
    assert_eq!((origin.speed, origin.mode.as_deref()), (Some(0.9), Some("track")));
    assert!(origin.device.is_some_and(|device| device.contains("in-process")) && origin.firmware.is_some());
    let before = std::fs::read(at.join("reach.toml")).unwrap();
    for line in [
        "statistics reach.toml other.csv",
        "statistics reach.toml reach.csv other.csv",
        "compare reach.csv other.csv",
        "report reach.csv other.csv -o figure.svg",
        "report reach.csv demo.csv other.csv -o figure.svg",
        "plot -p reach.toml -r other.csv -o figure.svg",
    ] {
        let refused = tactus(at, line).failure().code(6);
        assert!(stderr(&refused).contains("error[E641]"), "{line}: {}", stderr(&refused));
    }
    assert_eq!(std::fs::read(at.join("reach.toml")).unwrap(), before);
    assert!(!at.join("figure.svg").exists());
    tactus(at, "plot -p reach.toml -r reach.csv -o figure.svg").success();
    let foreign = stderr(&tactus(at, "compare demo.csv demo.csv").failure().code(6));
    assert!(foreign.contains("demo.csv does not name its movement"), "{foreign}");
}

/// Seen: a run whose speed and goal were changed on the way left a recording that says `speed: 1` and no goal, so that
/// its report told the wrong order; and `compare` said nothing of different goals. The change that makes it fail: the
/// notes of a run leave the changes out, or `compare` looks at speed and mode only.
#[test]
fn a_recording_says_what_was_changed_on_the_way_and_compare_tells_of_different_goals() {
    let folder = learned(3.0, "");
    let at = folder.path();
    let [x, y, z] = lab::primitive_file::PrimitiveFile::read(&at.join("reach.toml")).unwrap().goal.position;
    tactus(at, &format!("{DEVICE} run reach.toml --record taught.csv")).success();
    tactus(at, &format!("{DEVICE} run reach.toml --goal={x},{y},{} --record higher.csv", z + 0.01)).success();
    let changes = format!("--speed-at 1:0.8 --goal-at 0.5:{x},{y},{}", z + 0.01);
    tactus(at, &format!("{DEVICE} run reach.toml {changes} --record changed.csv")).success();
    let origin = lab::demonstration::Recording::read(&at.join("changed.csv")).unwrap().origin;
    let said = origin.changes.expect("changes");
    assert!(said.starts_with("goal_m ") && said.ends_with(" at 0.5 s; speed 0.8 at 1 s"), "{said}");
    tactus(at, "report changed.csv -o changed.html").success();
    let page = std::fs::read_to_string(at.join("changed.html")).unwrap();
    assert!(page.contains("speed 0.8 at 1 s"));
    for (other, expected) in [("higher.csv", "different goals"), ("changed.csv", "changed on the way")] {
        let said = stderr(&tactus(at, &format!("compare taught.csv {other}")).success());
        assert!(said.contains(expected), "{other}: {said}");
    }
    assert!(stderr(&tactus(at, "compare taught.csv taught.csv").success()).is_empty());
}

#[test]
fn statistics_leave_the_movement_what_it_was() {
    let folder = learned(3.0, "");
    let at = folder.path();
    tactus(at, &format!("{DEVICE} rehearse reach.toml --trials 3 --record-dir kept")).success();
    let gather = "statistics reach.toml kept/reach-1.csv kept/reach-2.csv kept/reach-3.csv";
    tactus(at, gather).success();
    // The primitive has K2, an expectation and statistics now, and is still the movement of those runs.
    tactus(at, gather).success();
    tactus(at, "plot -p reach.toml -r kept/reach-1.csv -o figure.svg").success();
}

#[test]
fn a_speed_whose_expectation_could_not_be_kept_is_refused_before_the_arm_moves() {
    let folder = learned(3.0, "");
    let refused = tactus(folder.path(), "--device unix:nobody.sock rehearse reach.toml --speed 0.3").failure().code(6);
    assert!(stderr(&refused).contains("error[E636]"), "{}", stderr(&refused));
}

#[test]
fn a_recording_in_which_nothing_was_played_is_drawn_as_a_whole() {
    let folder = learned(3.0, "");
    let drawn = tactus(folder.path(), "plot -r demo.csv -o figure.svg").success();
    assert!(stderr(&drawn).contains("all of it is drawn"), "{}", stderr(&drawn));
}

#[test]
fn h13_a_log_with_an_altered_time_or_an_endless_line_ends_at_once_with_its_line() {
    let folder = learned(1.0, "");
    let at = folder.path();
    tactus(at, "--device sil:world=simple,line=can,bus=bus.log list").success();
    let text = std::fs::read_to_string(at.join("bus.log")).unwrap();
    let mut lines: Vec<&str> = text.lines().collect();
    let altered = lines[40].replacen("(", "(9", 1);
    lines[40] = &altered;
    std::fs::write(at.join("altered.log"), lines.join("\n")).unwrap();
    std::fs::write(at.join("endless.log"), vec![b'('; 50_000_000]).unwrap();
    let begun = std::time::Instant::now();
    let leap = stderr(&tactus(at, "can replay altered.log").failure().code(6));
    assert!(leap.contains("line 41: time leaps"), "{leap}");
    for command in ["replay", "decode"] {
        let endless = stderr(&tactus(at, &format!("can {command} endless.log")).failure().code(6));
        assert!(endless.contains("line 1 has more than 4096 bytes"), "{endless}");
    }
    assert!(begun.elapsed().as_secs() < 20, "{:?}", begun.elapsed());
}

#[test]
fn h12_two_simulated_devices_do_not_share_a_flash_and_a_served_arm_takes_no_file_away() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("precious"), "precious").unwrap();
    let refused = tactus(at, "--device sil:world=simple sim --listen unix:precious --duration 1").failure().code(3);
    assert!(stderr(&refused).contains("error[E320]"), "{}", stderr(&refused));
    assert_eq!(std::fs::read(at.join("precious")).unwrap(), b"precious");
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_tactus"));
    let line = "--device sil:world=simple sim --listen unix:one.sock --flash flash.bin";
    let mut first = command.current_dir(at).args(line.split(' ')).stderr(std::process::Stdio::null()).spawn().unwrap();
    while !at.join("one.sock").exists() {
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    let second = tactus(at, "--device sil:world=simple,flash=flash.bin list").failure().code(2);
    first.kill().unwrap();
    first.wait().unwrap();
    assert!(stderr(&second).contains("another simulated device uses it"), "{}", stderr(&second));
    tactus(at, "--device sil:world=simple,flash=flash.bin list").success();
}

#[test]
fn a_demonstration_that_nobody_ends_is_no_success_and_what_was_recorded_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let run = |input: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tactus"));
        command.current_dir(folder.path()).env("XDG_CONFIG_HOME", folder.path());
        let line = "--device sil:world=simple --force teach --output demo.csv";
        command.args(line.split(' ')).write_stdin(input).assert()
    };
    let refused = run("").failure().code(2);
    let said = stderr(&refused);
    assert!(said.contains("error[E205]") && said.contains("standard input has ended"), "{said}");
    assert!(!folder.path().join("demo.csv").exists(), "it is no demonstration");
    run("\n").success();
    assert!(folder.path().join("demo.csv").exists());
}

/// The changes that make it fail: nobody calls `tell_unkept`, or it does not look for the option.
#[test]
fn a_rehearsal_that_ends_early_says_that_nothing_of_it_is_kept_or_where_it_is() {
    let folder = learned(3.0, "");
    let at = folder.path();
    let script = "[[scenario]]\nname = \"a stuck encoder\"\nfrom = \"run\"\n\
        inject = [{ at = 8.5, what.freeze = { kind = \"position\", from = [4] } }]\n";
    std::fs::write(at.join("stuck.toml"), script).unwrap();
    let line = "--device sil:world=simple,faults=stuck.toml --non-interactive rehearse reach.toml";
    let failed = stderr(&tactus(at, line).failure().code(5));
    assert!(failed.contains("nothing that was measured is kept; `--record-dir FOLDER`"), "{failed}");
    let failed = stderr(&tactus(at, &format!("{line} --record-dir kept")).failure().code(5));
    assert!(!failed.contains("is kept; ") && failed.contains("kept/reach-1.csv.part"), "{failed}");
    assert!(at.join("kept/reach-1.csv.part").exists());
}

/// A hand that is pushed aside as the arm comes to the start is beside it for a second or two: the device refuses the
/// run, and nobody who reads "the arm is not near the start" knows that it would be, if asked again.
///
/// The change that makes it fail: the run is asked for as soon as the approach has ended.
#[test]
fn a_run_waits_for_an_arm_that_was_pushed_aside_on_its_way_to_the_start() {
    let folder = learned(3.0, "");
    let at = folder.path();
    let run = |lasts: f64| {
        let script = format!(
            "[[scenario]]\nname = \"a push\"\nfrom = \"hold\"\n\
             inject = [{{ at = 8.0, lasts = {lasts}, what.push.force = [0, 15, 0] }}]\n"
        );
        std::fs::write(at.join("push.toml"), script).unwrap();
        tactus(at, "--device sil:world=simple,faults=push.toml --non-interactive run reach.toml --mode open")
    };
    run(2.5).success();
    // Somebody who goes on pushing is not waited for.
    let refused = run(60.0).failure().code(5);
    assert!(stderr(&refused).contains("E526"), "{}", stderr(&refused));
}
