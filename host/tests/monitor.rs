//! The screen of the monitor, cell by cell: an arm at rest, in contact, and stopped by a fault.

use std::path::Path;

use control::{Fault, State, flags};
use device::Stage;
use link::{Capabilities, DeviceHello, Event, EventKind, HandStage, Name, Statistics, Status, Telemetry, Text};
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use tactus::monitor::{Watch, draw};

fn watch() -> Watch {
    Watch {
        hello: DeviceHello {
            board: Text::new("nucleo-h743zi2"),
            firmware: Text::new("0.1.0 (1a2b3c4)"),
            ticks_per_second: 400_000_000,
            capabilities: Capabilities { arm: true, hand: true, wrench: true },
            ..DeviceHello::default()
        },
        status: Status { cycle: 1200, startup_stage: Stage::WaitingForIdle.code(), ..Status::default() },
        statistics: Statistics { cost_worst_ticks: 62_000, ..Statistics::default() },
        ..Watch::default()
    }
}

/// An arm that plays a movement and touches something.
fn contact() -> Watch {
    let telemetry = Telemetry {
        cycle: 45_123,
        state: State::Run.code(),
        flags: flags::POSITIONS_KNOWN | flags::TARED | flags::FEEDBACK | flags::CLAMPED,
        phase: 0.2,
        q: [-0.87, 0.62, 0.1, 1.92, -0.2, -0.61, 2.9],
        dq: [0.12, -0.3, 0.0, 0.45, 0.0, -0.1, 0.02],
        tau: [1.2, -33.5, 0.4, 11.9, -0.2, 0.7, 0.1],
        wrench: [-8.4, 3.1, 22.5, 0.41, -0.02, 0.0],
        cost_ticks: 41_000,
        hand: [0.1, 1.4, 1.45, 0.9],
        hand_d: [0.1, 1.6, 1.6, 1.6],
        gauges: [-0.42, -0.38, 0.01],
        surprise: 6.3,
        ..Telemetry::default()
    };
    let mut watch = watch();
    watch.status = Status {
        startup_stage: Stage::Ready.code(),
        zeroed: true,
        loaded: Some(Name::new("reach-and-grasp").unwrap()),
        hand_stage: HandStage::Ready,
        ..Status::default()
    };
    watch.cycle(telemetry);
    watch.event(&Event { cycle: 44_200, kind: EventKind::State, code: State::Run.code().into(), detail: 0 });
    watch.event(&Event { cycle: 45_100, kind: EventKind::Surprise, code: 2, detail: 349 });
    watch
}

fn fault() -> Watch {
    let mut watch = contact();
    let cycle =
        Telemetry { state: State::SoftStop.code(), fault: Fault::ContactForce.code(), ..watch.telemetry.unwrap() };
    watch.cycle(cycle);
    watch.statistics = Statistics { missed_deadlines: 1, lost_replies: 12, bus_errors: 3, ..watch.statistics };
    let (code, detail) = (State::SoftStop.code().into(), Fault::ContactForce.code().into());
    watch.event(&Event { cycle: 45_124, kind: EventKind::State, code, detail });
    watch
}

/// The screen as text, a line a row.
fn screen(watch: &Watch, width: u16, height: u16) -> String {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
    terminal.draw(|frame| draw(frame, watch)).unwrap();
    let buffer = terminal.backend().buffer();
    let row = |y| (0..width).map(|x| buffer[(x, y)].symbol()).collect::<String>().trim_end().to_owned() + "\n";
    (0..height).map(row).collect()
}

/// Compares with the file; `UPDATE_DOCUMENTS=1` writes it.
fn is_golden(name: &str, watch: &Watch, size: (u16, u16)) {
    let shown = screen(watch, size.0, size.1);
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/screens").join(name);
    if std::env::var_os("UPDATE_DOCUMENTS").is_some() {
        std::fs::write(&file, &shown).unwrap();
    }
    assert_eq!(shown, std::fs::read_to_string(&file).unwrap(), "{name}");
}

#[test]
fn cli_9_screens_are_as_they_were_looked_at() {
    is_golden("idle.txt", &watch(), (80, 24));
    is_golden("contact.txt", &contact(), (80, 24));
    is_golden("fault.txt", &fault(), (80, 24));
    is_golden("wide.txt", &fault(), (110, 30));
}

/// The change that makes it fail: a cause is one line, whatever its length.
#[test]
fn the_whole_cause_of_every_fault_is_on_the_smallest_screen() {
    for fault in Fault::ALL {
        let mut watch = watch();
        watch.cycle(Telemetry { state: State::SoftStop.code(), fault: fault.code(), ..contact().telemetry.unwrap() });
        let shown = screen(&watch, 80, 24).split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(shown.contains(&watch.cause()), "{}: {shown}", watch.cause());
        assert!(shown.contains("s or space: stop the arm"), "{shown}");
    }
}

