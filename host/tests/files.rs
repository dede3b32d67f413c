//! Files: nothing that existed is damaged, and what was recorded is kept, whatever ends a command.

use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

use assert_cmd::Command;

use crate::tool::{self, judged as tactus, learned, names, stderr};

/// The program, started and left to itself.
fn start(folder: &Path, line: &str) -> std::process::Child {
    let mut command = tool::command(folder, line);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

const DEVICE: &str = "--device sil:world=simple --non-interactive";

#[test]
fn no_command_replaces_a_file_unless_it_is_forced() {
    let folder = learned(3.0);
    let at = folder.path();
    std::fs::write(at.join("there"), "precious").unwrap();
    std::fs::write(at.join("there.png"), "precious").unwrap();
    for (line, file) in [
        ("learn demo.csv --name a -o there".to_owned(), "there"),
        (format!("{DEVICE} record --duration 0.2 -o there"), "there"),
        (format!("{DEVICE} teach --duration 0.2 -o there"), "there"),
        (format!("{DEVICE} run reach.toml --record there"), "there"),
        (format!("{DEVICE} run reach.toml --bus-log there"), "there"),
        (format!("{DEVICE} rehearse reach.toml --trials 1 -o there"), "there"),
        ("plot -d demo.csv -o there.png".to_owned(), "there.png"),
    ] {
        let refused = tactus(at, &line).failure().code(2);
        assert!(stderr(&refused).starts_with("error[E230]"), "{line}: {}", stderr(&refused));
        assert_eq!(std::fs::read(at.join(file)).unwrap(), b"precious", "{line}");
    }
    assert_eq!(names(at), ["demo.csv", "reach.toml", "there", "there.png"]);
    tactus(at, "plot -d demo.csv -o there.png --force").success();
    assert!(std::fs::read(at.join("there.png")).unwrap().starts_with(b"\x89PNG"));
    // Capital letters make no other format; without the MuJoCo world there is no picture at all.
    let drawn = tactus(at, "plot -r demo.csv -o way.SVG --picture way.PNG").get_output().clone();
    let errors = String::from_utf8_lossy(&drawn.stderr).into_owned();
    assert!(drawn.status.success() || errors.contains("E310"), "{errors}");
    tactus(at, &format!("{DEVICE} record --duration 1 -o there --force")).success();
    assert!(lab::demonstration::Recording::read(&at.join("there")).is_ok());
}

#[test]
fn h14_an_output_that_is_an_input_a_device_or_a_folder_is_refused_even_when_forced() {
    let folder = learned(3.0);
    let at = folder.path();
    let demonstration = std::fs::read(at.join("demo.csv")).unwrap();
    for (line, code) in [
        ("learn demo.csv --name a -o demo.csv --force".to_owned(), "E232"),
        ("learn demo.csv --name a -o ./demo.csv --force".to_owned(), "E232"),
        ("statistics reach.toml demo.csv -o demo.csv --force".to_owned(), "E232"),
        (format!("{DEVICE} run reach.toml --record reach.toml --force"), "E232"),
        (format!("{DEVICE} record --duration 0.2 -o /dev/null --force"), "E231"),
        (format!("{DEVICE} run reach.toml --bus-log /dev/null --force"), "E231"),
        ("learn demo.csv --name a -o . --force".to_owned(), "E231"),
        ("learn demo.csv --name a -o nowhere/a.toml".to_owned(), "E233"),
        ("learn demo.csv --name a -o /proc/a.toml".to_owned(), "E23"),
        ("plot -r demo.csv -o a.svg --picture a.jpg".to_owned(), "E211"),
    ] {
        let refused = tactus(at, &line).failure().code(2);
        assert!(stderr(&refused).contains(code), "{line}: {}", stderr(&refused));
    }
    assert_eq!(std::fs::read(at.join("demo.csv")).unwrap(), demonstration);
    assert_eq!(names(at), ["demo.csv", "reach.toml"]);
}

/// A comma ends an option of an address. The change that makes it fail: the name is added to the text of the address;
/// what stood behind the comma was refused as an option, or taken for one.
#[test]
fn a_flash_and_a_script_with_a_comma_in_their_names_are_these_files() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/faults/a3.toml");
    std::fs::copy(script, at.join("a,3.toml")).unwrap();
    let serve = "sim --listen unix:arm.sock --duration 0.05 --fast";
    let line = format!("--device sil:world=simple {serve} --flash a,seed=3,b.flash --faults a,3.toml:2");
    tactus(at, &line).success();
    assert_eq!(names(at), ["a,3.toml", "a,seed=3,b.flash"]);
    let hand = tactus(at, &format!("--device hand: {serve} --flash a.flash")).failure();
    assert!(stderr(&hand).contains("not 'flash'"), "{}", stderr(&hand));
}

