//! `tactus can` on logs of simulated arms, of the golden transcripts, and of nobody.

use std::path::PathBuf;
use std::sync::OnceLock;

use canlog::{BusKind, InterfaceTotals, Kind, LogLine, Reader};
use serde_json::Value;
use tempfile::TempDir;

use crate::common;
use crate::tool::{judged as tactus, stderr, stdout};

/// A whole start-up, an upload and a run on a simulated arm, both buses logged. Made once for all tests.
fn recorded() -> &'static (TempDir, String) {
    static RECORDED: OnceLock<(TempDir, String)> = OnceLock::new();
    RECORDED.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        common::demonstration(folder.path(), 2.0);
        tactus(folder.path(), &["learn", "demo.csv", "-o", "reach.toml"]).success();
        let device = "sil:world=simple,line=can,bus=bus.log";
        tactus(folder.path(), &["--device", device, "run", "reach.toml", "--mode", "track"]).success();
        let log = std::fs::read_to_string(folder.path().join("bus.log")).unwrap();
        (folder, log)
    })
}

fn lines(log: &str) -> impl Iterator<Item = LogLine> {
    log.lines().map(|line| line.parse().unwrap())
}

/// Writes a log to a folder of its own.
fn log_file(text: &str) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("bus.log");
    std::fs::write(&file, text).unwrap();
    (folder, file)
}

#[test]
fn every_frame_of_a_whole_start_up_and_run_has_a_name() {
    let (_, log) = recorded();
    let mut reader = Reader::default();
    let mut said = std::collections::BTreeMap::<String, u32>::new();
    let mut count = [0_u32; 2];
    for line in lines(log) {
        let (meaning, interface) = reader.read(&line);
        assert!(meaning.is_named(), "{line}: {meaning:?}");
        assert!(!meaning.from.starts_with("node") && !meaning.to.starts_with("group"), "{line}: {meaning:?}");
        count[usize::from(interface.kind() == BusKind::Host)] += 1;
        if meaning.kind != Kind::Link {
            // Without their numbers, to count what is said at all.
            let words = meaning.sentence().split([' ', '=']).take(2).collect::<Vec<_>>().join(" ");
            *said.entry(format!("{} > {}: {words}", meaning.from, meaning.to)).or_default() += 1;
        }
    }
    assert!(count[0] > 50_000 && count[1] > 20_000, "{count:?}");
    for expected in [
        "host > M7 wrist roll: SET STAT",
        "M1 shoulder yaw > host: IPNM ",
        "host > safety module: SET IFAULT",
        "host > M4 elbow: SET P",
        "host > safety module: SET ZERO",
        "host > F/T sensor: SET FT",
        "host > F/T sensor: GET FT",
        "F/T sensor > host: force x",
        "host > M1 to M4: packed torques",
        "host > M5 to M7: packed torques",
        "host > hand: packed torques",
        "host > hand F1: SET CMD",
        "host > hand: GET SG",
        "safety module > host: PEN ",
        "safety module > all motors: safety broadcast",
    ] {
        assert!(said.contains_key(expected), "nobody said '{expected}': {:#?}", said.keys());
    }
}

/// At 300 Hz: a cycle with a driven hand fits into its period, which it does not at 500 Hz (decision 0017).
#[test]
fn summary_agrees_with_what_the_simulator_counted() {
    let (folder, _) = recorded();
    let text = stdout(&tactus(folder.path(), &["--json", "can", "decode", "bus.log", "--summary"]).success());
    let summary: Value = serde_json::from_str(&text).unwrap();
    let arm = &summary["summary"]["interfaces"][0];
    assert_eq!((arm["interface"].as_str(), arm["unnamed"].as_u64()), (Some("can0"), Some(0)));
    let nodes = arm["nodes"].as_array().unwrap();
    assert_eq!(nodes.len(), 7 + 1 + 1 + 4);
    for node in nodes {
        assert_eq!((node["lost"].as_u64(), node["unasked"].as_u64()), (Some(0), Some(0)), "{node}");
        assert!(node["answered"].as_u64().unwrap() + 5 > node["asked"].as_u64().unwrap(), "{node}");
    }
    let cycle = &arm["cycle"];
    let mean = cycle["mean_us"].as_f64().unwrap();
    assert!((mean - 83_334.0 / 25.0).abs() < 0.1, "{mean} us");
    assert!(cycle["longest_us"].as_f64().unwrap() < mean + 140.0, "at most a frame late: {cycle}");
    let load = arm["load"].as_f64().unwrap();
    assert!((0.4..0.7).contains(&load), "{load}");
    let told = stdout(&tactus(folder.path(), &["can", "decode", "bus.log", "--summary"]).success());
    assert!(told.contains("every frame is known") && told.contains("control cycle: "), "{told}");
}

