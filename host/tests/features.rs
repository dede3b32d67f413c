//! `docs/cli.md`: the twenty features that the command line tool shall have, with the tests that hold them.
//!
//! A test whose name begins with `cli_N_` is a proof of row N, in whatever crate it is. After a change of the rows or
//! of such names: `UPDATE_DOCUMENTS=1 cargo test -p tactus --test command features::` writes the document anew.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::{Duration, Instant};

use crate::tool::{self, learned, succeeds};

/// A feature: name, commands, bar, and what is still missing (empty: held).
type Feature = (&'static str, &'static str, &'static str, &'static str);

/// The rows from 1 on.
const ROWS: [Feature; 20] = [
    (
        "versions are compared first",
        "every one with a device",
        "link version, schema and robot model; another one ends \
     with 4, names both, and nothing else is sent",
        "",
    ),
    (
        "faults in words",
        "`faults`, `explain`",
        "every code has meaning and remedy, without a device as well; the last second before it is kept",
        "",
    ),
    (
        "a stop that is confirmed",
        "`run`, `record`, `monitor`, `stop`",
        "Ctrl-C ends with 130 after the device confirmed \
     the stop; a second one ends at once; a host that dies is noticed within 500 ms",
        "",
    ),
    (
        "upload in one piece",
        "`upload`",
        "check sums of pieces and image, read back; a cut leaves the old primitive or \
     the new one; the same image is not sent again",
        "",
    ),
    (
        "check before motion",
        "`check`, `run --dry-run`",
        "the control crate plays the movement; the worst margin of each \
     limit with its time; a violation ends with 6",
        "",
    ),
    (
        "simulated device",
        "`--device sil:`, `sim`",
        "every command works without hardware; equal seeds give equal output \
     to the byte",
        "",
    ),
    ("learning", "`learn`", "fit error, kernels and duration are told; a bad file is named with line and column", ""),
    (
        "recording",
        "`record`, `run --record`",
        "one layout with units; lost samples are counted; what was recorded is \
     kept",
        "",
    ),
    ("live view", "`monitor`", "joints, wrench, times, bus and faults on 80 x 24; a line stream with `--json`", ""),
    (
        "a run with preconditions",
        "`run`",
        "each with its value before anything moves; what is missing is named with its remedy, and ends with 5; the \
     end tells duration, force error, limits and lost samples",
        "",
    ),
    (
        "settings of the device",
        "`config get`, `set`, `dump`, `diff`, `restore`",
        "TOML, sorted, units in the names, comments kept; restored settings are read back and every difference told; \
     unknown and missing names are listed; those of another serial number need `--force`",
        "",
    ),
    (
        "health of the line",
        "`status --line`, the end of each `run`",
        "complete cycles of the newest 100, longest gap, answers (half, 99 %, slowest), bus errors, bus frames, \
     who was late; TEC and REC are null: the device does not tell them",
        "",
    ),
    (
        "output for scripts",
        "`--json` everywhere",
        "one object, or one a line; schemas in docs/schemas; exit codes as documented",
        "",
    ),
    ("errors that help", "all", "code, cause and a command that helps; no input ends in a panic", ""),
    ("calibration", "`calibrate`", "before and after, kept over a restart, with a report that names arm and time", ""),
    ("flashing and logs", "`flash`, `logs`", "the probe's command is shown; verified; stored primitives are kept", ""),
    ("doctor", "`doctor`", "permissions, versions, faults and settings in one file", ""),
    (
        "completions and manual",
        "`completions`, `manual`",
        "bash, zsh and fish know every command; each has a page of the manual",
        "",
    ),
    ("defaults", "`config`, `TACTUS_DEVICE`", "option before environment before file, and it is told which counts", ""),
    (
        "replay",
        "`run --bus-log`, `can replay`",
        "the device's application, given what the pucks and the host said in the log of a run, sends the same torque \
     frames to the bit (decision 0100)",
        "",
    ),
];

const HEAD: &str = "\
# Features of the command line tool

Who reads this: whoever wants to know which of the twenty features is proven. This file is written from
`host/tests/features.rs`; change it there. A test whose name begins with `cli_N_` belongs to row N. A row is held when
a test proves it and nothing of its bar is missing.

