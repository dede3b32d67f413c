//! Every way out of a movement: asked for, host lost, emergency stop.

use std::time::Duration;

use control::State;
use device::Stage;
use link::frame::Decoder;
use link::{Reply, Telemetry};
use sim::{PendantAction, TICKS_PER_SECOND};
use system_tests::bus::{CYCLE_TICKS, torques};
use system_tests::execution::{begin, beyond_torque_limits, largest_torque_step, prepare};
use system_tests::{Arm, expect, raw, ready, simulation, taught};
use tactus::client::Incoming;
use tactus::transport::Transport as _;

/// Rounding of single precision on the torque steps of the limiter.
const ROUNDING: f64 = 1e-4;

/// An arm in the middle of the taught movement, its telemetry on; with what it told since the start.
fn in_the_middle(address: &str) -> (Arm, Vec<Telemetry>) {
    let file = taught();
    let mut arm = ready(address);
    prepare(&mut arm, file);
    expect(arm.set_telemetry(1));
    begin(&mut arm, file);
    let cycles = (file.duration * 300.0 / 2.0) as usize;
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
    while telemetry.last().expect("it runs").cycle < last_heard + 300 {
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
    let until = device.now() + Duration::from_millis(900);
    let mut decoder = Decoder::new();
    let mut heard = Vec::new();
    while device.now() < until {
        heard.extend(raw::listen(device, &mut decoder, until));
    }
    let cycles: Vec<Telemetry> = heard
        .into_iter()
        .filter_map(|reply| match reply {
            Reply::Telemetry(telemetry) => Some(telemetry),
            _ => None,
        })
        .collect();
    let stopped = cycles.iter().find(|cycle| state(cycle) == Some(State::SoftStop)).expect("it stopped");
    let after = f64::from(stopped.cycle - silent_since) / 300.0;
    println!("stopped {after:.3} s after the host's last look");
    // The host's last ping was up to 100 ms before.
    assert!((0.39..=0.51).contains(&after), "stopped after {after:.3} s of silence");
    assert!(largest_torque_step(&cycles) <= 1.0 + ROUNDING);
    // A host that comes back finds an arm at rest, and is told why.
    let statistics = expect(arm.statistics());
    assert_eq!(statistics.link_timeouts, 1);
    assert_eq!(State::from_code(expect(arm.status()).state), Some(State::SoftStop));
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
    assert!(after <= 6 * CYCLE_TICKS, "torque {after} ticks after the E-stop");
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
