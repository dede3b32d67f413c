//! A newcomer's first hour: words that mislead, files that are left lying about, and logs that end too early.
#![cfg(unix)]

use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use crate::common;
use crate::tool::{self, heeding, said, tactus};

/// The program under a shell that lets no file grow: it stands for a full disk.
fn without_room(folder: &Path, line: &str) -> Output {
    let mut command = Command::new("sh");
    command.args(["-c", &format!("ulimit -f 0; exec \"$0\" {line}"), env!("CARGO_BIN_EXE_tactus")]);
    command.current_dir(folder).env_remove("TACTUS_DEVICE").stdin(Stdio::null()).output().unwrap()
}

#[test]
fn a_primitive_that_a_file_keeps_is_not_said_to_be_lost() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    common::demonstration(folder, 2.0);
    assert!(tactus(folder, "learn demo.csv -o reach.toml").status.success());
    let lost = "this simulated device ends with the command";
    let kept = tactus(folder, "--device sil:world=simple,flash=arm.flash upload reach.toml");
    assert!(kept.status.success() && !said(&kept).contains(lost), "{}", said(&kept));
    let forgotten = tactus(folder, "--device sil:world=simple upload reach.toml");
    assert!(forgotten.status.success() && said(&forgotten).contains(lost), "{}", said(&forgotten));
}

#[test]
fn a_log_of_the_buses_without_its_last_lines_is_no_success() {
    let folder = tempfile::tempdir().unwrap();
    let output = without_room(folder.path(), "--device sil:world=simple,bus=bus.log list");
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(said(&output).contains("E235") && said(&output).contains("bus.log"), "{}", said(&output));
}

/// Names of unfinished files in a folder.
fn parts(folder: &Path) -> Vec<String> {
    let names = folder.read_dir().unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    names.filter(|name| name.ends_with(".part")).collect()
}

/// Sends a signal by the system's own program.
fn signal(child: &Child, signal: &str) {
    assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
}

/// The changes that make it fail: `learn` does not clear away; or a signal is missing in `ENDING`.
#[test]
fn a_command_that_is_interrupted_leaves_nothing_unfinished() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    // A pipe into which nobody writes: the command waits for its input, and its output has begun.
    assert!(Command::new("mkfifo").arg(folder.join("demo.csv")).status().unwrap().success());
    let deadline = Instant::now() + Duration::from_secs(60);
    for name in ["INT", "TERM", "HUP", "QUIT"] {
        // A shell that starts the tests in the background has them ignore Ctrl-C, and so would the command.
        let mut child = heeding(name, folder, "learn demo.csv -o a.toml").stderr(Stdio::null()).spawn().unwrap();
        while parts(folder).is_empty() {
            assert_eq!(child.try_wait().unwrap(), None, "it ended by itself");
            assert!(Instant::now() < deadline, "it has not begun");
            std::thread::yield_now();
        }
        signal(&child, &format!("-{name}"));
        assert_eq!(child.wait().unwrap().code(), None, "{name} ends it");
        assert_eq!(parts(folder), Vec::<String>::new(), "{name}");
    }
}

const HEAD: &str = "t_s,q1_rad,q2_rad,q3_rad,q4_rad,q5_rad,q6_rad,q7_rad\n";

/// A movement that takes so many seconds at 50 Hz, with its times and its angles in other units.
fn recording(folder: &Path, name: &str, duration: f64, [time_unit, angle_unit]: [f64; 2]) {
    let lines = (duration * 50.0).max(90.0) as u32;
    let line = |line: u32| {
        let part = f64::from(line) / f64::from(lines);
        let angles = common::posture(part).map(|angle| format!("{:.6}", angle * angle_unit));
        format!("{},{}\n", part * duration * time_unit, angles.join(","))
    };
    std::fs::write(folder.join(name), HEAD.to_owned() + &(0..=lines).map(line).collect::<String>()).unwrap();
}

#[test]
fn a_recording_in_other_units_is_told_so_with_the_way_to_mend_it() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    recording(folder, "right.csv", 3.0, [1.0, 1.0]);
    recording(folder, "degrees.csv", 3.0, [1.0, f64::to_degrees(1.0)]);
    recording(folder, "milliseconds.csv", 3.0, [1000.0, 1.0]);
    assert!(tactus(folder, "learn right.csv").status.success());
    for (name, question, help) in [
        ("degrees.csv", "are these degrees?", "help: convert the joint angles to radians"),
        ("milliseconds.csv", "are these milliseconds?", "help: convert the times to seconds"),
    ] {
        let refused = tactus(folder, &format!("learn {name}"));
        assert_eq!(refused.status.code(), Some(6), "{}", said(&refused));
        assert!(said(&refused).contains(question) && said(&refused).contains(help), "{}", said(&refused));
    }
}