| | feature | command | bar | tests | state |
|---|---|---|---|---|---|
";

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Rust files of a folder and of those below it.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() && !path.ends_with("target") {
            sources(&path, found);
        } else if path.extension().is_some_and(|kind| kind == "rs") {
            found.push(path);
        }
    }
}

/// Names of the tests of each row.
fn proofs() -> BTreeMap<usize, BTreeSet<String>> {
    let mut files = Vec::new();
    ["host", "crates", "tests"].iter().for_each(|folder| sources(&root().join(folder), &mut files));
    let mut proofs: BTreeMap<usize, BTreeSet<String>> = BTreeMap::new();
    for file in files {
        let text = std::fs::read_to_string(&file).unwrap();
        for rest in text.lines().filter_map(|line| line.trim_start().strip_prefix("fn cli_")) {
            let (number, _) = rest.split_once('_').unwrap();
            let name = rest.split('(').next().unwrap();
            proofs.entry(number.parse().unwrap()).or_default().insert(format!("cli_{name}"));
        }
    }
    proofs
}

#[test]
fn the_table_of_features_is_what_the_tests_hold() {
    let proofs = proofs();
    assert!(proofs.keys().all(|number| (1..=ROWS.len()).contains(number)), "a test of no row: {proofs:?}");
    let mut text = HEAD.to_owned();
    for (number, (feature, command, bar, missing)) in (1..).zip(ROWS) {
        let tests: Vec<String> = proofs.get(&number).into_iter().flatten().map(|name| format!("`{name}`")).collect();
        assert!(!missing.is_empty() || !tests.is_empty(), "row {number} is said to be held, and no test proves it");
        let state = if missing.is_empty() { "**held**".to_owned() } else { format!("open: {missing}") };
        let tests = if tests.is_empty() { "-".to_owned() } else { tests.join(", ") };
        writeln!(text, "| {number} | {feature} | {command} | {bar} | {tests} | {state} |").unwrap();
    }
    let path = root().join("docs/cli.md");
    if std::env::var_os("UPDATE_DOCUMENTS").is_some() {
        std::fs::write(&path, &text).unwrap();
    }
    let found = std::fs::read_to_string(&path).unwrap();
    let differs = found.lines().zip(text.lines()).find(|(found, text)| found != text);
    assert!(
        found == text,
        "UPDATE_DOCUMENTS=1 cargo test -p tactus --test command features:: mends it; first: {differs:?}"
    );
}

fn command(folder: &Path, line: &str) -> std::process::Command {
    let mut command = tool::command(folder, line);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Ctrl-C, and Ctrl-\\ of whoever does not wait for it.
///
/// The change that makes it fail: a signal is missing in `ENDING`. The program is gone then, and the arm goes on until
/// its device notices.
#[test]
fn cli_3_an_interrupted_run_ends_with_130_and_what_was_recorded_is_kept() {
    let folder = learned(20.0);
    let part = folder.path().join("run.csv.part");
    let run = "--device sil:world=simple --non-interactive run reach.toml --record run.csv";
    for signal in ["INT", "QUIT"] {
        let mut run = tool::heeding(signal, folder.path(), run);
        let child = run.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let begun = Instant::now();
        while !std::fs::metadata(&part).is_ok_and(|file| file.len() > 300_000) {
            assert!(begun.elapsed() < Duration::from_secs(120), "nothing is recorded");
            std::thread::sleep(Duration::from_millis(5));
        }
        let sent = std::process::Command::new("kill").args(["-s", signal, &child.id().to_string()]).status().unwrap();
        assert!(sent.success());
        let ended = child.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(130), "{signal}: {said}");
        assert!(said.contains("error[E130]") && said.contains("run.csv.part"), "{signal}: {said}");
        std::fs::remove_file(&part).unwrap();
    }
}

#[test]
fn cli_4_an_image_that_is_there_already_is_not_sent_again() {
    let folder = learned(3.0);
    let upload = "--device sil:world=simple,flash=arm.flash --non-interactive --json upload reach.toml";
    for sent in [true, false] {
        let told: serde_json::Value = serde_json::from_slice(&succeeds(folder.path(), upload).stdout).unwrap();
        assert_eq!(told["sent"], sent, "{told}");
    }
}

