//! The stand-in: an arm served by `tactus sim`, whose pendant is the standard input of that command.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Output, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use lab::client::Client;
use lab::transport::StreamTransport;
use serde_json::Value;

use crate::tool::command;

struct StandIn {
    program: Child,
    pendant: ChildStdin,
}

impl StandIn {
    /// Serves an arm in a folder; it listens when this returns.
    fn start(folder: &Path) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tactus"));
        command.current_dir(folder).args(["--device", "sil:world=simple", "sim"]);
        command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
        let mut program = command.spawn().unwrap();
        let said = BufReader::new(program.stderr.take().unwrap());
        let mut lines = said.lines();
        assert!(lines.by_ref().any(|line| line.unwrap().contains("the pendant's buttons")), "it never listened");
        std::thread::spawn(move || lines.for_each(drop));
        let pendant = program.stdin.take().unwrap();
        Self { program, pendant }
    }

    fn press(&mut self, button: &str) {
        writeln!(self.pendant, "{button}").unwrap();
    }
}

impl Drop for StandIn {
    fn drop(&mut self) {
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}

fn tactus(folder: &Path, line: &str) -> Output {
    let line = format!("--json --non-interactive {line}");
    command(folder, &line).env("TACTUS_DEVICE", "unix:tactus.sock").output().unwrap()
}

/// The device's control cycle.
fn cycle(folder: &Path) -> u64 {
    let status: Value = serde_json::from_slice(&tactus(folder, "status").stdout).unwrap();
    status["cycle"].as_u64().unwrap()
}

/// Learns the primitive of the documents' example: `reach.toml`.
fn learn_reach(folder: &Path) {
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/examples/reach.csv");
    std::fs::copy(example, folder.join("reach.csv")).unwrap();
    assert!(tactus(folder, "learn reach.csv").status.success());
}

/// A program that looks on until it is ended.
fn observer(folder: &Path, order: &str) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tactus"));
    command.current_dir(folder).env("TACTUS_DEVICE", "unix:tactus.sock").args(order.split(' '));
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
}

/// The state of the arm once it is one of these; each question is a turn of the device's time as well.
fn until(folder: &Path, states: &[&str]) -> String {
    for _ in 0..500 {
        let status = tactus(folder, "status");
        let told: Value = serde_json::from_slice(&status.stdout).unwrap();
        let state = told["state"].as_str().unwrap_or_default().to_owned();
        if states.contains(&&*state) {
            return state;
        }
    }
    panic!("never in {states:?}");
}

#[test]
fn the_guides_stand_in_can_be_calibrated_after_its_hand_was_initialised() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut arm = StandIn::start(at);
    let initialised = tactus(at, "hand --at-home init");
    assert!(initialised.status.success(), "{}", String::from_utf8_lossy(&initialised.stderr));
    let calibrate = "calibrate home --set 0.02,-1.97,0.01,3.1,0,0.03,-0.05";
    let refused = tactus(at, calibrate);
    let told: Value = serde_json::from_slice(&refused.stdout).unwrap();
    // It has torque, as an arm in the laboratory would; what the help says can be done here too.
    assert_eq!(told["error"]["code"], "E546", "{told}");
    assert!(told["error"]["help"].as_str().unwrap().contains("Shift+Idle"), "{told}");
    arm.press("nonsense");
    arm.press("idle");
    until(at, &["idle"]);
    let calibrated = tactus(at, calibrate);
    assert!(calibrated.status.success(), "{}", String::from_utf8_lossy(&calibrated.stderr));
    let shown: Value = serde_json::from_slice(&tactus(at, "calibrate show").stdout).unwrap();
    assert_eq!(shown["stored"], true, "{shown}");
}

#[test]
fn the_stand_in_is_stopped_by_its_emergency_stop_and_comes_back_by_its_pendant() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut arm = StandIn::start(at);
    assert!(tactus(at, "hand --at-home init").status.success());
    arm.press("estop");
    until(at, &["idle", "fault"]);
    let safety = |at: &Path| -> Value {
        let status: Value = serde_json::from_slice(&tactus(at, "status").stdout).unwrap();
        status["safety_mode"].clone()
    };
    let pressed = safety(at);
    arm.press("release");
    arm.press("idle");
    let released = (0..500).map(|_| safety(at)).find(|mode| *mode != pressed);
    assert!(released.is_some(), "still {pressed}");
}