#[test]
fn a_movement_that_no_arm_would_play_is_not_learned() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (name, duration) in [("short.csv", 0.45), ("long.csv", 130.0)] {
        recording(folder, name, duration, [1.0, 1.0]);
        let refused = tactus(folder, &format!("learn --no-trim {name} -o a.toml"));
        assert_eq!(refused.status.code(), Some(6), "{name}: {}", said(&refused));
        assert!(said(&refused).contains("an arm plays 0.5 to 120 s"), "{}", said(&refused));
        assert!(!folder.join("a.toml").exists());
    }
}

/// The changes that make it fail: `--no-trim` is advised for every movement that was led slowly, also where it is
/// refused then; the command line is repeated with `--still-speed` beside it, which is no use of the two.
#[test]
fn a_movement_that_was_led_slowly_is_learned_whole_where_an_arm_plays_that_long() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (duration, option, is_playable) in [
        (100.0, "", true),
        (100.0, "--still-speed 0.004", true),
        (115.0, "--dwell 10", false),
        (150.0, "", false),
        (150.0, "--speed 2", true),
    ] {
        // At 2 mm/s, and over 8 cm.
        let line = |line: u32| {
            let part = a_fifth(f64::from(line) / (duration * 50.0));
            format!("{},{}\n", f64::from(line) / 50.0, part.map(|angle| format!("{angle:.6}")).join(","))
        };
        let lines = (0..=(duration * 50.0) as u32).map(line).collect::<String>();
        std::fs::write(folder.join("slow.csv"), HEAD.to_owned() + &lines).unwrap();
        let line = format!("learn --force slow.csv -o a.toml {option}");
        let refused = tactus(folder, &line);
        assert_eq!(refused.status.code(), Some(6), "{line}: {}", said(&refused));
        let words = said(&refused);
        let help = words.lines().find_map(|line| line.trim().strip_prefix("help: ")).unwrap_or_default();
        if is_playable {
            let again = help.strip_prefix("tactus ").unwrap_or_default();
            let learned = tactus(folder, again);
            assert!(learned.status.success(), "{help}: {}", said(&learned));
        } else {
            assert_eq!(help, "show it faster, or in parts", "{line}");
        }
    }
}

/// The posture at a part of the usual movement, a fifth as far from its start.
fn a_fifth(part: f64) -> [f64; 7] {
    let (start, at) = (common::START, common::posture(part));
    std::array::from_fn(|joint| start[joint] + 0.2 * (at[joint] - start[joint]))
}

#[test]
fn a_recording_of_an_arm_that_stands_is_not_said_to_be_learnable() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let lines = (0..200).map(|line| format!("{},0,0.5,0,1.5,0,0,0\n", f64::from(line) * 0.02));
    std::fs::write(folder.join("still.csv"), HEAD.to_owned() + &lines.collect::<String>()).unwrap();
    let refused = tactus(folder, "learn still.csv");
    assert_eq!(refused.status.code(), Some(6), "{}", said(&refused));
    assert!(
        !said(&refused).contains("--no-trim") && said(&refused).contains("show the movement"),
        "{}",
        said(&refused)
    );
}

/// The change that makes it fail: the help knows a simulated arm only; a person may have a board.
#[test]
fn a_socket_at_which_nobody_serves_is_no_cable() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    drop(std::os::unix::net::UnixListener::bind(folder.join("dead.sock")).unwrap());
    for socket in ["dead.sock", "none.sock"] {
        let refused = tactus(folder, &format!("--device unix:{socket} list"));
        assert_eq!(refused.status.code(), Some(3), "{}", said(&refused));
        let serving = format!("--device sil: sim --listen unix:{socket}");
        let help = format!("`tactus {serving}`");
        assert!(said(&refused).contains(&help) && !said(&refused).contains("cable"), "{}", said(&refused));
        for word in ["`--device serial:PORT` or `can:INTERFACE`", "pass its line on"] {
            assert!(said(&refused).contains(word), "{}", said(&refused));
        }
        // It serves where the environment names the socket, too: this is how such a device is usually named.
        let mut served = tool::command(folder, format!("{serving} --duration 0.1 --fast").as_str());
        let served = served.env("TACTUS_DEVICE", format!("unix:{socket}")).output().unwrap();
        assert!(served.status.success(), "{}", said(&served));
    }
    // Where no arm can be served either, nobody is told to serve one there.
    std::fs::write(folder.join("a.csv"), "").unwrap();
    for (address, words) in [
        ("unix:a.csv", "a.csv is no socket"),
        ("unix:.", ". is no socket"),
        ("unix:none/a.sock", "there is no folder none"),
        ("tcp:nobody.invalid:3333", "check the name of the computer"),
    ] {
        let refused = tactus(folder, &format!("--device {address} list"));
        assert_eq!(refused.status.code(), Some(3), "{address}: {}", said(&refused));
        assert!(said(&refused).contains(words) && !said(&refused).contains("tactus sim"), "{}", said(&refused));
    }
}