#[test]
fn cli_6_equal_seeds_give_equal_output_to_the_byte_and_another_seed_does_not() {
    let folder = learned(3.0);
    let recorded = |seed: u32| {
        let device = format!("--device sil:world=simple,seed={seed} --non-interactive --json --force");
        let told = succeeds(folder.path(), &format!("{device} run reach.toml --record run.csv")).stdout;
        (told, std::fs::read(folder.path().join("run.csv")).unwrap())
    };
    let one = recorded(3);
    assert!(one == recorded(3), "equal seeds differ");
    assert!(one.1 != recorded(4).1, "the seed changes nothing");
}

#[test]
fn cli_10_a_run_that_lacks_something_names_it_and_another_tells_how_it_ended() {
    let folder = learned(3.0);
    let device = "--device sil:world=simple --non-interactive --json";
    let refused = command(folder.path(), &format!("{device} run reach.toml --mode adapt")).output().unwrap();
    assert_eq!(refused.status.code(), Some(6));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("tactus rehearse reach.toml"));
    let told = succeeds(folder.path(), &format!("{device} run reach.toml")).stdout;
    let told: serde_json::Value = serde_json::from_slice(&told).unwrap();
    assert!(told["tracking"]["position_max_m"].is_number() && told["flags"]["limited"].is_number(), "{told}");
    assert!(told["force_error_max_n"].is_null(), "nothing is expected: {told}");
}

/// Preconditions of a result by their names: value, and whether it is met.
fn preconditions(told: &serde_json::Value) -> BTreeMap<String, (String, bool)> {
    let list = told["preconditions"].as_array().unwrap_or_else(|| panic!("no list: {told}")).iter();
    let entry = |item: &serde_json::Value| {
        assert_eq!(item["met"].as_bool(), Some(item["remedy"].is_null()), "{item}");
        (item["value"].as_str().unwrap().to_owned(), item["met"].as_bool().unwrap())
    };
    list.map(|item| (item["item"].as_str().unwrap().to_owned(), entry(item))).collect()
}

#[test]
fn cli_10_the_preconditions_are_listed_with_their_values_before_anything_moves() {
    let folder = learned(3.0);
    let device = "--device sil:world=simple --non-interactive --json";
    let output = succeeds(folder.path(), &format!("{device} run reach.toml --speed 0.5"));
    let list = preconditions(&serde_json::from_slice(&output.stdout).unwrap());
    assert!(list.values().all(|(_, met)| *met), "{list:?}");
    for (item, value) in [
        ("speed", "0.50 of the taught one: 6."),
        ("fault", "none"),
        ("joint angles", "count from home"),
        ("pendant", "active"),
        ("force sensor", "has its zero"),
        ("start posture", "rad away"),
        ("primitive", "reach, checksum 0x"),
        ("nearest limit", "of"),
    ] {
        assert!(list[item].0.contains(value), "{item}: {list:?}");
    }
    let said = String::from_utf8(output.stderr).unwrap();
    let (listed, moved) = (said.find("count from home"), said.find("running 'reach'"));
    assert!(listed.is_some() && listed < moved, "{said}");
    let dry = succeeds(folder.path(), &format!("{device} run reach.toml --dry-run")).stdout;
    let list = preconditions(&serde_json::from_slice(&dry).unwrap());
    assert!(!list["start-up"].1, "a dry run starts nothing up: {list:?}");
}

#[test]
fn cli_10_a_run_without_its_force_sensor_is_refused_before_the_arm_moves() {
    let folder = learned(3.0);
    let script = "[[scenario]]\nname = \"a silent sensor\"\nfrom = \"power-up\"\n\
        inject = [{ at = 0.0, lasts = 1e6, what.drop = { kind = \"sensor-request\" } }]\n";
    std::fs::write(folder.path().join("silent.toml"), script).unwrap();
    succeeds(folder.path(), "--device sil:world=simple --non-interactive rehearse reach.toml");
    let line = "--device sil:world=simple,faults=silent.toml --non-interactive --json run reach.toml --mode adapt";
    let refused = command(folder.path(), line).output().unwrap();
    let said = String::from_utf8(refused.stderr).unwrap();
    assert_eq!(refused.status.code(), Some(5), "{said}");
    assert!(said.contains("run refused: force sensor: ") && !said.contains("running 'reach'"), "{said}");
    let told: serde_json::Value = serde_json::from_slice(&refused.stdout).unwrap();
    let list = preconditions(&told["result"]);
    assert_eq!(list.iter().filter(|(_, (_, met))| !met).map(|(item, _)| &**item).collect::<Vec<_>>(), ["force sensor"]);
}