/// At 300 Hz: a cycle with a driven hand fits into its period, which it does not at 500 Hz (decision 0017).
#[test]
fn a_lost_reply_is_counted_where_it_was_owed() {
    let (_, log) = recorded();
    // One of the positions of M4.
    let lost = log.lines().enumerate().filter(|(_, line)| line.contains(" can0 483#")).nth(1000).unwrap().0;
    let (mut reader, mut totals) = (Reader::default(), InterfaceTotals::default());
    for (number, line) in lines(log).enumerate() {
        if &*line.interface == "can0" && number != lost {
            let (meaning, _) = reader.read(&line);
            totals.note(&line, &meaning);
        }
    }
    let summary = totals.sum("can0", &reader.interfaces()[0].decoder);
    let lost: Vec<(&str, u64)> =
        summary.nodes.iter().filter(|node| node.lost > 0).map(|node| (node.name.as_str(), node.lost)).collect();
    assert_eq!(lost, [("M4 elbow", 1)]);
}

#[test]
fn every_frame_of_the_golden_transcripts_has_a_name() {
    for name in ["transcript_safety_ctor.csv", "transcript_hand_init.csv"] {
        let path = format!(concat!(env!("CARGO_MANIFEST_DIR"), "/../crates/puck/tests/vectors/{}"), name);
        let text = std::fs::read_to_string(path).unwrap();
        let mut reader = Reader::default();
        let mut said = Vec::new();
        for (number, row) in text.lines().filter(|line| !line.starts_with('#')).skip(1).enumerate() {
            let cells: Vec<&str> = row.split(',').collect();
            let id = cells[1].trim_start_matches("0x");
            let line = format!("(0.{number:06}) can0 {id}#{}", cells[3].replace(' ', ""));
            let line: LogLine = line.parse().unwrap();
            let (meaning, _) = reader.read(&line);
            assert!(meaning.is_named(), "{name}: {row}: {meaning:?}");
            assert_eq!(meaning.from == "host", cells[0] == "T", "{name}: {row}");
            said.push(format!("{} > {}: {}", meaning.from, meaning.to, meaning.sentence()));
        }
        let says = |words: &str| said.iter().any(|line| line == words);
        if name.contains("safety") {
            assert!(says("host > safety module: SET DEF = VL1 (45)"), "{said:#?}");
        } else {
            assert!(says("host > hand spread: SET CMD = HI: initialise (13)"), "{said:#?}");
            assert!(says("host > hand F1: SET STAT = READY (2)"), "{said:#?}");
        }
    }
}

#[test]
fn garbage_is_reported_with_line_numbers_and_the_rest_is_decoded() {
    let (folder, _file) = log_file(
        "(1.000000) can0 404#30\nhello\n\n# a note\n(1.000100) can0 423#8010\n(1.0002) can0 404#3\n\
         (1.000300) can0 12345678#01\n(1.000400) can0 423#R\n(1.000500) can0 20000040#0000000000000000\n\u{1}\u{2}\n",
    );
    let run = tactus(folder.path(), &["can", "decode", "bus.log"]).code(6);
    let (out, words) = (stdout(&run), stderr(&run));
    for number in [2, 6, 10] {
        assert!(words.contains(&format!("line {number}: ")), "{words}");
    }
    assert_eq!(words.lines().filter(|line| line.starts_with("line ")).count(), 3, "{words}");
    assert!(
        words.contains("error[E671]: can decode: 3 lines are not in candump's format, the first is line 2"),
        "{words}"
    );
    assert!(out.contains("GET P"), "{out}");
    assert!(out.contains("unknown: wrong length for this reply"), "{out}");
    assert!(out.contains("unknown: 29-bit identifier") && out.contains("unknown: remote frame"), "{out}");
    assert!(out.contains("error frame: bus-off"), "{out}");
    assert!(out.contains("3 unknown frames"), "{out}");
}

