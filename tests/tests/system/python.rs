//! Programs of others in Python: python-can on the served bus, as it comes from its registry.

#[path = "../../../crates/lab/tests/common/mod.rs"]
mod common;

use std::path::Path;

use system_tests::{command, expect, python};

/// A movement, learned, and run at two speeds: demo.csv, reach.toml, run.csv, fast.csv.
fn two_runs(folder: &Path) {
    common::demonstration(folder, 3.0);
    for line in [
        "learn demo.csv --name reach -o reach.toml",
        "--device sil:world=simple run reach.toml --record run.csv",
        "--device sil:world=simple run reach.toml --speed 1.5 --record fast.csv",
    ] {
        command::tactus(folder, &line.split(' ').collect::<Vec<_>>()).success();
    }
}

#[test]
fn the_python_reader_reads_what_was_written_and_compares_runs_by_phase() {
    let folder = expect(tempfile::tempdir());
    two_runs(folder.path());
    let printed = python::run("reader.py", &[folder.path().as_os_str()]);
    assert!(
        printed.starts_with("progress  distance, mm  force, N\n     0.0 ") && printed.lines().count() == 12,
        "{printed}"
    );
}

#[test]
fn unmodified_python_can_drives_the_simulated_pucks_and_can_decode_reads_what_it_did() {
    let folder = expect(tempfile::tempdir());
    let device = "sil:world=simple,bus=bus.log";
    let mut arm = command::start(folder.path(), &["--device", device, "sim", "--can-only", "--can", "127.0.0.1:0"]);
    arm.hear("served at 127.0.0.1:");
    let port = arm.next_word();
    let vectors = python::root().join("crates/puck/tests/vectors");
    let printed = python::run("socketcand.py", &["127.0.0.1".as_ref(), port.as_ref(), vectors.as_os_str()]);
    assert!(printed.contains("positions of 7 pucks"), "{printed}");
    assert!(printed.contains("transcript_safety_ctor.csv 7 answers as expected"), "{printed}");
    assert!(printed.contains("transcript_hand_init.csv 44 answers as expected"), "{printed}");
    arm.interrupt();
    assert!(arm.finish().status.success());
    let decoded = command::tactus(folder.path(), &["can", "decode", "bus.log"]).success();
    let decoded = command::stdout(&decoded);
    assert!(decoded.contains("SET CMD = HI: initialise (13)") && decoded.contains("every frame named"), "{decoded}");
}