/// At 300 Hz: the lines carry the telemetry of every cycle, which they do not at 500 Hz (decision 0017).
#[test]
fn cli_12_the_line_is_measured_alone_and_in_the_summary_of_each_run() {
    let folder = learned(3.0);
    let device = "--device sil:world=simple --non-interactive";
    let told: serde_json::Value =
        serde_json::from_slice(&succeeds(folder.path(), &format!("{device} --json status --line 2")).stdout).unwrap();
    let line = &told["line"];
    assert_eq!(line["success_rate_newest_100"], 1.0, "{line}");
    assert!(line["answer_p50_ms"].as_f64().unwrap() <= line["answer_p99_ms"].as_f64().unwrap(), "{line}");
    assert!(line["answer_p99_ms"].as_f64().unwrap() <= line["answer_max_ms"].as_f64().unwrap(), "{line}");
    // Two seconds of cycles; the device does not tell the error counters of its bus controller.
    assert!((590..=640).contains(&line["cycles"].as_u64().unwrap()), "{line}");
    assert!(line["transmit_error_counter"].is_null() && line["receive_error_counter"].is_null(), "{line}");
    let said = String::from_utf8(succeeds(folder.path(), &format!("{device} status --line 2")).stdout).unwrap();
    assert!(said.contains("who was late") && said.contains("not told by the device"), "{said}");
    let said = String::from_utf8(succeeds(folder.path(), &format!("{device} run reach.toml")).stdout).unwrap();
    assert!(said.contains("100.0 % complete, longest gap 3.3 ms; late: nobody"), "{said}");
}

#[test]
fn cli_12_a_run_whose_pucks_leave_out_replies_says_so() {
    let folder = learned(3.0);
    let script = "[[scenario]]\nname = \"lost replies\"\nfrom = \"run\"\n\
        inject = [{ at = 3.0, every = 0.2, times = 60, lasts = 0.01, \
        what.drop = { kind = \"position\", from = [1], most = 1 } }]\n";
    std::fs::write(folder.path().join("lost.toml"), script).unwrap();
    let line = "--device sil:world=simple,faults=lost.toml --non-interactive --json run reach.toml";
    let told: serde_json::Value = serde_json::from_slice(&succeeds(folder.path(), line).stdout).unwrap();
    let line = &told["line"];
    assert!(line["lost_replies"].as_u64().unwrap() > 0, "{line}");
    assert!(line["success_rate"].as_f64().unwrap() < 1.0, "{line}");
    assert!(line["late"][0].as_str().unwrap().starts_with("the arm's bus"), "{line}");
}

/// At 300 Hz: the lines carry the telemetry of every cycle, which they do not at 500 Hz (decision 0017).
#[test]
fn cli_20_the_log_that_a_run_wrote_replays_to_the_bit() {
    let folder = learned(3.0);
    let device = "--device sil:world=simple,line=can --non-interactive";
    succeeds(folder.path(), &format!("{device} run reach.toml --record run.csv --bus-log run.log"));
    let told = succeeds(folder.path(), "--json can replay run.log").stdout;
    let told: serde_json::Value = serde_json::from_slice(&told).unwrap();
    assert_eq!((&told["different"], &told["has_host"]), (&0.into(), &true.into()), "{told}");
    assert_eq!(told["same"], told["logged"], "{told}");
    assert_eq!(told["telemetry"][0], told["telemetry"][1], "{told}");
    let text = std::fs::read_to_string(folder.path().join("run.csv")).unwrap();
    let recorded = text.lines().filter(|line| line.starts_with(|first: char| first.is_ascii_digit())).count() as u64;
    // Every cycle of the recording is one of those that were compared.
    assert!(recorded > 900 && told["telemetry"][0].as_u64().unwrap() >= recorded, "{recorded}: {told}");
}