#[test]
fn an_arm_that_has_arrived_holds_when_its_program_ends_and_so_it_does_while_its_hand_closes() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut arm = StandIn::start(at);
    learn_reach(at);
    for order in ["run reach.toml --at-home --speed 2", "hand close", "hand open"] {
        let done = tactus(at, order);
        assert!(done.status.success(), "{order}: {}", String::from_utf8_lossy(&done.stderr));
        // The program is gone; what its farewell began would have come by the fifth question.
        for _ in 0..5 {
            let status: Value = serde_json::from_slice(&tactus(at, "status").stdout).unwrap();
            assert_eq!(status["state"], "hold", "after '{order}': {status}");
        }
    }
    // An arm that has fallen is carried home before it is zeroed: else the next run would start from nowhere.
    arm.press("estop");
    until(at, &["idle", "fault"]);
    arm.press("release");
    arm.press("idle");
    // The safety module took the torque, a person gave it back at the pendant: a command may follow.
    for order in ["hand --at-home open", "run reach.toml --speed 2"] {
        let done = tactus(at, order);
        assert!(done.status.success(), "{order}: {}", String::from_utf8_lossy(&done.stderr));
    }
}

#[test]
fn an_interrupted_observer_does_not_say_that_the_arm_has_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let _arm = StandIn::start(at);
    learn_reach(at);
    let mut run = Command::new(env!("CARGO_BIN_EXE_tactus"));
    run.current_dir(at).env("TACTUS_DEVICE", "unix:tactus.sock").stdin(Stdio::null()).stdout(Stdio::null());
    let run = run.args(["--non-interactive", "run", "reach.toml", "--at-home", "--speed", "0.3"]);
    let mut run = run.stderr(Stdio::null()).spawn().unwrap();
    until(at, &["approach"]);
    for order in ["record --duration 100 -o z.csv", "status --line 100"] {
        let observer = observer(at, order);
        // Two seconds of the device's time: the observer has said hello.
        let begun = cycle(at);
        while cycle(at) < begun + 600 {}
        assert!(Command::new("kill").args(["-INT", &observer.id().to_string()]).status().unwrap().success());
        let output = observer.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(130), "{order}: {said}");
        assert!(said.contains("so nothing was stopped") && !said.contains("has stopped"), "{order}: {said}");
    }
    until(at, &["approach", "run"]);
    let _ = run.kill();
    let _ = run.wait();
}

#[test]
fn two_may_look_on_a_third_is_told_so_and_the_places_of_killed_ones_are_waited_for() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let _arm = StandIn::start(at);
    let ended = AtomicBool::new(false);
    std::thread::scope(|threads| {
        for name in ["one", "two"] {
            let socket = StreamTransport::unix(&at.join("tactus.sock")).unwrap();
            let mut observer = Client::observe(socket, name).unwrap();
            let ended = &ended;
            threads.spawn(move || {
                while !ended.load(Ordering::SeqCst) {
                    observer.next(Duration::from_millis(50)).unwrap();
                }
                // As one that is killed: it says nothing.
                std::mem::forget(observer);
            });
        }
        let refused = tactus(at, "list");
        // It needs no place among those who look on.
        let stopped = tactus(at, "stop");
        ended.store(true, Ordering::SeqCst);
        let told: Value = serde_json::from_slice(&refused.stdout).unwrap();
        assert_eq!(told["error"]["code"], "E504", "{told}");
        assert!(told["error"]["message"].as_str().unwrap().contains("two other programs look on"), "{told}");
        assert!(told["error"]["help"].as_str().unwrap().contains("tactus stop"), "{told}");
        assert!(stopped.status.success(), "{}", String::from_utf8_lossy(&stopped.stdout));
    });
    let listed = tactus(at, "list");
    assert!(listed.status.success(), "{}", String::from_utf8_lossy(&listed.stdout));
}

#[test]
fn home_and_payload_are_shown_beside_a_run_and_changed_by_nobody_else() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let _arm = StandIn::start(at);
    learn_reach(at);
    let mut run = observer(at, "--non-interactive run reach.toml --at-home --speed 0.2");
    until(at, &["approach", "run"]);
    for (order, shown) in [("calibrate show", "source"), ("calibrate payload", "declared")] {
        let output = tactus(at, order);
        let told: Value = serde_json::from_slice(&output.stdout).unwrap_or_default();
        assert!(told[shown].is_string(), "{order}: {}", String::from_utf8_lossy(&output.stderr));
    }
    for order in ["calibrate forget", "calibrate payload nothing"] {
        let refused = tactus(at, order);
        assert!(String::from_utf8_lossy(&refused.stderr).contains("E504"), "{order}: {refused:?}");
    }
    until(at, &["approach", "run"]);
    run.kill().unwrap();
    run.wait().unwrap();
}