/// The change that makes it fail: only a newline ends a line, or both of its characters count as one each.
#[test]
fn a_log_whose_lines_end_in_carriage_returns_is_read_and_its_lines_are_numbered() {
    let lines = ["(1.000000) can0 404#30", "hello", "(1.000100) can0 423#8010", "world"];
    let decoded = |text: &str| {
        let (folder, _file) = log_file(text);
        let run = tactus(folder.path(), &["can", "decode", "bus.log"]).code(6);
        (stdout(&run), stderr(&run))
    };
    let usual = decoded(&lines.join("\n"));
    assert!(usual.1.contains("line 2: ") && usual.1.contains("line 4: "), "{}", usual.1);
    for end in ["\r", "\r\n"] {
        assert_eq!(decoded(&lines.join(end)), usual, "{end:?}");
    }
    // Longer than one line can be.
    let (_, log) = recorded();
    let part: String = log.lines().take(2000).map(|line| format!("{line}\r")).collect();
    let (folder, _file) = log_file(&part);
    let text = stdout(&tactus(folder.path(), &["can", "decode", "bus.log"]).success());
    assert!(text.lines().count() > 2000, "{}", text.lines().count());
}

/// The change that makes it fail: a wrong line is told by what panics where nobody can be told.
#[test]
fn wrong_lines_of_which_nobody_can_be_told_are_no_crash() {
    let (folder, _file) = log_file("(1.000000) can0 404#30\nhello\nworld\n");
    let line = "\"$0\" can decode bus.log 2>&1 >out | true; \
                test ${PIPESTATUS[0]} = 6 && \"$0\" can decode bus.log 2>/dev/full >out";
    for _ in 0..5 {
        let mut shell = std::process::Command::new("bash");
        shell.current_dir(folder.path()).args(["-c", line, env!("CARGO_BIN_EXE_tactus")]);
        assert_eq!(shell.output().unwrap().status.code(), Some(6));
        assert!(std::fs::read_to_string(folder.path().join("out")).unwrap().contains("GET P"));
    }
}

#[test]
fn json_is_one_object_a_line_and_the_summary_last() {
    let (folder, _file) = log_file("(1.000000) can0 404#30\n(1.000200) can0 423#801000\n");
    let text = stdout(&tactus(folder.path(), &["--json", "can", "decode", "bus.log"]).success());
    let lines: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(lines.len(), 3);
    assert_eq!(lines[0]["kind"], "get");
    assert_eq!(lines[1]["from"], "M1 shoulder yaw");
    assert_eq!(lines[1]["values"][0]["raw"], 4096);
    assert!(lines[2]["summary"]["interfaces"][0]["frames"] == 2, "{}", lines[2]);
}

#[test]
fn a_log_that_is_not_there_and_no_log_at_all_are_told_apart() {
    let folder = tempfile::tempdir().unwrap();
    let missing = stderr(&tactus(folder.path(), &["can", "decode", "nothing.log"]).code(2));
    assert!(missing.starts_with("error[E233]: can decode: cannot read nothing.log"), "{missing}");
    let none = stderr(&tactus(folder.path(), &["can", "decode"]).code(2));
    assert!(none.starts_with("error[E209]: can decode: neither a log nor an interface is named"), "{none}");
    let live = stderr(&tactus(folder.path(), &["can", "decode", "--interface", "nocan7"]).code(3));
    assert!(live.starts_with("error[E303]: "), "{live}");
}

/// At 300 Hz: the lines carry the telemetry of every cycle, which they do not at 500 Hz (decision 0017).
#[test]
fn cli_20_a_whole_start_up_and_run_replays_without_a_difference() {
    let (folder, log) = recorded();
    let text = stdout(&tactus(folder.path(), &["--json", "can", "replay", "bus.log"]).success());
    let outcome: Value = serde_json::from_str(&text).unwrap();
    // Group replies carry no sender 0: what the host sent is what has the identifiers of node 0.
    let of_device = lines(log).filter(|line| {
        &*line.interface == "can0" && u16::from_str_radix(&line.frame.id_text(), 16).unwrap() & 0x3E0 == 0
    });
    let of_device = of_device.count() as u64;
    assert!(of_device > 10_000);
    assert_eq!(outcome["logged"], of_device);
    assert_eq!((&outcome["same"], &outcome["different"]), (&of_device.into(), &0.into()));
    assert_eq!(outcome["telemetry"][0], outcome["telemetry"][1]);
    assert!(outcome["telemetry"][0].as_u64().unwrap() > 500, "{outcome}");
}

#[test]
fn a_log_of_another_clock_replays_as_well() {
    let (_, log) = recorded();
    // The clock of a computer that counts since 1970, and runs 50 in a million too fast.
    let shifted: String = lines(log)
        .map(|line| {
            let time_us = 1_700_000_000_000_000 + line.time_us + line.time_us * 50 / 1_000_000;
            format!("{}\n", LogLine { time_us, ..line })
        })
        .collect();
    let (folder, _file) = log_file(&shifted);
    let text = stdout(&tactus(folder.path(), &["can", "replay", "bus.log"]).success());
    assert!(text.ends_with("no difference\n"), "{text}");
}

