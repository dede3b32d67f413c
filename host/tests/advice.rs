//! Advice works: what a refusal advises shows or mends the same refusal, and what a command drops it says.

use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::common;
use crate::tool::{self, Ended, Refusal, command, learned, said, succeeds, tactus};

const DEVICE: &str = "--device sil:world=simple,flash=arm.flash --non-interactive";

/// Code and help of a command that fails.
#[track_caller]
fn refused(folder: &Path, line: &str) -> (String, String) {
    let Refusal { code, help, .. } = tool::refusal(folder, &format!("--json {line}"));
    (code, help)
}

#[test]
fn a_rehearsal_says_that_it_drops_the_statistics() {
    let folder = learned(3.0);
    let at = folder.path();
    let rehearse = format!("{DEVICE} --json rehearse reach.toml --trials 2 --record-dir kept --force");
    let first = succeeds(at, &rehearse);
    let told: Value = serde_json::from_slice(&first.stdout).unwrap();
    assert_eq!(told["statistics_dropped"], Value::Bool(false));
    assert!(!said(&first).contains("statistics"), "{}", said(&first));
    succeeds(at, "statistics reach.toml kept/reach-1.csv kept/reach-2.csv");
    let again = succeeds(at, &rehearse);
    let told: Value = serde_json::from_slice(&again.stdout).unwrap();
    assert_eq!(told["statistics_dropped"], Value::Bool(true));
    let words = said(&again);
    assert!(words.contains("warning: its statistics were dropped") && words.contains("`tactus statistics reach.toml"));
}

#[test]
fn a_primitive_is_not_renamed_to_its_own_name() {
    let folder = tempfile::tempdir().unwrap();
    // Nobody listens there: it ends before a device is asked.
    let (code, help) = refused(folder.path(), "--device unix:nobody.sock rename reach reach");
    assert_eq!(code, "E200");
    assert!(help.contains("tactus rename reach NEW") && !help.contains("delete"), "{help}");
}

#[test]
fn a_folder_does_not_hide_a_primitive_in_the_device() {
    let folder = learned(3.0);
    let at = folder.path();
    succeeds(at, &format!("{DEVICE} upload reach.toml"));
    std::fs::create_dir(at.join("reach")).unwrap();
    succeeds(at, &format!("{DEVICE} run reach --dry-run"));
}

/// Writes a demonstration through these postures (rad), each after so many seconds, at rest at both ends.
fn lead(file: &Path, start: [f64; 7], legs: &[(f64, [f64; 7])]) {
    let mut postures = vec![start; 150];
    let mut from = start;
    for (seconds, to) in legs {
        let steps = (seconds * 300.0) as usize;
        for step in 0..steps {
            let u = step as f64 / steps as f64;
            let share = u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
            postures.push(std::array::from_fn(|joint| from[joint] + (to[joint] - from[joint]) * share));
        }
        from = *to;
    }
    postures.extend([from; 150]);
    let mut text = "t_s,q1_rad,q2_rad,q3_rad,q4_rad,q5_rad,q6_rad,q7_rad\n".to_owned();
    for (sample, posture) in postures.iter().enumerate() {
        let angles: Vec<String> = posture.iter().map(|angle| format!("{angle:.7}")).collect();
        text += &format!("{:.6},{}\n", sample as f64 / 300.0, angles.join(","));
    }
    std::fs::write(file, text).unwrap();
}

/// The plan of a long movement whose last part is fast is off its goal behind its end, where its last kernel acts
/// alone: 90 mrad after five seconds. The refusal spoke of a demonstration that does not end at rest.
///
/// The changes that make it fail: nobody looks behind the end of the plan; the refusal does not name the kernels.
#[test]
fn a_long_movement_with_a_fast_end_is_told_to_have_more_kernels_and_passes_with_them() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (start, over) = ([0.1, 1.2, 0.1, 1.5, 0.1, 0.2, 0.3], [0.5, 1.2, 0.2, 1.7, 0.1, 0.1, 0.3]);
    lead(&at.join("quick.csv"), start, &[(9.0, over), (0.8, [0.5, 1.1, 0.2, 1.5, 0.9, 0.9, 1.3])]);
    let told = said(&succeeds(at, "learn quick.csv"));
    assert!(
        told.contains("a second behind its end the plan is off its goal") && told.contains("--kernels 100"),
        "{told}"
    );
    let (code, help) = refused(at, "check quick.toml");
    assert!(code == "E631" && help.contains("`--kernels 100`"), "{help}");
    assert!(!said(&succeeds(at, "learn quick.csv --kernels 100 --force")).contains("kernels are too few"));
    succeeds(at, "check quick.toml");
}

