//! A full disk at each command that writes a file from files: what existed is whole, and the program says why it ends.

#[path = "../../crates/lab/tests/common/mod.rs"]
mod common;

use std::path::Path;
use std::process::{Command, Output};

/// The program in a folder, its files no longer than `blocks` of 1024 bytes. The limit stands for a full disk: the
/// system refuses the same write, for root as for anybody else, and nothing has to be mounted.
fn limited(folder: &Path, blocks: &str, line: &str) -> Output {
    Command::new("bash")
        .current_dir(folder)
        .env("XDG_CONFIG_HOME", folder)
        .env_remove("TACTUS_DEVICE")
        .args(["-c", &format!("ulimit -f {blocks}; exec \"$0\" --non-interactive --force {line}")])
        .arg(env!("CARGO_BIN_EXE_tactus"))
        .output()
        .unwrap()
}

// A bus log is not among the rows: it grows at its place (`create_log`) and replaces the old file at once.
#[test]
fn a_full_disk_leaves_every_file_that_a_command_was_to_replace() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    common::demonstration(at, 2.0);
    let learned = limited(at, "unlimited", "learn demo.csv -o reach.toml");
    assert!(learned.status.success(), "{}", String::from_utf8_lossy(&learned.stderr));
    for (line, file) in [
        ("learn demo.csv --name a -o there.toml", "there.toml"),
        ("plot -d demo.csv -o there.svg", "there.svg"),
        ("plot -d demo.csv -o there.png", "there.png"),
        ("export demo.csv -o there.mcap", "there.mcap"),
        ("report demo.csv -o there.html", "there.html"),
        ("--device sil:world=simple record --duration 10 -o there.csv", "there.csv"),
    ] {
        std::fs::write(at.join(file), "precious").unwrap();
        let ended = limited(at, "1", line);
        let said = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(2), "{line}: {said}");
        assert!(said.contains("error[E235]") && !said.contains("panicked"), "{line}: {said}");
        assert_eq!(std::fs::read(at.join(file)).unwrap(), b"precious", "{line}");
    }
}
