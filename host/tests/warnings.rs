//! Words that come seldom: of a demonstration that nobody ends, of runs that cannot be kept or miss their goal, of
//! statistics of several modes, and of ports that the system chose.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::common;
use crate::tool::{self, Ended, command, learned, said, tactus};

const DEVICE: &str = "--device sil:world=simple";

/// The words of a command that has to succeed.
#[track_caller]
fn succeeds(folder: &Path, line: &str) -> String {
    said(&tool::succeeds(folder, line))
}

/// The change that makes it fail: the end of the time is not told, or told to whoever gave a time.
#[test]
fn a_demonstration_that_ended_by_itself_after_two_minutes_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut teach = command(at, &format!("{DEVICE} teach -o a.csv"));
    // Somebody could press Enter, and nobody does.
    let taught = teach.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut taught = Ended(taught);
    let held = taught.0.stdin.take();
    let mut words = BufReader::new(taught.0.stderr.take().unwrap()).lines().map(Result::unwrap);
    assert!(words.any(|line| line.starts_with("warning: nobody pressed Enter within 120 s: ")));
    assert!(taught.0.wait().unwrap().success());
    drop(held);
    assert_eq!(lab::demonstration::Recording::read(&at.join("a.csv")).unwrap().len(), 36_000);
    assert!(!succeeds(at, &format!("{DEVICE} teach --duration 1 -o b.csv")).contains("nobody pressed Enter"));
}

/// The change that makes it fail: the modes of the recordings are not compared.
#[test]
fn statistics_of_runs_in_several_modes_are_gathered_with_a_warning() {
    let folder = learned(3.0);
    let at = folder.path();
    succeeds(at, &format!("{DEVICE} --non-interactive rehearse reach.toml --trials 3 --record-dir kept"));
    let gather = "statistics reach.toml kept/reach-1.csv kept/reach-2.csv kept/reach-3.csv";
    assert!(!succeeds(at, gather).contains("several modes"));
    let text = std::fs::read_to_string(at.join("kept/reach-2.csv")).unwrap();
    assert!(text.contains("# mode: open\n"), "{}", &text[..300]);
    std::fs::write(at.join("kept/reach-2.csv"), text.replace("# mode: open\n", "# mode: force\n")).unwrap();
    let told = succeeds(at, gather);
    assert!(told.contains("warning: the runs are of several modes (force, open): "), "{told}");
}

/// The change that makes it fail: the address is told as it was asked for.
#[test]
fn an_arm_that_is_served_at_any_port_tells_which_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let mut serve = command(folder.path(), &format!("{DEVICE} sim --listen tcp:127.0.0.1:0"));
    let arm = serve.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let mut arm = Ended(arm);
    let lines = BufReader::new(arm.0.stderr.take().unwrap()).lines().map(Result::unwrap);
    let told = lines.filter(|line| line.contains("a simulated arm listens")).find_map(|line| {
        let device = line.split_once("`tactus --device ")?.1.split_once(" list`")?.0;
        Some(device.to_owned())
    });
    let device = told.expect("a command to type");
    assert!(device.starts_with("tcp:127.0.0.1:") && !device.ends_with(":0"), "{device}");
    succeeds(folder.path(), &format!("--device {device} list"));
}