#[test]
fn a_changed_torque_is_found_at_its_line() {
    let (_, log) = recorded();
    let (number, line) = log.lines().enumerate().filter(|(_, line)| line.contains(" can0 401#AA")).nth(900).unwrap();
    let changed = format!("{}{}", &line[..line.len() - 1], if line.ends_with('0') { '1' } else { '0' });
    let (folder, _file) = log_file(&log.replacen(line, &changed, 1));
    let run = tactus(folder.path(), &["can", "replay", "bus.log"]).code(6);
    assert!(stdout(&run).contains("1 different"), "{}", stdout(&run));
    assert!(stderr(&run).contains(&format!("first: line {}, ", number + 1)), "{}", stderr(&run));
    assert!(stderr(&run).contains("error[E672]"));
    // A script gets one object: the failure with the outcome in it.
    let told = stdout(&tactus(folder.path(), &["--json", "can", "replay", "bus.log"]).code(6));
    let told: Value = serde_json::from_str(&told).unwrap();
    assert_eq!((&told["error"]["code"], &told["result"]["different"]), (&"E672".into(), &1.into()));
}

/// Guards that a log of the arm's bus alone, which no replay can reproduce, is answered with the way to log both.
#[test]
fn a_log_without_the_hosts_orders_is_answered_with_the_line_that_logs_them() {
    let (_, log) = recorded();
    let alone: String = log.lines().filter(|line| line.contains(" can0 ")).map(|line| format!("{line}\n")).collect();
    let (folder, _file) = log_file(&alone);
    let words = stderr(&tactus(folder.path(), &["can", "replay", "bus.log"]).code(6));
    assert!(words.contains("error[E672]") && words.contains("the log does not hold the host's bus"), "{words}");
    assert!(words.contains("`tactus --device sil:line=can run PRIMITIVE --bus-log FILE`"), "{words}");
}

#[test]
fn a_frame_too_many_and_a_frame_too_few_are_told_apart() {
    let (_, log) = recorded();
    let line = log.lines().filter(|line| line.contains(" can0 402#AA")).nth(500).unwrap();
    let fewer = log.replacen(&format!("{line}\n"), "", 1);
    let (folder, _file) = log_file(&fewer);
    let words = stderr(&tactus(folder.path(), &["can", "replay", "bus.log"]).code(6));
    assert!(words.contains("1 frame of the device differs") && words.contains("the log has it not"), "{words}");
    let more = log.replacen(line, &format!("{line}\n{}", line.replace("402#AA", "401#AA")), 1);
    let (folder, _file) = log_file(&more);
    let words = stderr(&tactus(folder.path(), &["can", "replay", "bus.log"]).code(6));
    assert!(words.contains("1 frame of the device differs") && words.contains("did not send it"), "{words}");
}

#[test]
fn a_silenced_puck_changes_what_the_device_does() {
    let (_, log) = recorded();
    // M3 is not heard any more from the middle of the run on.
    let middle = log.lines().count() * 3 / 4;
    let silenced: String = log
        .lines()
        .enumerate()
        .filter(|(number, line)| *number < middle || !line.contains(" can0 463#"))
        .map(|(_, line)| format!("{line}\n"))
        .collect();
    let (folder, _file) = log_file(&silenced);
    let run = tactus(folder.path(), &["can", "replay", "bus.log"]).code(6);
    assert!(stdout(&run).contains("host > M3 shoulder: GET STAT"), "the suspected puck is asked: {}", stdout(&run));
}

#[test]
fn a_log_that_begins_in_the_middle_is_refused() {
    let (_, log) = recorded();
    let middle: String = log.lines().skip(20_000).map(|line| format!("{line}\n")).collect();
    let (folder, _file) = log_file(&middle);
    let words = stderr(&tactus(folder.path(), &["can", "replay", "bus.log"]).code(6));
    assert!(words.starts_with("error[E673]: can replay: the log begins in the middle"), "{words}");
    let (folder, _file) = log_file("");
    let words = stderr(&tactus(folder.path(), &["can", "replay", "bus.log"]).code(6));
    assert!(words.contains("the log holds no frame that a co-controller has sent"), "{words}");
}

#[test]
fn two_logs_in_one_file_are_told_as_such_and_not_as_another_version() {
    let (_, log) = recorded();
    let (folder, file) = log_file(&format!("{log}{log}"));
    let said = stderr(&tactus(folder.path(), &["can", "replay", &file.to_string_lossy()]).failure().code(6));
    let line = log.lines().count() + 1;
    assert!(said.starts_with("error[E673]") && said.contains(&format!("line {line}: time leaps")), "{said}");
}