/// Where the plan comes to its goal and the arm does not, more rest in the demonstration mends nothing.
///
/// The change that makes it fail: the refusal does not look at where the plan is.
#[test]
fn an_arm_that_is_stretched_out_at_its_goal_is_told_so() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (start, out) = ([0.4, 1.2, -0.2, 0.6, 0.1, 0.9, 0.9], [0.05, 1.15, -0.5, -0.05, 0.2, 0.83, 0.53]);
    lead(&at.join("out.csv"), start, &[(1.6, out)]);
    succeeds(at, "learn out.csv");
    let (code, help) = refused(at, "check out.toml");
    assert!(code == "E631" && help.contains("stretched out") && !help.contains("still-speed"), "{help}");
}

#[test]
fn one_run_does_not_count_as_several() {
    let folder = learned(3.0);
    let at = folder.path();
    succeeds(at, &format!("{DEVICE} rehearse reach.toml --trials 2 --record-dir kept"));
    let text = std::fs::read_to_string(at.join("kept/reach-1.csv")).unwrap();
    std::fs::write(at.join("copy.csv"), &text).unwrap();
    std::fs::write(at.join("noted.csv"), format!("# the best of them\n{text}")).unwrap();
    let before = std::fs::read(at.join("reach.toml")).unwrap();
    for again in ["kept/reach-1.csv", "./kept/../kept/reach-1.csv", "copy.csv", "noted.csv"] {
        let line = format!("statistics reach.toml kept/reach-1.csv kept/reach-2.csv {again}");
        let (code, help) = refused(at, &line);
        assert!(code == "E640" && help.contains("different runs"), "{again}: {code} {help}");
    }
    assert_eq!(std::fs::read(at.join("reach.toml")).unwrap(), before);
    succeeds(at, "statistics reach.toml kept/reach-1.csv kept/reach-2.csv");
}

/// The command line in the first pair of backquotes that begins with these words.
fn advised(help: &str, begins: &str) -> String {
    let found = help.split('`').find(|part| part.starts_with(begins));
    found.unwrap_or_else(|| panic!("no `{begins}` in: {help}")).trim_start_matches("tactus ").to_owned()
}

#[test]
fn fingers_out_of_their_range_are_put_right_where_they_came_from() {
    let folder = tempfile::tempdir().unwrap();
    common::demonstration(folder.path(), 3.0);
    succeeds(folder.path(), "learn demo.csv --hand-goal 0,9,0,0");
    let (code, help) = refused(folder.path(), "check demo.toml");
    assert!(code == "E631" && help.contains("`--hand-goal`") && !help.contains("show the movement"), "{help}");
}

/// The change that makes it fail: every refusal is answered with a movement farther from the limits.
#[test]
fn a_movement_whose_slow_end_was_cut_off_is_put_right_by_what_the_check_advises() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut text = "t_s,q1_rad,q2_rad,q3_rad,q4_rad,q5_rad,q6_rad,q7_rad\n".to_owned();
    for line in 0..=1480 {
        let time = f64::from(line) / 25.0;
        let r = ((time - 0.5) / 58.5).clamp(0.0, 1.0);
        let turned = 0.5 * r.powi(3) * (10.0 - 15.0 * r + 6.0 * r * r);
        text += &format!("{time},{:.7},1.089,0.505,1.737,-0.753,-1.034,-0.061\n", turned - 0.416);
    }
    std::fs::write(at.join("slow.csv"), text).unwrap();
    succeeds(at, "learn slow.csv");
    let (code, help) = refused(at, "check slow.toml");
    assert_eq!(code, "E631");
    assert!(help.contains("`--still-speed 0.001`") && !help.contains("limits"), "{help}");
    succeeds(at, "learn slow.csv --still-speed 0.001 --force");
    succeeds(at, "check slow.toml");
}