/// A folder with a configuration file of these words; the command sees no other.
fn configured(words: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("tactus")).unwrap();
    std::fs::write(folder.path().join("tactus/config.toml"), words).unwrap();
    folder
}

#[test]
fn cli_19_an_option_counts_before_the_environment_and_this_before_the_file() {
    let folder = configured("device = \"nonsense-of-the-file\"\ntimeout = 7.5\n");
    let said = |line: &str, environment: bool| {
        let mut command = command(folder.path(), line);
        command.env("XDG_CONFIG_HOME", folder.path());
        if environment {
            command.env("TACTUS_DEVICE", "nonsense-of-the-environment").env("TACTUS_TIMEOUT", "3");
        }
        let output = command.output().unwrap();
        (output.status.code(), [output.stdout, output.stderr].map(|said| String::from_utf8(said).unwrap()).concat())
    };
    for (line, environment, device) in [
        ("list", false, "nonsense-of-the-file"),
        ("list", true, "nonsense-of-the-environment"),
        ("--device nonsense-of-the-option list", true, "nonsense-of-the-option"),
        ("list --device nonsense-of-the-option", true, "nonsense-of-the-option"),
    ] {
        let (code, said) = said(line, environment);
        assert!(code == Some(2) && said.contains(device), "{line}: {said}");
    }
    let shown = |line: &str, environment: bool| {
        let (code, said) = said(&format!("{line} --json"), environment);
        assert_eq!(code, Some(0), "{said}");
        let shown: serde_json::Value = serde_json::from_str(&said).unwrap();
        ["device", "timeout"].map(|name| {
            let setting = &shown["settings"][name];
            (setting["value"].as_str().unwrap_or_default().to_owned(), setting["origin"].as_str().unwrap().to_owned())
        })
    };
    let pair = |value: &str, origin: &str| (value.to_owned(), origin.to_owned());
    assert_eq!(shown("config", false), [pair("nonsense-of-the-file", "file"), pair("7.5", "file")]);
    assert_eq!(shown("config", true), [pair("nonsense-of-the-environment", "environment"), pair("3", "environment")]);
    assert_eq!(
        shown("config --device sil: --timeout 1", true),
        [pair("sil:", "command line"), pair("1", "command line")]
    );
    let plain = tempfile::tempdir().unwrap();
    let output = command(plain.path(), "config").env("XDG_CONFIG_HOME", plain.path()).output().unwrap();
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(said.contains("timeout") && said.contains("default") && said.contains("does not exist"), "{said}");
}

#[test]
fn cli_19_a_file_that_cannot_be_used_is_named_with_its_line_and_explain_goes_on() {
    for (words, line, what) in [
        ("timeout = 3\ndevise = \"sil:\"\n", "line 2", "devise"),
        ("timeout = \"soon\"\n", "line 1", "timeout"),
        ("timeout = -1\n", "timeout", "-1"),
        ("device = \n", "line 1", "device"),
        ("timeout = nan\n", "timeout", "NaN"),
        ("timeout = 86401\n", "timeout", "86401"),
        ("timeout = 1e-30\n", "timeout", "0.001 to 86400 s"),
    ] {
        let folder = configured(words);
        let run = |line: &str| command(folder.path(), line).env("XDG_CONFIG_HOME", folder.path()).output().unwrap();
        let output = run("--device sil:world=simple list");
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{words}: {said}");
        assert!(said.contains("E250") && said.contains("config.toml"), "{words}: {said}");
        assert!(said.contains(line) && said.contains(what), "{words}: {said}");
        assert!(run("explain E250").status.success() && run("--help").status.success(), "{words}");
    }
}

