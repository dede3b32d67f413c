//! A full disk, a closed pipe, an interrupt and a kill at every stage of every command that writes a file.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use clap::CommandFactory;
use tactus::cmd::Cli;

use crate::common;
use crate::tool;

/// A command that writes a file: subcommand, the option that names it, the whole line, and the file. It begins with
/// `reach.toml`, `run.csv` and a device whose flash holds `reach`, and takes the place of a file that is there already.
type Disturbed = (&'static str, &'static str, &'static str, &'static str);

const ROWS: &[Disturbed] = &[
    ("learn", "output", "learn demo.csv --name a -o there.toml", "there.toml"),
    ("plot", "output", "plot -d demo.csv -p reach.toml -o there.svg", "there.svg"),
    ("plot", "output", "plot -d demo.csv -o there.png", "there.png"),
    ("export", "output", "export run.csv -o there.mcap", "there.mcap"),
    ("report", "output", "report run.csv -p reach.toml -o there.html", "there.html"),
    ("statistics", "output", "statistics known.toml run.csv run2.csv -o there.toml", "there.toml"),
    ("record", "output", "record --duration 4 -o there.csv", "there.csv"),
    ("teach", "output", "teach --duration 2 -o there.csv", "there.csv"),
    ("rehearse", "output", "rehearse reach.toml --trials 2 -o there.toml", "there.toml"),
    ("run", "record", "run reach.toml --record there.csv", "there.csv"),
    ("get", "output", "get reach -o there.toml", "there.toml"),
    ("dump", "output", "config dump -o there.toml", "there.toml"),
    ("home", "report", "calibrate home --set 0,-2,0,3.1,0,0,0 --report there.json", "there.json"),
    ("doctor", "report", "doctor --report there.json", "there.json"),
];

/// Options that name a file or a folder to be written, and have no row.
const EXCEPTIONS: &[(&str, &str, &str)] = &[
    ("run", "bus_log", "grows at its place, so that others can read it; the old one goes when it begins"),
    ("run", "keep", "a folder that nobody had before: host/tests/keep.rs"),
    ("gravity", "report", "as that of `home`; minutes of motion: host/tests/weighing.rs"),
    ("friction", "report", "as that of `gravity`"),
    ("payload", "report", "as that of `gravity`"),
    ("experiment", "out", "needs MuJoCo; its files are replaced whole: crates/experiment/src/results.rs"),
    ("faults", "record", "written by the same function as `record`"),
    ("sim", "flash", "a flash, whose power may fail in any word: tests/tests/system/storage.rs"),
];

/// Bytes of the old file; a TOML file of settings keeps its comments.
fn precious(line: &str, settings: &[u8]) -> Vec<u8> {
    if line.starts_with("config") { settings.to_vec() } else { b"precious".to_vec() }
}

fn command(folder: &Path, line: &str) -> Command {
    let mut command = tool::command(folder, &format!("--non-interactive --force {line}"));
    command.env("TACTUS_DEVICE", "sil:world=simple,flash=arm.flash");
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

#[track_caller]
fn succeeds(folder: &Path, line: &str) {
    let output = command(folder, line).output().unwrap();
    assert!(output.status.success(), "{line}: {}", String::from_utf8_lossy(&output.stderr));
}

/// A folder with everything that a row begins with.
fn prepared() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    common::demonstration(at, 3.0);
    succeeds(at, "learn demo.csv --name reach -o reach.toml");
    succeeds(at, "upload reach.toml");
    succeeds(at, "rehearse reach.toml --trials 2 -o known.toml");
    succeeds(at, "run known.toml --record run.csv");
    succeeds(at, "run known.toml --record run2.csv");
    succeeds(at, "upload reach.toml");
    succeeds(at, "config dump -o settings.toml");
    folder
}

/// Says everything about a command that was disturbed: it did not panic, and what existed is there or wholly replaced.
#[track_caller]
fn judge(folder: &Path, line: &str, file: &str, disturbed: &str, ended: &Output, old: &[u8], new: &[u8]) {
    let said = String::from_utf8_lossy(&ended.stderr);
    assert!(!said.contains("panicked") && ended.status.code() != Some(101), "{line}, {disturbed}: {said}");
    let found = std::fs::read(folder.join(file)).unwrap_or_default();
    let whole = found == old || found == new;
    assert!(whole, "{line}, {disturbed}: {} bytes, neither the old nor the new", found.len());
    if ended.status.success() {
        assert!(found == new, "{line}, {disturbed}: it says that it has written the file");
    }
    for part in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        let name = part.file_name().unwrap().to_string_lossy().into_owned();
        if name.ends_with(".part") {
            // Of a recording what there is can be read; a file that was to be written at once is nobody's loss.
            let is_named = said.contains(&name) || ended.status.code().is_none();
            assert!(is_named, "{line}, {disturbed}: {name} is left and not named: {said}");
            std::fs::remove_file(part).unwrap();
        }
    }
}