#[test]
fn a_refused_run_advises_a_check_that_shows_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/examples/reach.csv");
    std::fs::copy(example, at.join("reach.csv")).unwrap();
    succeeds(at, "learn reach.csv");
    for options in ["--goal 0.6,0.1,0.5", "--goal 5,5,5 --speed 2", "--goal -5,0.1,-0.3 --speed 0.5"] {
        let (code, help) = refused(at, &format!("{DEVICE} run reach.toml {options}"));
        assert_eq!(code, "E631", "{options}");
        let (again, help) = refused(at, &advised(&help, "tactus check"));
        assert_eq!(again, "E631", "{options}: {help}");
    }
    // Of one in the device the file is fetched first.
    succeeds(at, &format!("{DEVICE} upload reach.toml"));
    std::fs::remove_file(at.join("reach.toml")).unwrap();
    let (_, help) = refused(at, &format!("{DEVICE} run reach --goal 5,5,5"));
    succeeds(at, &format!("{DEVICE} {}", advised(&help, "tactus get")));
    assert_eq!(refused(at, &advised(&help, "tactus check")).0, "E631");
    std::fs::remove_file(at.join("reach.toml")).unwrap();
    let (code, help) = refused(at, &format!("{DEVICE} run reach --mode adapt"));
    assert!(code == "E635" && help.contains("`tactus get reach`, then tactus rehearse reach.toml"), "{help}");
}

#[test]
fn a_change_on_the_way_that_breaks_a_limit_is_named_with_its_time() {
    let folder = learned(3.0);
    let (code, help) =
        refused(folder.path(), &format!("{DEVICE} run reach.toml --goal-at 0.5:0.6,0.1,0.2 --goal-at 1:5,5,5"));
    assert!(code == "E631" && help.contains("`--goal-at 1:5,5,5`"), "{help}");
}

#[test]
fn a_slower_run_is_advised_only_where_it_is_slower_and_can_help() {
    let folder = learned(1.0);
    let at = folder.path();
    let mut speed = 2.0;
    loop {
        let output = tactus(at, &format!("--json check reach.toml --speed {speed}"));
        if output.status.success() {
            break;
        }
        let told: Value = serde_json::from_slice(&output.stdout).unwrap();
        let help = told["error"]["help"].as_str().unwrap().to_owned();
        let slower: f64 = advised(&help, "--speed ").trim_start_matches("--speed ").parse().unwrap();
        assert!(slower < speed && slower >= 0.1, "{speed}: {help}");
        speed = slower;
    }
    assert!(speed < 2.0);
    let (_, help) = refused(at, "check reach.toml --speed 0.2 --goal 5,5,5");
    assert!(!help.contains("--speed") && help.contains("another goal"), "{help}");
}

const SERVED: &str = "--device unix:arm.sock";

/// A simulated arm that stays, with its pendant; killed when the test is over.
struct Served(Ended);

impl Served {
    fn start(folder: &Path, options: &[&str]) -> Served {
        let serve = ["--device", "sil:world=simple", "sim", "--listen", "unix:arm.sock"];
        let mut command = command(folder, &[&serve, options].concat());
        let served = Served(Ended(command.stdin(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap()));
        wait_until("it listens", || folder.join("arm.sock").exists());
        served
    }

    fn press(&mut self, word: &str) {
        writeln!(self.0.0.stdin.as_mut().unwrap(), "{word}").unwrap();
    }
}

#[track_caller]
fn wait_until(what: &str, mut is_so: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !is_so() {
        assert!(begun.elapsed() < Duration::from_secs(60), "it does not come to it that {what}");
        std::thread::sleep(Duration::from_millis(100));
    }
}

fn status(at: &Path) -> Value {
    serde_json::from_slice(&succeeds(at, &format!("{SERVED} --json status")).stdout).unwrap()
}

/// An arm with a hand, without torque, for which a bare arm is declared: its next start-up is blocked.
fn wrongly_declared(at: &Path) -> Served {
    let mut arm = Served::start(at, &[]);
    succeeds(at, &format!("{SERVED} hand init"));
    arm.press("estop");
    wait_until("the arm has no torque", || status(at)["state"] == "idle");
    succeeds(at, &format!("{SERVED} calibrate payload nothing"));
    arm
}

#[test]
fn g4_a_fault_that_a_wrong_declaration_keeps_from_being_cleared_is_answered_with_the_declaration() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut arm = wrongly_declared(at);
    let status = || status(at);
    arm.press("release");
    arm.press("idle");
    wait_until("the start-up is blocked", || status()["blocked"].is_string());
    let told = succeeds(at, &format!("{SERVED} status"));
    assert!(String::from_utf8_lossy(&told.stdout).contains("`tactus calibrate payload hand`"));
    assert!(status()["help"].as_str().unwrap().contains("`tactus calibrate payload hand`"));
    let (code, help) = refused(at, &format!("{SERVED} stop --clear-fault"));
    assert!(code == "E508" && help.contains("`tactus calibrate payload hand`"), "{code}: {help}");
}

