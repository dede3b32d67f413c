//! Files that were made elsewhere, or for something else: what they are is told in a few words.

use std::io::read_to_string;
use std::process::{Command, Stdio};
use std::sync::mpsc;
use std::time::Duration;

use crate::tool::{Ended, command, learned, said, succeeds, tactus};

/// The change that makes it fail: the parser shows the line that it stumbles over, however long that is.
#[test]
fn a_file_that_is_no_toml_and_has_long_lines_does_not_fill_the_screen() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("picture.svg"), format!("<svg>{}</svg>\n", "<path/>".repeat(100_000))).unwrap();
    std::fs::create_dir(at.join("tactus")).unwrap();
    let device = "--device sil:world=simple --non-interactive";
    for line in [
        "check picture.svg".to_owned(),
        format!("{device} upload picture.svg"),
        format!("{device} config diff picture.svg"),
        "--device sil:world=simple,faults=picture.svg list".to_owned(),
    ] {
        let output = tactus(at, &line);
        let said = said(&output);
        let shown: String = said.chars().take(1000).collect();
        assert!(!output.status.success() && said.len() < 1000 && said.contains("line 1"), "{line}: {shown}");
    }
    std::fs::rename(at.join("picture.svg"), at.join("tactus/config.toml")).unwrap();
    let output = tactus(at, "list");
    let said = said(&output);
    assert!(said.len() < 1000 && said.contains("config.toml"), "{}", said.chars().take(1000).collect::<String>());
}

/// A second reading waits for ever, or fills the memory with what `/dev/zero` gives.
///
/// The change that makes it fail: `rehearse` reads the file once more for what it compares with at its end.
#[cfg(target_os = "linux")]
#[test]
fn a_primitive_that_comes_through_a_pipe_is_read_once_and_rehearsed() {
    let folder = learned(3.0);
    let at = folder.path();
    let text = std::fs::read(at.join("reach.toml")).unwrap();
    let pipe = at.join("pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let line = "--device sil:world=simple --non-interactive rehearse pipe --trials 1 -o rehearsed.toml";
    let mut rehearsal = Ended(command(at, line).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap());
    let (sender, ended) = mpsc::channel();
    let mut words = rehearsal.0.stderr.take().unwrap();
    std::fs::write(&pipe, text).unwrap();
    std::thread::spawn(move || sender.send(read_to_string(&mut words)));
    let said = ended.recv_timeout(Duration::from_secs(60)).expect("it ends").unwrap();
    assert!(rehearsal.0.wait().unwrap().success() && said.contains("wrote rehearsed.toml"), "{said}");
}

/// The change that makes it fail: a text is parsed as it stands in the file.
#[test]
fn a_primitive_whose_lines_end_in_carriage_returns_alone_is_checked() {
    let folder = learned(3.0);
    let at = folder.path();
    let text = std::fs::read_to_string(at.join("reach.toml")).unwrap();
    std::fs::write(at.join("mac.toml"), text.replace('\n', "\r")).unwrap();
    let [usual, returns] = ["reach", "mac"].map(|name| tactus(at, &format!("check {name}.toml")).stdout);
    assert!(!usual.is_empty() && usual == returns);
}

/// The changes that make it fail: a failure, a result, or what is said besides shows a file's letters as they are.
#[test]
fn nothing_in_a_file_commands_the_terminal() {
    let folder = learned(3.0);
    let at = folder.path();
    succeeds(at, "--device sil:world=simple --non-interactive run reach.toml --record run.csv");
    let text = std::fs::read_to_string(at.join("run.csv")).unwrap();
    std::fs::write(at.join("state.csv"), text.replacen(",run,", ",\u{1b}[31mrun,", 1)).unwrap();
    let named = "\u{1b}[31mred.csv";
    std::fs::write(at.join(named), text).unwrap();
    for (words, shown) in [
        (["report", "state.csv", "-o", "a.html"], "`\\u{1b}[31mrun` is no state"),
        (["report", named, "-o", "b.html"], "\\u{1b}[31mred.csv: arrived"),
        (["export", named, "-o", "\u{9b}c.mcap"], "\\u{9b}c.mcap"),
        (["learn", "demo.csv", "-o", "\u{7}.toml"], "\\u{7}"),
    ] {
        let output = tactus(at, &words);
        let all = String::from_utf8_lossy(&output.stdout).into_owned() + &said(&output);
        assert!(all.contains(shown) && !all.contains(|letter: char| letter.is_control() && letter != '\n'), "{all:?}");
    }
}