/// The only folder of a run, once its recording has so many bytes.
fn folder_of_a_run(base: &Path, bytes: u64) -> PathBuf {
    let begun = Instant::now();
    loop {
        let first = std::fs::read_dir(base).into_iter().flatten().flatten().next();
        if let Some(folder) = first.map(|entry| entry.path())
            && std::fs::metadata(folder.join("run.csv.part")).is_ok_and(|part| part.len() >= bytes)
        {
            return folder;
        }
        assert!(begun.elapsed() < Duration::from_secs(60), "nothing is recorded");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// The change that makes it fail: a result that could not be written is told as kept.
#[test]
fn a_run_of_which_something_could_not_be_kept_does_not_say_that_everything_is() {
    let folder = learned(20.0);
    let at = folder.path();
    let mut run = command(at, &format!("{DEVICE} --json --non-interactive run reach.toml --keep"));
    let run = run.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let kept = folder_of_a_run(&at.join("runs"), 50_000);
    std::fs::create_dir(kept.join("run.json")).unwrap();
    let ended = run.wait_with_output().unwrap();
    let told: Value = serde_json::from_slice(&ended.stdout).unwrap();
    assert_eq!((told["error"]["code"].as_str(), ended.status.code()), (Some("E231"), Some(2)), "{told}");
    assert!(said(&ended).contains("not everything about this run is in runs/"), "{}", said(&ended));
    assert!(kept.join("run.csv").is_file(), "the recording is there");
}

/// The changes that make it fail: a run is not compared with its goal; the help does not name the recording.
#[test]
fn a_run_that_somebody_leans_on_ends_short_of_its_goal_and_the_help_can_be_typed() {
    let folder = learned(3.0);
    let at = folder.path();
    let script = "[[scenario]]\nname = \"somebody leans on the hand\"\nfrom = \"run\"\n\
        inject = [{ at = 9.0, lasts = 60.0, what.push.force = [0, 10, 0] }]\n";
    std::fs::write(at.join("lean.toml"), script).unwrap();
    let line = "--device sil:world=simple,faults=lean.toml --non-interactive --json run reach.toml --mode open";
    let ended = tactus(at, &format!("{line} --record run.csv"));
    let told: Value = serde_json::from_slice(&ended.stdout).unwrap();
    let (message, help) = (told["error"]["message"].as_str().unwrap(), told["error"]["help"].as_str().unwrap());
    assert_eq!((told["error"]["code"].as_str(), ended.status.code()), (Some("E637"), Some(6)), "{told}");
    assert!(message.starts_with("run: the arm ended ") && message.contains(" mm and "), "{message}");
    assert_eq!(help, "`tactus plot --run run.csv --output run.png` shows where it went");
    succeeds(at, "plot --run run.csv --output run.png");
    let ended = tactus(at, line);
    let told: Value = serde_json::from_slice(&ended.stdout).unwrap();
    assert!(told["error"]["help"].as_str().unwrap().contains("`--record FILE`"), "{told}");
}

/// The change that makes it fail: a command that has a device keep something leaves `tell_forgotten` out.
#[test]
fn what_a_simulated_device_forgets_with_the_command_is_told_wherever_it_is_to_keep_something() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    succeeds(at, "secret new lab.secret");
    for line in [
        "config set home.joint_1_rad=0.1",
        "calibrate home --set 0,-2,0,3.1,0,0,0",
        "calibrate payload hand",
        "secret set lab.secret",
    ] {
        let told = succeeds(at, &format!("{DEVICE} {line}"));
        assert!(told.contains("what it keeps with it: `flash=FILE`"), "{line}: {told}");
        let flash = line.split(' ').take(2).collect::<String>();
        let told = succeeds(at, &format!("{DEVICE},flash={flash}.flash {line}"));
        assert!(!told.contains("what it keeps with it"), "{line}: {told}");
    }
    let told = succeeds(at, &format!("{DEVICE},arm=7 calibrate gravity"));
    assert!(told.contains("what it keeps with it: `flash=FILE`"), "{told}");
}

/// The changes that make it fail: an option of which another one takes the effect is ignored; a number below zero is
/// taken for an option.
#[test]
fn options_without_effect_and_numbers_below_zero_are_told_as_such() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    common::demonstration(at, 3.0);
    for (line, words) in [
        ("learn demo.csv -o a.toml --hand-window 0.2,0.8", "--hand-window: the fingers do not move"),
        ("learn demo.csv -o a.toml --no-trim --still-speed 0.01", "cannot be used with"),
        (
            "learn demo.csv -o a.toml --hand-goal 0,1,1,1 --hand-window -0.2,0.8",
            "two fractions of the duration in order",
        ),
        ("learn demo.csv -o .", "learn: . is a folder"),
        ("learn demo.csv -o -", "learn: - is standard output"),
        ("learn demo.csv -o a.toml --stiffness -1", "--stiffness: a number from 0.1 to 1e4"),
        ("learn demo.csv -o a.toml --orientation-stiffness -1", "--orientation-stiffness: a number from 0.1 to 1e4"),
        ("compare demo.csv demo.csv --contact -1", "a force from 0 N on is expected"),
        ("check demo.csv --speed -1", "a speed factor between 0.1 and 2"),
        ("run demo.csv --speed -1", "a speed factor between 0.1 and 2"),
        ("rehearse demo.csv --speed -1", "a speed factor between 0.1 and 2"),
        ("record --duration -1", "a time between 0.2 and 3600 s"),
        ("teach --duration -1", "a time between 0.2 and 3600 s"),
        ("monitor --duration -1", "a time between 0 and 3600 s"),
        ("sim --duration -1", "a time between 0 and 3600 s"),
        ("status --line -1", "a time of 0.001 to 86400 s"),
    ] {
        let output = tactus(at, line);
        assert!(output.status.code() == Some(2) && said(&output).contains(words), "{line}: {}", said(&output));
    }
    assert!(!at.join("a.toml").exists());
    succeeds(at, "learn demo.csv -o a.toml --hand-goal 0,1,1,1 --hand-window 0.2,0.8");
}