#[test]
fn an_option_that_is_to_blame_is_named_and_not_the_movement() {
    let folder = learned(3.0);
    for (option, blamed) in [
        ("--cutoff 1000", "--cutoff"),
        ("--cutoff 0", "--cutoff"),
        ("--cutoff nan", "--cutoff"),
        ("--cutoff 0.001", "--cutoff"),
        ("--still-speed 100", "--still-speed"),
    ] {
        let output = tactus(folder.path(), &format!("learn demo.csv -o other.toml {option}"));
        let words = said(&output);
        assert!(!output.status.success() && words.contains(blamed), "{option}: {words}");
        assert!(!words.contains("show the movement again") && !words.contains("--kernels"), "{option}: {words}");
    }
}

#[test]
fn a_fault_of_an_arm_that_ended_with_its_command_is_not_to_be_cleared() {
    let folder = learned(3.0);
    let at = folder.path();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/faults/a3.toml");
    std::fs::copy(script, at.join("a3.toml")).unwrap();
    let run = "--non-interactive run reach.toml --keep --force";
    let (code, help) = refused(at, &format!("--device sil:world=simple,faults=a3.toml {run}"));
    assert_eq!(code, "E592");
    assert!(!help.contains("clear-fault") && help.contains("`tactus sim`") && help.contains("usually "), "{help}");
    let kept = at.join("runs").read_dir().unwrap().next().unwrap().unwrap().path().join("run.json");
    let kept = std::fs::read_to_string(kept).unwrap();
    assert!(!kept.contains("clear-fault") && kept.contains("`tactus sim`"), "{kept}");
}

#[test]
fn a_flash_that_is_not_kept_is_told_of_once() {
    let folder = learned(3.0);
    let at = folder.path();
    succeeds(at, &format!("{DEVICE} list"));
    // The limit stands for a full disk; the file of the flash is longer.
    let line = format!("ulimit -f 1; exec \"$0\" {DEVICE} upload reach.toml");
    let mut limited = Command::new("bash");
    limited.current_dir(at).args(["-c", &line, env!("CARGO_BIN_EXE_tactus")]).stdin(Stdio::null());
    let words = said(&limited.output().unwrap());
    assert_eq!(words.matches("is not kept").count(), 1, "{words}");
}

#[test]
fn advice_names_commands_and_options_that_there_are() {
    let folder = tempfile::tempdir().unwrap();
    let explained = |code: &str| String::from_utf8(succeeds(folder.path(), &format!("explain {code}")).stdout).unwrap();
    for (code, words) in [
        ("E503", "enter the command again"),
        ("E507", "`--at-home`"),
        ("E526", "`tactus run` goes to the start"),
        ("E537", "`tactus hand init`"),
        // No command tares; zeroing does.
        ("ContactForce", "zero it again (`--at-home`)"),
        ("E220", "`_` and `.`"),
    ] {
        assert!(explained(code).contains(words), "{code}: {}", explained(code));
    }
    // Every option that an address takes is in the list that a wrong one is answered with.
    let output = tactus(folder.path(), "--device sil:aim=7 list");
    for option in ["seed=", "arm=", "world=", "line=", "bus=", "flash=", "faults="] {
        assert!(said(&output).contains(option), "{option}: {}", said(&output));
    }
}