#[test]
fn a_replay_that_is_interrupted_says_that_nothing_can_be_said() {
    use std::io::Write;
    use std::process::{Command, Stdio};
    let (_, log) = recorded();
    let mut command = Command::new(env!("CARGO_BIN_EXE_tactus"));
    command.args(["can", "replay", "-"]).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut replay = command.spawn().unwrap();
    let mut input = replay.stdin.take().unwrap();
    // More than a pipe holds: it has read the beginning, and hears signals.
    let (first, rest) = log.as_bytes().split_at(log.len() / 2);
    assert!(first.len() > 200_000, "{}", first.len());
    input.write_all(first).unwrap();
    assert!(Command::new("kill").args(["-s", "INT", &replay.id().to_string()]).status().unwrap().success());
    // It may be gone already.
    let _ = input.write_all(rest);
    drop(input);
    let ended = replay.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(130), "{said}");
    assert!(said.contains("nothing can be said") && ended.stdout.is_empty(), "{said}");
}

/// The change that makes it fail: a log that is shorter than what was read of it is waited for.
#[test]
fn a_log_that_is_begun_anew_is_followed_from_its_beginning() {
    use std::io::{BufRead, BufReader};
    use std::process::Stdio;

    let (_, log) = recorded();
    let part = |lines: std::ops::Range<usize>| {
        log.lines().skip(lines.start).take(lines.len()).map(|line| format!("{line}\n")).collect::<String>()
    };
    let (folder, file) = log_file(&part(0..40));
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_tactus"));
    command.current_dir(folder.path()).args(["--json", "can", "decode", "--follow", "bus.log"]);
    let mut follower = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let output = follower.stdout.take().unwrap();
    let (sender, receiver) = std::sync::mpsc::channel();
    std::thread::spawn(move || BufReader::new(output).lines().map_while(Result::ok).for_each(|l| drop(sender.send(l))));
    let next = |count: usize| -> Vec<Value> {
        let wait = std::time::Duration::from_secs(20);
        let lines = (0..count).map_while(|_| receiver.recv_timeout(wait).ok());
        lines.map(|line| serde_json::from_str(&line).unwrap()).collect()
    };
    let first = next(40);
    std::fs::write(&file, part(0..10)).unwrap();
    let again = next(10);
    let _ = follower.kill();
    let ended = follower.wait_with_output().unwrap();
    assert_eq!((first.len(), again.len()), (40, 10), "what stands in the new log is told");
    assert!(first.iter().zip(&again).all(|(one, other)| one["time_s"] == other["time_s"]), "{again:?}");
    assert!(String::from_utf8_lossy(&ended.stderr).contains("bus.log was begun anew"));
}

/// Seen: two logs one behind the other, or a clock that was set back, made `bus load 100.0 %` of 56 %, with exit code 0
/// and no word. The change that makes it fail: the totals are given the times as the log has them.
#[test]
fn a_log_whose_time_goes_back_is_told_and_its_load_stays_what_it_was() {
    let (_, log) = recorded();
    let (folder, _) = log_file(&[log.as_str(), log.as_str()].concat());
    let decoded = tactus(folder.path(), &["--json", "can", "decode", "bus.log", "--summary"]).success();
    let said = stderr(&decoded);
    let second = log.lines().count() + 1;
    assert!(said.contains(&format!("line {second}: time goes back from ")), "{said}");
    let sum: Value = serde_json::from_str(&stdout(&decoded)).unwrap();
    let (alone, _) = log_file(log);
    let one = tactus(alone.path(), &["--json", "can", "decode", "bus.log", "--summary"]).success();
    assert!(stderr(&one).is_empty(), "{}", stderr(&one));
    let one: Value = serde_json::from_str(&stdout(&one)).unwrap();
    assert_eq!((&sum["summary"]["times_set_back"], &one["summary"]["times_set_back"]), (&1.into(), &0.into()));
    let of = |sum: &Value, key: &str| sum["summary"]["interfaces"][0][key].as_f64().unwrap();
    assert!((of(&sum, "load") - of(&one, "load")).abs() < 0.01, "{sum}");
    assert!((of(&sum, "seconds") - 2.0 * of(&one, "seconds")).abs() < 0.1, "{sum}");
    let cycle = |sum: &Value| sum["summary"]["interfaces"][0]["cycle"]["shortest_us"].as_u64().unwrap();
    assert_eq!(cycle(&sum), cycle(&one), "{sum}");
}
