//! Every way out of a movement: asked for, host lost, emergency stop.

use std::time::Duration;

use control::{RATE_HZ, State};
use device::Stage;
use lab::client::Incoming;
use lab::transport::Transport as _;
use link::frame::{Decoder, LINK_TIMEOUT_MS};
use link::{EventKind, HostHello, Reply, Request, Telemetry, Text};
use sim::{PendantAction, TICKS_PER_SECOND};
use system_tests::bus::{CYCLE_TICKS, torques};
use system_tests::execution::{begin, beyond_torque_limits, largest_torque_step, prepare};
use system_tests::{Arm, expect, raw, ready, simulation, taught};

/// Rounding of single precision on the torque steps of the limiter.
const ROUNDING: f64 = 1e-4;

/// An arm in the middle of the taught movement, its telemetry on; with what it told since the start.
fn in_the_middle(address: &str) -> (Arm, Vec<Telemetry>) {
    let file = taught();
    let mut arm = ready(address);
    prepare(&mut arm, file);
    expect(arm.set_telemetry(1));
    begin(&mut arm, file);
    let cycles = (file.duration * control::RATE / 2.0) as usize;
    let mut telemetry = Vec::new();
    while telemetry.len() < cycles {
        telemetry.extend(next(&mut arm));
    }
    assert_eq!(telemetry.last().and_then(state), Some(State::Run));
    (arm, telemetry)
}

/// The next cycle; `None` if it was something else.
fn next(arm: &mut Arm) -> Option<Telemetry> {
    match expect(arm.next(Duration::from_secs(1))).expect("telemetry for ever") {
        Incoming::Telemetry(telemetry) => Some(telemetry),
        Incoming::Event(_) => None,
    }
}

fn state(cycle: &Telemetry) -> Option<State> {
    State::from_code(cycle.state)
}

fn speed(cycle: &Telemetry) -> f32 {
    cycle.dq.iter().fold(0.0, |largest, dq| largest.max(dq.abs()))
}

#[test]
fn stop_ends_a_movement_within_two_cycles_and_without_a_jerk() {
    let (mut arm, mut telemetry) = in_the_middle("sim:seed=41");
    let last_heard = telemetry.last().expect("it runs").cycle;
    expect(arm.stop());
    while telemetry.last().expect("it runs").cycle < last_heard + RATE_HZ {
        telemetry.extend(next(&mut arm));
    }
    let stopped = telemetry.iter().find(|cycle| state(cycle) == Some(State::SoftStop)).expect("it stopped");
    let took = stopped.cycle - last_heard;
    let step = largest_torque_step(&telemetry);
    println!(
        "soft stop {took} cycles after the cycle last heard; torque steps {:.0} % of the rate limit",
        step * 100.0
    );
    assert!(took <= 2, "soft stop only {took} cycles later");
    assert!(
        telemetry
            .iter()
            .filter(|cycle| cycle.cycle >= stopped.cycle)
            .all(|cycle| state(cycle) == Some(State::SoftStop))
    );
    assert!(step <= 1.0 + ROUNDING, "a torque jumped by {step} of what the limiter allows in a cycle");
    assert_eq!(beyond_torque_limits(&telemetry), None);
    let end = telemetry.last().expect("a second later");
    assert!(speed(stopped) > 0.05, "the arm was not moving: {} rad/s", speed(stopped));
    assert!(speed(end) < 0.02, "the arm still moves at {} rad/s a second later", speed(end));
    assert!(end.tau.iter().any(|tau| tau.abs() > 1.0), "an arm that stopped must still be carried");
}