#[test]
fn an_address_that_cannot_be_read_is_answered_with_the_one_that_was_meant_and_not_with_a_simulator() {
    let folder = tempfile::tempdir().unwrap();
    for (given, help) in [
        ("/dev/ttyACM0", "`--device serial:/dev/ttyACM0`"),
        ("COM3", "`--device serial:COM3`"),
        ("can0", "`--device can:can0`"),
        ("sil", "`--device sil:`"),
        ("arm.sock", "`--device unix:arm.sock`"),
        ("tcp:localhost", "correct the address; `tactus --help`"),
        ("sil:seed=x", "correct the address; `tactus --help`"),
    ] {
        let (code, told) = refused(folder.path(), &format!("--device {given} status"));
        assert!(code == "E201" && told.starts_with(help) && !told.contains("sim:"), "{given}: {code}: {told}");
    }
}

#[test]
fn an_arm_that_is_served_fast_can_be_commanded() {
    let folder = learned(3.0);
    let at = folder.path();
    let _arm = Served::start(at, &["--fast"]);
    let cycle = || {
        let told = succeeds(at, &format!("{SERVED} --json status")).stdout;
        serde_json::from_slice::<Value>(&told).unwrap()["cycle"].as_u64().unwrap()
    };
    succeeds(at, &format!("{SERVED} hand init"));
    succeeds(at, &format!("{SERVED} run reach.toml"));
    // Nobody is connected for a second: more than ten times as much passes on the arm.
    let before = cycle();
    std::thread::sleep(Duration::from_secs(1));
    assert!(cycle() - before > 10 * u64::from(control::RATE_HZ));
}

#[test]
fn a_recording_of_an_arm_that_is_not_ready_says_what_is_in_its_way() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut arm = wrongly_declared(at);
    let status = || status(at);
    let record = || refused(at, &format!("{SERVED} record --duration 1 --force"));
    wait_until("the start-up waits for the pendant", || {
        status()["startup"].as_str().is_some_and(|stage| stage.contains("Shift-Idle"))
    });
    let (code, help) = record();
    assert!(code == "E590" && help.contains("Shift+Idle"), "{code}: {help}");
    arm.press("release");
    arm.press("idle");
    wait_until("the start-up is blocked", || status()["blocked"].is_string());
    // A start-up that is tried again each second has news of itself, but no cycles.
    let begun = Instant::now();
    let (code, help) = record();
    assert!(code == "E590" && help.contains("`tactus calibrate payload hand`"), "{code}: {help}");
    assert!(begun.elapsed() < Duration::from_secs(8), "it took {:?}", begun.elapsed());
}

#[test]
fn whoever_only_looks_on_is_told_which_commands_do_more() {
    let folder = tempfile::tempdir().unwrap();
    let explained = String::from_utf8(succeeds(folder.path(), "explain E547").stdout).unwrap();
    assert!(explained.contains("`tactus stop`"), "{explained}");
}

#[test]
fn a_simulated_arm_that_began_with_the_command_says_that_its_fault_memory_began_too() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let device = "--device sil:world=simple,flash=arm.flash --non-interactive";
    let told = succeeds(at, &format!("{device} faults"));
    assert!(String::from_utf8_lossy(&told.stdout).contains("`tactus sim`"), "{told:?}");
    let (code, help) = refused(at, &format!("{device} faults --record fault.csv"));
    assert!(code == "E690" && help.contains("`tactus sim`"), "{code}: {help}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_device_node_is_no_flash_and_a_file_that_is_too_long_does_not_make_a_full_disk() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for line in ["upload /dev/zero", "learn /dev/zero -o zero.toml", "compare /dev/zero /dev/zero"] {
        let (code, help) = refused(at, &format!("{DEVICE} {line}"));
        assert!(code != "E235" && !help.contains("make room"), "{line}: {code}: {help}");
    }
    for node in ["/dev/null", "/dev/zero"] {
        let output = tactus(at, &format!("--device sil:world=simple,flash={node} list"));
        let words = said(&output);
        assert!(words.contains("E213") && words.contains("it is no regular file"), "{node}: {words}");
    }
}