/// A machine that was suspended, or a program that a debugger holds: the device stops the arm and lets go of its host,
/// which must not wait for the end of the move.
#[test]
fn a_program_that_was_suspended_in_a_move_says_so_and_waits_for_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let _arm = StandIn::start(at);
    let mut teach = Command::new(env!("CARGO_BIN_EXE_tactus"));
    teach.current_dir(at).env("TACTUS_DEVICE", "unix:tactus.sock").stdin(Stdio::null()).stdout(Stdio::null());
    let order = "--non-interactive teach --at-home --from -0.8,0.3,-0.6,1,0.5,0.3,0 --duration 1";
    let teach = teach.args(order.split(' ')).stderr(Stdio::piped()).spawn().unwrap();
    until(at, &["approach"]);
    let signal = |name: &str| Command::new("kill").args([name, &teach.id().to_string()]).status().unwrap().success();
    assert!(signal("-STOP"));
    until(at, &["soft stop"]);
    // Whoever comes now learns why the arm stands.
    let status: Value = serde_json::from_slice(&tactus(at, "status").stdout).unwrap();
    assert_eq!((&status["fault"], &status["silences"]), (&0.into(), &1.into()), "{status}");
    assert!(signal("-CONT"));
    let begun = std::time::Instant::now();
    let output = teach.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("the device has no session with this host"), "{said}");
    assert!(begun.elapsed() < Duration::from_secs(20), "after {:?}", begun.elapsed());
}

/// Ctrl-Z and `fg`, or a machine that slept. The change that makes it fail: whoever the device has let go of is refused
/// for good.
#[test]
fn a_monitor_that_was_suspended_looks_on_anew_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let _arm = StandIn::start(at);
    assert!(tactus(at, "hand --at-home init").status.success());
    let mut monitor = Command::new(env!("CARGO_BIN_EXE_tactus"));
    monitor.current_dir(at).env("TACTUS_DEVICE", "unix:tactus.sock").args(["--json", "monitor"]);
    let mut monitor = monitor.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let signal = |name: &str, id: u32| Command::new("kill").args([name, &id.to_string()]).status().unwrap().success();
    let mut lines = BufReader::new(monitor.stdout.take().unwrap()).lines().map(Result::unwrap);
    assert!(lines.by_ref().any(|line| line.contains("q_rad")), "it looks on");
    assert!(signal("-STOP", monitor.id()));
    // The device lets go of who looks on after two seconds: 600 cycles.
    let suspended = cycle(at);
    while cycle(at) < suspended + 1200 {}
    assert!(signal("-CONT", monitor.id()));
    assert!(lines.by_ref().any(|line| line.contains("looks on anew")), "it says so");
    let told: Value = serde_json::from_str(&lines.find(|line| line.contains("q_rad")).unwrap()).unwrap();
    assert!(told["cycle"].as_u64().unwrap() >= suspended + 1200, "{told}");
    monitor.kill().unwrap();
    monitor.wait().unwrap();
}

/// `tactus --json monitor | head -1`: it would watch for ever, and keep one of two places from others.
#[test]
fn a_monitor_ends_when_nobody_reads_its_lines_any_more() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let _arm = StandIn::start(at);
    assert!(tactus(at, "hand --at-home init").status.success());
    let mut monitor = Command::new(env!("CARGO_BIN_EXE_tactus"));
    monitor.current_dir(at).env("TACTUS_DEVICE", "unix:tactus.sock").args(["--json", "monitor", "--duration", "60"]);
    monitor.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null());
    let mut monitor = monitor.spawn().unwrap();
    let mut lines = BufReader::new(monitor.stdout.take().unwrap());
    lines.read_line(&mut String::new()).unwrap();
    drop(lines);
    let begun = std::time::Instant::now();
    assert!(monitor.wait().unwrap().success());
    assert!(begun.elapsed() < Duration::from_secs(30), "{:?}", begun.elapsed());
}