#[test]
fn the_screen_shows_no_number_that_nobody_has_measured() {
    // A cycle of the start-up carries zeros for what is not known yet.
    let mut starting = watch();
    starting.cycle(Telemetry { cycle: 7, ..Telemetry::default() });
    let shown = screen(&starting, 80, 24);
    assert!(shown.contains("J7  not zeroed") && !shown.contains("rad/s"), "{shown}");
    assert!(shown.contains("not known before the joint angles") && !shown.contains("fx"), "{shown}");
    // An arm that was zeroed before the monitor came has angles, and neither speed nor torque.
    let mut zeroed = watch();
    zeroed.status = Status { zeroed: true, q: [0.5; 7], ..zeroed.status };
    let shown = screen(&zeroed, 80, 24);
    assert!(shown.contains("J7  +0.500 rad") && !shown.contains("0.00 rad/s") && !shown.contains("0.0 N m"), "{shown}");
    // One that starts anew does not know any more where it stands.
    zeroed.cycle(Telemetry { cycle: 8, ..Telemetry::default() });
    assert!(screen(&zeroed, 80, 24).contains("J7  not read yet"), "{}", screen(&zeroed, 80, 24));
    // An arm without a sensor knows its angles and no force.
    starting.cycle(Telemetry { flags: flags::POSITIONS_KNOWN | flags::WRENCH_STALE, ..Telemetry::default() });
    let shown = screen(&starting, 80, 24);
    assert!(shown.contains("J7  +0.000 rad") && shown.contains("no force sensor answers"), "{shown}");
}

/// Seen: after an emergency stop no cycle comes until the arm has started anew, minutes perhaps. The screen went on
/// with the last one: its state, its fault, its joint angles, and no word of what the start-up waits for.
///
/// The change that makes it fail: the newest cycle counts more than any answer, however old it is.
#[test]
fn an_arm_that_starts_anew_is_not_shown_as_its_last_cycle_was() {
    let mut watch = fault();
    watch.answer(Status { startup_stage: Stage::WaitingForIdle.code(), ..Status::default() });
    let shown = screen(&watch, 80, 24);
    assert!(shown.contains("state IDLE") && !shown.contains("SOFT STOP"), "{shown}");
    assert!(shown.contains("start-up: ") && shown.contains("Shift-Idle"), "{shown}");
    assert!(shown.contains("J7  not zeroed") && !shown.contains("rad/s"), "{shown}");
    // With the first cycle of its new start it is shown as that says.
    watch.answer(Status { startup_stage: Stage::WaitingForActive.code(), zeroed: true, ..Status::default() });
    watch.cycle(Telemetry { cycle: 45_200, flags: flags::POSITIONS_KNOWN, q: [0.5; 7], ..Telemetry::default() });
    watch.answer(Status { startup_stage: Stage::Ready.code(), zeroed: true, ..Status::default() });
    assert!(screen(&watch, 80, 24).contains("J7  +0.500 rad"), "{}", screen(&watch, 80, 24));
}

#[test]
fn a_screen_that_is_too_small_says_so() {
    assert!(screen(&watch(), 79, 24).starts_with("80 x 24 are needed, here are 79 x 24"));
    assert!(screen(&watch(), 200, 23).starts_with("80 x 24 are needed, here are 200 x 23"));
}

/// The change that makes it fail: a small screen tells its size alone, while its keys stop the arm as ever.
#[test]
fn a_screen_that_is_too_small_tells_the_state_of_the_arm_and_the_keys_that_stop_it() {
    let mut watch = watch();
    watch.answer(Status { fault: Fault::ContactForce.code(), ..Status::default() });
    let small = screen(&watch, 40, 12);
    let told = small.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(told.contains(&format!("state {}", watch.state().to_uppercase())), "{small}");
    assert!(told.contains("s or space: stop the arm"), "{small}");
    assert!(told.contains("the contact force passed the stop threshold"), "{small}");
}

#[test]
fn what_is_not_known_is_null_for_a_script() {
    let idle = serde_json::to_value(watch().line()).unwrap();
    for key in
        ["fault", "loaded", "progress", "cycle", "q_rad", "wrench_N_Nm", "hand_rad", "surprise", "computation_us"]
    {
        assert!(idle[key].is_null(), "{key}: {}", idle[key]);
    }
    // A cycle of the start-up carries zeros for what nobody has measured yet.
    let mut starting = watch();
    starting.cycle(Telemetry { cycle: 7, ..Telemetry::default() });
    let line = serde_json::to_value(starting.line()).unwrap();
    assert_eq!(line["cycle"], 7);
    for key in ["q_rad", "dq_rad_s", "wrench_N_Nm", "hand_rad"] {
        assert!(line[key].is_null(), "{key}: {line}");
    }
    // An arm without a sensor knows its angles.
    starting.cycle(Telemetry { flags: flags::POSITIONS_KNOWN | flags::WRENCH_STALE, ..Telemetry::default() });
    let line = serde_json::to_value(starting.line()).unwrap();
    assert!(line["q_rad"].is_array() && line["wrench_N_Nm"].is_null(), "{line}");
    let fault = serde_json::to_value(fault().line()).unwrap();
    assert_eq!((&fault["state"], &fault["fault"]), (&"soft stop".into(), &"ContactForce".into()));
    assert_eq!((&fault["cycle"], &fault["adaptation"]), (&45_123.into(), &"at its limits".into()));
}