#[test]
fn arm_stops_half_a_second_after_its_host_fell_silent() {
    let (mut arm, telemetry) = in_the_middle("sim:seed=42");
    let silent_since = telemetry.last().expect("it runs").cycle;
    let device = arm.transport();
    let until = device.now() + Duration::from_millis(700);
    let mut decoder = Decoder::new();
    let mut heard = Vec::new();
    while device.now() < until {
        heard.extend(raw::listen(device, &mut decoder, until));
    }
    // The last words of the session say why it ends; telemetry ends with it.
    let Some(Reply::Event(event)) = heard.last() else { panic!("{:?}", heard.last()) };
    assert_eq!((event.kind, event.detail), (EventKind::LinkTimeout, LINK_TIMEOUT_MS));
    let after = f64::from(event.cycle - silent_since) / control::RATE;
    println!("stopped {after:.3} s after the host's last look");
    // The host's last ping was up to 100 ms before that.
    assert!((0.39..=0.51).contains(&after), "stopped after {after:.3} s of silence");
    let states = heard.iter().filter_map(|reply| match reply {
        Reply::Telemetry(cycle) => State::from_code(cycle.state),
        _ => None,
    });
    assert!(states.clone().count() > 100 && states.clone().all(|state| state == State::Run));

    // A host that comes finds an arm at rest that is carried.
    let owner = Text::new("the next host");
    let (link_version, schema_hash, model_hash) = (link::LINK_VERSION, link::SCHEMA_HASH, control::MODEL_HASH);
    let hello = Request::Hello(HostHello { link_version, schema_hash, model_hash, owner });
    let answer = raw::ask(device, 77, 1, &hello);
    assert!(matches!(answer, Some(Reply::Hello { .. })), "{answer:?}");
    let answer = raw::ask(device, 77, 2, &Request::Statistics);
    let Some(Reply::Statistics { statistics, .. }) = answer else { panic!("{answer:?}") };
    assert_eq!(statistics.link_timeouts, 1);
    let answer = raw::ask(device, 77, 3, &Request::Status);
    let Some(Reply::Status { status, .. }) = answer else { panic!("{answer:?}") };
    assert_eq!(State::from_code(status.state), Some(State::SoftStop));
    let speed = simulation(device).world().joint_velocities().iter().fold(0.0, |most: f64, dq| most.max(dq.abs()));
    assert!(speed < 0.05, "the arm still moves at {speed} rad/s");
}

#[test]
fn emergency_stop_takes_the_torque_away_and_start_up_begins_again() {
    let (mut arm, _) = in_the_middle("sim:seed=43");
    let plant = simulation(arm.transport()).plant();
    let pressed = plant.now();
    plant.press(PendantAction::PressEStop);
    assert_eq!(plant.safety_mode(), puck::SafetyMode::EStop);
    let until = arm.now() + Duration::from_secs(1);
    while arm.now() < until {
        expect(arm.next(Duration::from_millis(50)));
    }
    let sent = torques(simulation(arm.transport()).plant().recorded());
    let last = sent.iter().filter(|(_, units)| *units != [0; 4]).map(|(start, _)| *start).max().expect("it had run");
    let after = last.saturating_sub(pressed);
    println!("last torque {after} ticks after the button");
    assert!(after <= 2 * CYCLE_TICKS, "torque {after} ticks after the E-stop");
    let status = expect(arm.status());
    assert_ne!(Stage::from_code(status.startup_stage), Some(Stage::Ready));
    assert!(!status.zeroed, "pucks without power forget where they are");
    assert!(expect(arm.statistics()).bus_restarts >= 1);
    assert!(arm.hold().is_err(), "an arm without power cannot hold");

    let plant = simulation(arm.transport()).plant();
    plant.press(PendantAction::ReleaseEStop);
    plant.press(PendantAction::ShiftIdle);
    let deadline = plant.now() + 10 * TICKS_PER_SECOND;
    loop {
        let status = expect(arm.status());
        if Stage::from_code(status.startup_stage) == Some(Stage::WaitingForZero) {
            break;
        }
        let now = simulation(arm.transport()).ticks();
        assert!(now < deadline, "start-up hangs in {:?}, {:?}", Stage::from_code(status.startup_stage), status.blocked);
        expect(arm.next(Duration::from_millis(50)));
    }
    let sent = torques(simulation(arm.transport()).plant().recorded());
    assert_eq!(sent.iter().find(|(start, units)| *start > last && *units != [0; 4]), None, "torque nobody asked for");
    assert_eq!(simulation(arm.transport()).plant().trace().invalid, 0);
}