#[test]
fn cli_19_a_device_that_means_nothing_is_told_with_the_place_it_comes_from() {
    let folder = configured("device = \"nonsense\"\n");
    let said = |line: &str, environment: Option<&str>| {
        let mut command = command(folder.path(), line);
        command.env("XDG_CONFIG_HOME", folder.path());
        command.envs(environment.map(|device| ("TACTUS_DEVICE", device)));
        let output = command.output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{line}");
        String::from_utf8(output.stderr).unwrap()
    };
    for line in ["list", "hand --json init", "sim"] {
        let said = said(line, None);
        assert!(said.contains("E201") && said.contains("config.toml"), "{line}: {said}");
    }
    assert!(said("list", Some("rubbish")).contains("TACTUS_DEVICE"));
    let said = said("list --device waste", Some("rubbish"));
    assert!(!said.contains("TACTUS_DEVICE") && !said.contains("config.toml"), "{said}");
}

#[test]
fn cli_19_the_settings_are_shown_beside_a_file_that_cannot_be_used() {
    let folder = configured("timeout = \"soon\"\n");
    let run = |line: &str| command(folder.path(), line).env("XDG_CONFIG_HOME", folder.path()).output().unwrap();
    let shown = run("config --json");
    assert!(shown.status.success());
    let said = String::from_utf8(shown.stderr).unwrap();
    assert!(said.contains("config.toml") && said.contains("line 1"), "{said}");
    let shown: serde_json::Value = serde_json::from_slice(&shown.stdout).unwrap();
    assert_eq!(shown["settings"]["timeout"]["origin"], "default");
    assert!(shown["problem"].as_str().unwrap().contains("line 1"), "{shown}");
    std::fs::write(folder.path().join("tactus/config.toml"), "timeout = 3\n").unwrap();
    let shown: serde_json::Value = serde_json::from_slice(&run("config --json").stdout).unwrap();
    assert!(shown["problem"].is_null(), "{shown}");
}

#[test]
fn cli_17_the_doctor_tells_versions_ports_programs_settings_and_the_device_and_fails_with_it() {
    let folder = configured("timeout = 3\n");
    let run = |line: &str| command(folder.path(), line).env("XDG_CONFIG_HOME", folder.path()).output().unwrap();
    let verdict = |told: &serde_json::Value, subject: &str| {
        let findings = told["findings"].as_array().unwrap().iter();
        let mut found = findings.filter(|finding| finding["subject"] == subject);
        let found = found.next().unwrap_or_else(|| panic!("{subject} is missing: {told}"));
        (found["verdict"].as_str().unwrap().to_owned(), found["found"].as_str().unwrap().to_owned())
    };
    let well = run("doctor --device sil:world=simple --json --report doctor.json");
    assert!(well.status.success(), "{}", String::from_utf8_lossy(&well.stderr));
    let told: serde_json::Value = serde_json::from_slice(&well.stdout).unwrap();
    let kept = std::fs::read(folder.path().join("doctor.json")).unwrap();
    assert_eq!(serde_json::from_slice::<serde_json::Value>(&kept).unwrap(), told);
    for subject in ["tactus", "device setting", "device", "arm", "fault"] {
        assert_eq!(verdict(&told, subject).0, "ok", "{told}");
    }
    assert!(verdict(&told, "device setting").1.contains("sil:world=simple, from the command line"), "{told}");
    assert!(verdict(&told, "timeout setting").1.contains("3 s, from the configuration file"), "{told}");
    verdict(&told, "debug probe");
    verdict(&told, "QEMU");
    // What was written stays, and a report is no reason to ask the device.
    assert_eq!(run("doctor --device sil:world=simple --report doctor.json").status.code(), Some(2));

    let unreachable = run("doctor --device unix:nobody.sock --json --report ill.json");
    assert_eq!(unreachable.status.code(), Some(3));
    let told: serde_json::Value = serde_json::from_slice(&unreachable.stdout).unwrap();
    assert_eq!(verdict(&told["result"], "device").0, "fail", "{told}");
    assert!(folder.path().join("ill.json").is_file(), "a device that is not there is why one writes the report");

    std::fs::write(folder.path().join("tactus/config.toml"), "devise = 1\n").unwrap();
    let damaged = run("doctor");
    let said = String::from_utf8(damaged.stdout).unwrap();
    assert!(damaged.status.success() && said.contains("devise") && said.contains("no device is named"), "{said}");
}
