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
    assert!(decoded.contains("SET CMD = HI: initialise (13)") && decoded.contains("every frame is known"), "{decoded}");
}

#[test]
fn an_export_is_read_by_the_mcap_package_and_agrees_with_the_recording() {
    let folder = expect(tempfile::tempdir());
    let at = folder.path();
    two_runs(at);
    command::tactus(at, &["export", "run.csv"]).success();
    let refused = command::tactus(at, &["export", "run.csv"]).code(2);
    assert!(command::stderr(&refused).contains("E230"), "{}", command::stderr(&refused));
    let refused = command::tactus(at, &["export", "reach.toml", "-o", "other.mcap"]).code(6);
    assert!(
        command::stderr(&refused).contains("E614") && !at.join("other.mcap").exists(),
        "{}",
        command::stderr(&refused)
    );
    let (run, export) = (at.join("run.csv"), at.join("run.mcap"));
    let printed = python::run("read_mcap.py", &[run.as_os_str(), export.as_os_str()]);
    assert!(printed.ends_with("cycles agree\n"), "{printed}");
}

#[test]
fn real_outputs_and_failures_are_valid_by_their_schemas() {
    let folder = expect(tempfile::tempdir());
    let at = folder.path();
    two_runs(at);
    let mut arm = command::start(at, &["--device", "sil:world=simple", "sim"]);
    arm.hear("in another terminal");
    let device = ["--json", "--device", "unix:tactus.sock"];
    let mut outputs = Vec::new();
    let mut ask = |schema: &str, line: &str, device: &[&str]| {
        let output = command::tactus(at, &[device, &line.split(' ').collect::<Vec<_>>()].concat());
        let streams = schema == "monitor" || schema == "can-decode";
        let text = String::from_utf8_lossy(&output.get_output().stdout).into_owned();
        assert_eq!(output.get_output().status.success(), schema != "error", "{line}: {text}");
        assert!(streams || text.lines().count() == 1, "{line}: {text}");
        // Of a stream the ends tell all shapes.
        let ends: Vec<&str> = text.lines().take(2).chain(text.lines().last().filter(|_| streams)).collect();
        outputs.extend(ends.into_iter().map(|object| format!("{schema} {object}\n")));
    };
    command::tactus(at, &[&device[..], &["upload", "reach.toml"]].concat()).success();
    ask("list", "list", &device);
    ask("rename", "rename reach other", &device);
    ask("get", "get other -o other.toml", &device);
    ask("delete", "delete other", &device);
    ask("error", "delete other", &device);
    ask("hand", "hand --at-home init", &device);
    ask("record", "record --duration 1 -o some.csv", &device);
    ask("stop", "stop", &device);
    ask("status", "status --line 0.2", &device);
    ask("faults", "faults", &device);
    ask("tare", "tare", &device);
    ask("monitor", "monitor --duration 1", &device);
    ask("calibrate", "calibrate show", &device);
    ask("calibrate-gravity-show", "calibrate gravity --show", &device);
    ask("calibrate-payload-show", "calibrate payload", &device);
    ask("config", "config", &device);
    ask("config-get", "config get", &device);
    ask("config-get", "config dump -o arm.toml", &device);
    ask("config-diff", "config diff arm.toml", &device);
    ask("calibrate-payload", "calibrate payload --measure", &["--json", "--device", "sil:world=simple,held=0.3"]);
    ask("export", "export run.csv", &["--json"]);
    ask("upload", "upload reach.toml", &device);
    ask("check", "check reach.toml", &["--json"]);
    ask("compare", "compare run.csv run.csv", &["--json"]);
    ask("plot", "plot -r run.csv -p reach.toml -o figure.svg", &["--json"]);
    ask("report", "report run.csv -p reach.toml -o page.html", &["--json"]);
    ask("learn", "learn demo.csv --name a -o a.toml", &["--json"]);
    ask("statistics", "statistics reach.toml --forget -o forgotten.toml", &["--json"]);
    let alone = ["--json", "--device", "sil:world=simple", "--non-interactive"];
    ask("rehearse", "rehearse reach.toml --trials 2 -o rehearsed.toml", &alone);
    ask("teach", "teach --duration 1 -o still.csv", &alone);
    let with_host_bus = ["--json", "--device", "sil:world=simple,line=can", "--non-interactive"];
    ask("run", "run reach.toml --bus-log bus.log", &with_host_bus);
    ask("can-decode", "can decode bus.log", &["--json"]);
    ask("can-replay", "can replay bus.log", &["--json"]);
    ask("explain", "explain E504", &["--json"]);
    ask("explain", "explain TrackingError", &["--json"]);
    ask("error", "explain E999", &["--json"]);
    ask("error", "check missing.toml", &["--json"]);
    ask("error", "check --no-such-option", &["--json"]);
    ask("sim", "--device sil:world=simple sim --listen unix:b.sock --fast --duration 0.1", &["--json"]);
    arm.interrupt();
    expect(std::fs::write(at.join("outputs.txt"), outputs.concat()));
    let schemas = python::root().join("docs/schemas");
    let printed = python::run("validate.py", &[schemas.as_os_str(), at.join("outputs.txt").as_os_str()]);
    assert_eq!(printed, "43 outputs are valid\n");
}