/// The change that makes it fail: only the speed at the start is compared with that of the rehearsal.
#[test]
fn a_change_of_speed_at_which_the_expectation_is_not_believed_is_told_before_the_run() {
    let folder = learned(3.0);
    let at = folder.path();
    succeeds(at, &format!("{DEVICE} --non-interactive rehearse reach.toml --trials 1"));
    let run = format!("{DEVICE} --non-interactive run reach.toml --mode adapt --dry-run");
    let told = succeeds(at, &format!("{run} --speed-at 1:0.5 --speed-at 2:0.95"));
    assert!(told.contains("warning: from 1 s on, at speed 0.50, the adaptation is derated to 0 %"), "{told}");
    assert_eq!(told.matches("is derated").count(), 1, "{told}");
    let stiff = succeeds(at, &format!("{DEVICE} --non-interactive run reach.toml --dry-run --speed-at 1:0.5"));
    assert!(!stiff.contains("derated"), "a run that does not look at forces: {stiff}");
}

/// Speed of elbow or forearm of this movement (m/s), and the warnings about it.
fn warned(folder: &Path, options: &str) -> (f64, Vec<String>) {
    let told: Value =
        serde_json::from_slice(&tool::succeeds(folder, &format!("--json check reach.toml {options}")).stdout).unwrap();
    let margins = told["margins"].as_array().unwrap();
    let speed = margins.iter().find(|margin| margin["limit"] == "tip_speed").unwrap()["value"].as_f64().unwrap();
    (speed, told["warnings"].as_array().unwrap().iter().map(|words| words.as_str().unwrap().to_owned()).collect())
}

/// One in four of random movements that a check passed could not be rehearsed: the pendant warned of its speed, the run
/// was held to half, and the refusal spoke of recordings of another speed. Nobody was told of a run that was held back.
///
/// The changes that make it fail: a check does not look at the speed that the pendant warns of; a recording that took
/// longer because it was held back is one of another speed; a run does not tell that it was held back.
#[test]
fn a_movement_that_the_pendant_will_warn_of_is_told_before_with_the_speed_that_mends_it() {
    let folder = learned(1.6);
    let at = folder.path();
    let (fast, warnings) = warned(at, "");
    assert!(fast > 0.55 && warnings.len() == 1, "{fast} m/s: {warnings:?}");
    let told = "from 0.5 m/s on the pendant warns, and while it does the run is held to half of the taught speed";
    assert!(warnings[0].contains(told), "{warnings:?}");
    let slower = warnings[0].split('`').nth(1).expect("a command's option");
    let held = "the run was held to half of the taught speed";
    assert!(succeeds(at, &format!("{DEVICE} run reach.toml --mode open")).contains(held));
    let refused = tool::refusal(at, &format!("{DEVICE} --json rehearse reach.toml"));
    let words = format!("{} {}", refused.message, refused.help);
    assert!(refused.code == "E640" && words.contains(held) && words.contains("tactus check"), "{words}");
    // What it advises is done.
    let (calm, none) = warned(at, slower);
    assert!(none.is_empty() && calm < 0.46 && calm > 0.4, "{slower}: {calm} m/s, {none:?}");
    assert!(warned(at, "--speed 0.5").1.is_empty(), "nobody holds back what is as slow already");
    assert!(!succeeds(at, &format!("{DEVICE} run reach.toml --mode open {slower}")).contains("warn"));
    succeeds(at, &format!("{DEVICE} rehearse reach.toml {slower}"));
}