/// Plays one row undisturbed, with disks that are full at some sizes, and with signals at some moments.
fn disturb(row: &Disturbed) {
    let (_, _, line, file) = *row;
    let folder = prepared();
    let at = folder.path();
    let old = precious(line, &std::fs::read(at.join("settings.toml")).unwrap());
    let flash = std::fs::read(at.join("arm.flash")).unwrap();
    let renew = || {
        std::fs::write(at.join(file), &old).unwrap();
        std::fs::write(at.join("arm.flash"), &flash).unwrap();
    };
    renew();
    let begun = Instant::now();
    succeeds(at, line);
    let duration = begun.elapsed();
    let new = std::fs::read(at.join(file)).unwrap();
    assert!(new != old || line.starts_with("config"), "{line}: it writes nothing");

    for blocks in [0, 1, new.len() / 2048] {
        renew();
        // The limit stands for a full disk, for root as for anybody. The device's flash has its size already.
        let limit = format!("ulimit -f {}; exec \"$0\" --non-interactive --force {line}", blocks.max(1));
        let mut limited = Command::new("bash");
        limited.current_dir(at).env("XDG_CONFIG_HOME", at).args(["-c", &limit, env!("CARGO_BIN_EXE_tactus")]);
        limited.env("TACTUS_DEVICE", "sil:world=simple");
        if line.starts_with("get") || line.starts_with("calibrate") {
            continue; // Their device needs its flash, which the limit would cut.
        }
        let ended = limited.stdin(Stdio::null()).output().unwrap();
        if new.len() > 1024 * blocks.max(1) {
            assert_eq!(ended.status.code(), Some(2), "{line}: {}", String::from_utf8_lossy(&ended.stderr));
        }
        if !ended.status.success() {
            judge(at, line, file, "full disk", &ended, &old, &new);
        }
    }
    for closed in [">&-", "2>&-", ">&- 2>&-", "| true", "2>&1 | true"] {
        renew();
        let ended = Command::new("bash")
            .current_dir(at)
            .env("XDG_CONFIG_HOME", at)
            .env("TACTUS_DEVICE", "sil:world=simple,flash=arm.flash")
            .args(["-c", &format!("set -o pipefail; \"$0\" --non-interactive --force {line} {closed}")])
            .arg(env!("CARGO_BIN_EXE_tactus"))
            .stdin(Stdio::null())
            .output()
            .unwrap();
        judge(at, line, file, closed, &ended, &old, &new);
    }
    // A place where nobody may write, not even root.
    let elsewhere = line.replace(file, &format!("/proc/{file}"));
    let refused = command(at, &elsewhere).output().unwrap();
    let said = String::from_utf8_lossy(&refused.stderr);
    assert!(refused.status.code() == Some(2) && said.contains("error[E23"), "{elsewhere}: {said}");
    for signal in ["INT", "KILL"] {
        for moment in 0..6_u32 {
            renew();
            let child = command(at, line).spawn().unwrap();
            // Whatever it does at that moment: any is as good as another.
            std::thread::sleep(duration * moment / 6);
            let ended = end(child, signal);
            judge(at, line, file, &format!("{signal} at {moment}/6"), &ended, &old, &new);
        }
    }
}

fn end(child: Child, signal: &str) -> Output {
    let _ = Command::new("kill").args(["-s", signal, &child.id().to_string()]).stderr(Stdio::null()).status();
    child.wait_with_output().unwrap()
}

#[test]
fn a_full_disk_an_interrupt_and_a_kill_leave_what_existed_whole() {
    let begun = Instant::now();
    let (one, other) = ROWS.split_at(ROWS.len() / 2);
    std::thread::scope(|scope| {
        for rows in [one, other] {
            scope.spawn(move || rows.iter().for_each(disturb));
        }
    });
    println!("{:?}", Duration::from_secs(begun.elapsed().as_secs()));
}

#[test]
fn a_bus_log_on_a_full_disk_is_told_as_such_and_not_as_a_broken_cable() {
    let folder = tempfile::tempdir().unwrap();
    common::demonstration(folder.path(), 3.0);
    succeeds(folder.path(), "learn demo.csv --name reach -o reach.toml");
    let limit = "ulimit -f 20; exec \"$0\" --device sil:world=simple run reach.toml --bus-log there.log";
    let mut limited = Command::new("bash");
    limited.current_dir(folder.path()).args(["-c", limit, env!("CARGO_BIN_EXE_tactus")]).stdin(Stdio::null());
    let ended = limited.output().unwrap();
    let said = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(2), "{said}");
    assert!(said.contains("error[E235]") && said.contains("there.log") && !said.contains("cable"), "{said}");
}

#[test]
fn every_option_that_names_a_file_to_be_written_has_a_row_or_a_reason() {
    fn collect(command: &clap::Command, found: &mut BTreeSet<(String, String)>) {
        for option in command.get_arguments().filter(|option| !option.is_global_set()) {
            let id = option.get_id().as_str();
            if ["output", "out", "record", "report", "bus_log", "keep", "flash"].contains(&id)
                && !option.is_positional()
            {
                found.insert((command.get_name().to_owned(), id.to_owned()));
            }
        }
        command.get_subcommands().for_each(|inner| collect(inner, found));
    }
    let mut found = BTreeSet::new();
    collect(&Cli::command(), &mut found);
    let rows = ROWS.iter().map(|(command, option, ..)| (*command, *option));
    let exceptions = EXCEPTIONS.iter().map(|(command, option, _)| (*command, *option));
    let known: BTreeSet<(String, String)> =
        rows.chain(exceptions).map(|(command, option)| (command.to_owned(), option.to_owned())).collect();
    assert_eq!(found, known);
}