#[test]
fn h14_a_file_that_is_named_twice_as_an_output_or_as_a_log_is_refused_before_anything_is_written() {
    let folder = learned(3.0);
    let at = folder.path();
    tactus(at, "--device sil:world=simple,flash=arm.flash list").success();
    std::fs::write(at.join("there.png"), "precious").unwrap();
    std::fs::copy(Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/faults/a3.toml"), at.join("a3.toml")).unwrap();
    std::fs::write(at.join("short.flash"), "no flash").unwrap();
    let content = || -> Vec<Vec<u8>> { names(at).iter().map(|name| std::fs::read(at.join(name)).unwrap()).collect() };
    let (there, before) = (names(at), content());
    for line in [
        "plot -d demo.csv -o new.png -o new.png".to_owned(),
        "plot -d demo.csv -o there.png -o ./there.png --force".to_owned(),
        "plot -r demo.csv -o new.png --picture new.png".to_owned(),
        format!("{DEVICE} run reach.toml --record new.csv --bus-log ./new.csv"),
        format!("{DEVICE} run reach.toml --bus-log reach.toml --force"),
        "--device sil:world=simple,bus=reach.toml run reach.toml --force".to_owned(),
        "--device sil:world=simple,bus=arm.flash,flash=arm.flash list --force".to_owned(),
        "--device sil:world=simple,bus=a3.toml,faults=a3.toml:2 list --force".to_owned(),
    ] {
        let refused = tactus(at, &line).failure().code(2);
        assert!(stderr(&refused).starts_with("error[E232]"), "{line}: {}", stderr(&refused));
    }
    // A simulation that does not start replaces no log.
    tactus(at, "--device sil:world=simple,bus=there.png,flash=short.flash list --force").failure().code(2);
    assert_eq!(names(at), there);
    assert!(content() == before, "a file has changed");
}

#[test]
fn a_refused_teach_leaves_the_recording_that_it_was_to_replace() {
    let folder = learned(3.0);
    let at = folder.path();
    let before = std::fs::read(at.join("demo.csv")).unwrap();
    // There is no hand-guided arm behind this address.
    tactus(at, "--device unix:nobody.sock teach -o demo.csv --force").failure().code(3);
    tactus(at, "--device sil:world=simple --non-interactive teach -o demo.csv --force").failure().code(2);
    assert_eq!(std::fs::read(at.join("demo.csv")).unwrap(), before);
    assert_eq!(names(at), ["demo.csv", "reach.toml"]);
}

/// Waits until a file has grown to this size.
fn grown(file: &Path, bytes: u64) {
    let begun = Instant::now();
    while std::fs::metadata(file).map_or(0, |found| found.len()) < bytes {
        assert!(begun.elapsed() < Duration::from_secs(60), "{} does not grow", file.display());
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// At 300 Hz: the lines carry the telemetry of every cycle, which they do not at 500 Hz (decision 0017).
#[test]
fn h14_what_was_recorded_before_a_signal_is_kept_and_named() {
    for (signal, code) in [("INT", 130), ("TERM", 130), ("HUP", 130)] {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        std::fs::write(at.join("long.csv"), "precious").unwrap();
        // What `nohup` starts ignores a closed terminal, and so does the command of a test that it has started.
        let mut child = tool::heeding(signal, at, &format!("{DEVICE} record --duration 3600 -o long.csv --force"));
        let child = child.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        grown(&at.join("long.csv.part"), 1_000_000);
        // Twice: as a terminal and a wrapper deliver it.
        for _ in 0..2 {
            send(signal, child.id());
        }
        let ended = child.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(code), "{signal}: {said}");
        assert!(said.contains("kept: what was recorded until then is in long.csv.part"), "{signal}: {said}");
        assert_eq!(std::fs::read(at.join("long.csv")).unwrap(), b"precious");
        let kept = lab::demonstration::Recording::read(&at.join("long.csv.part")).unwrap();
        assert!(kept.len() > 1000 && kept.gaps == 0);
    }
}

fn send(signal: &str, process: u32) {
    let sent = std::process::Command::new("kill").args(["-s", signal, &process.to_string()]).status().unwrap();
    assert!(sent.success());
}

#[test]
fn cli_8_a_killed_run_leaves_its_recording_beside_the_one_it_was_to_replace() {
    let folder = learned(20.0);
    let at = folder.path();
    std::fs::write(at.join("run.csv"), "precious").unwrap();
    let mut child = start(at, &format!("{DEVICE} run reach.toml --record run.csv --force"));
    grown(&at.join("run.csv.part"), 500_000);
    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(std::fs::read(at.join("run.csv")).unwrap(), b"precious");
    let text = std::fs::read_to_string(at.join("run.csv.part")).unwrap();
    // The last line may be cut; a reader of the rest loses nothing else.
    let whole = &text[..=text.rfind('\n').unwrap()];
    let kept = lab::demonstration::Recording::parse(Path::new("run.csv"), whole.as_bytes()).unwrap();
    assert!(kept.len() > 500, "{}", kept.len());
    // The next one does not destroy it.
    let mut child = start(at, &format!("{DEVICE} run reach.toml --record run.csv --force"));
    grown(&at.join("run.csv.2.part"), 1000);
    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(std::fs::read_to_string(at.join("run.csv.part")).unwrap(), text);
}

#[test]
fn a_disk_that_fills_up_is_named_as_such_and_keeps_what_fits() {
    let folder = learned(3.0);
    let at = folder.path();
    std::fs::write(at.join("run.csv"), "precious").unwrap();
    for command in ["record --duration 60 -o run.csv", "run reach.toml --record run.csv"] {
        // A limit for files stands for a disk that is full: the system refuses the same write.
        let line = format!("ulimit -f 300; exec \"$0\" {DEVICE} --force {command}");
        let limited = Command::new("bash")
            .current_dir(at)
            .args(["-c", &line, env!("CARGO_BIN_EXE_tactus")])
            .assert()
            .failure()
            .code(2);
        let said = stderr(&limited);
        assert!(said.contains("error[E235]") && said.contains("kept: "), "{said}");
        assert_eq!(std::fs::read(at.join("run.csv")).unwrap(), b"precious");
        let part = at.join("run.csv.part");
        let text = std::fs::read_to_string(&part).unwrap();
        assert!(text.len() > 200_000, "{}", text.len());
        std::fs::remove_file(part).unwrap();
    }
    let limited = Command::new("bash")
        .current_dir(at)
        .args(["-c", "ulimit -f 1; exec \"$0\" learn demo.csv -o reach.toml --force", env!("CARGO_BIN_EXE_tactus")])
        .assert()
        .failure()
        .code(2);
    assert!(stderr(&limited).starts_with("error[E235]"), "{}", stderr(&limited));
    assert_eq!(names(at), ["demo.csv", "reach.toml", "run.csv"]);
    // Half a flash would be refused for its size as long as it is there.
    let line = "ulimit -f 300; exec \"$0\" --device sil:world=simple,flash=arm.flash list";
    let program = env!("CARGO_BIN_EXE_tactus");
    let limited = Command::new("bash").current_dir(at).args(["-c", line, program]).assert().failure().code(2);
    assert!(stderr(&limited).starts_with("error[E235]"), "{}", stderr(&limited));
    tactus(at, "--device sil:world=simple,flash=arm.flash list").success();
    tactus(at, "check reach.toml").success();
}

#[test]
fn a_closed_pipe_and_a_full_output_are_no_crash() {
    let folder = learned(3.0);
    let program = env!("CARGO_BIN_EXE_tactus");
    let run = |line: &str| {
        let line = format!("set -o pipefail; {line}");
        let command = Command::new("bash").current_dir(folder.path()).args(["-c", &line, program]).assert();
        let (code, said) = (command.get_output().status.code(), stderr(&command));
        assert!(!said.contains("panicked"), "{line}: {said}");
        (code, said)
    };
    for line in ["\"$0\" check reach.toml", "\"$0\" --json check reach.toml", "\"$0\" --help", "\"$0\" learn --help"] {
        for _ in 0..5 {
            let (code, said) = run(&format!("{line} | true"));
            assert_eq!((code, said.as_str()), (Some(0), ""), "{line}");
        }
        run(&format!("{line} 2>&1 | true"));
    }
    // All of it is read, or the first line alone, or none of it can be written.
    let lines =
        ["--help", "--version", "learn --help", "--help-all", "-V", "completions zsh", "explain E504", "config"];
    for line in lines.into_iter().chain(["--json completions fish", "--json explain E504", "can decode empty.log"]) {
        std::fs::write(folder.path().join("empty.log"), "").unwrap();
        let line = format!("\"$0\" {line}");
        assert_eq!(run(&format!("{line} >/dev/null")), (Some(0), String::new()), "{line}");
        let (code, said) = run(&format!("{line} | head -1 >/dev/null"));
        assert_eq!((code, said.as_str()), (Some(0), ""), "{line}");
        let (code, said) = run(&format!("{line} >/dev/full"));
        assert!(
            code == Some(2) && said.contains("E235") && said.contains("standard output"),
            "{line}: {code:?} {said}"
        );
    }
    assert_eq!(run("\"$0\" --json check no.toml | true").0, Some(2));
    assert_eq!(run("\"$0\" --json check no.toml >/dev/full").0, Some(2));
    let (code, said) = run("\"$0\" check reach.toml >/dev/full");
    assert!(code == Some(2) && said.contains("standard output") && said.contains("E235"), "{code:?} {said}");
    assert_eq!(run("\"$0\" learn demo.csv --name a -o b.toml 2>/dev/full >/dev/null").0, Some(0));
}

#[test]
fn names_that_are_no_unicode_are_written_and_reported() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;

    let folder = learned(3.0);
    let name = OsStr::from_bytes(b"b\xffd.toml");
    let run = |arguments: &[&OsStr]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tactus"));
        command.current_dir(folder.path()).args(["--json", "--force"]).args(arguments).assert()
    };
    let word = |text: &'static str| OsStr::new(text);
    run(&[word("learn"), word("demo.csv"), word("--name"), word("a"), word("-o"), name]).success();
    assert!(folder.path().join(name).is_file());
    run(&[word("check"), name]).success();
    let figure = OsStr::from_bytes(b"f\xff.svg");
    run(&[word("plot"), word("-p"), name, word("-o"), figure]).success();
    run(&[word("statistics"), name, word("--forget")]).success();
    run(&[word("check"), OsStr::from_bytes(b"no\xff")]).failure().code(2);
    run(&[OsStr::from_bytes(b"no\xff")]).failure().code(2);
}

/// A device that never ends would fill the memory of the machine.
#[test]
fn an_input_that_never_ends_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for line in ["check /dev/zero", "--device sil:faults=/dev/zero status", "--device sil: config restore /dev/zero"] {
        let assert = tactus(folder.path(), line).failure();
        assert!(stderr(&assert).contains("more than the 16 MiB"), "{line}: {}", stderr(&assert));
    }
}
