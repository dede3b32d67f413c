//! From power-up under QEMU to an arm that floats.

use std::cell::RefCell;

use control::State;
use device::Stage;
use lab::client::Client;
use lab::procedure;
use sim::FrameClass;
use system_tests::bus::{CYCLE_TICKS, position_requests, torques};
use system_tests::execution::{distance, watch};
use system_tests::{at_rest, boot, expect, ready, simulation};

/// Largest spread of the start of a position request, ticks: interrupt and round (10 us) behind the rest of the longest
/// frame that may be on the wire (135 us).
const JITTER: u64 = 145 * sim::TICKS_PER_MICROSECOND;

#[test]
fn firmware_boots_from_the_emergency_stop_to_ready_through_every_stage() {
    let mut device = boot("sim:seed=11");
    let mode = device.simulation().map(|simulation| simulation.plant().safety_mode());
    assert_eq!(mode, Some(puck::SafetyMode::EStop), "the arm must start with the E-stop pressed");
    let mut arm = expect(Client::connect(device, "system test"));
    let stages = RefCell::new(Vec::new());
    expect(procedure::make_ready(&mut arm, false, |look| stages.borrow_mut().push(look.stage)));
    let stages = stages.into_inner();
    // Motor power changes what there is to be found on the bus: it is enumerated once more behind the E-stop.
    let powered = stages.iter().rposition(|stage| *stage == Stage::Enumerating).unwrap_or(0);
    assert!(stages[powered..].is_sorted(), "stages went back: {stages:?}");
    for stage in [Stage::Waking, Stage::Reading, Stage::WaitingForZero, Stage::WaitingForActive, Stage::Ready] {
        assert!(stages[powered..].contains(&stage), "{stage:?} is not among {stages:?}");
    }
    let status = expect(arm.status());
    assert_eq!((status.safety_mode, status.zeroed, status.fault), (Some(2), true, 0));
    let simulation = simulation(arm.transport());
    let (truth, trace) = (simulation.world().joint_positions(), simulation.plant().trace());
    assert_eq!(trace.invalid, 0, "invalid frames on the bus: {:?}", trace.invalid_examples);
    assert_eq!(simulation.plant().lost_requests(), 0, "requests came too fast for the pucks");
    for (joint, (measured, truth)) in status.q.iter().zip(truth).enumerate() {
        let error = f64::from(*measured) - truth;
        assert!(error.abs() < 2e-3, "joint {} is measured {error:e} rad beside the truth", joint + 1);
    }
}

#[test]
fn every_cycle_begins_on_the_300_hz_grid() {
    let mut arm = ready("sim:seed=12,world=simple");
    let from = simulation(arm.transport()).ticks();
    let telemetry = watch(&mut arm, 2 * control::RATE_HZ as usize);
    assert!(telemetry.windows(2).all(|pair| pair[1].cycle == pair[0].cycle + 1), "a cycle is missing");
    let simulation = simulation(arm.transport());
    let until = simulation.ticks();
    let requests: Vec<u64> =
        position_requests(simulation.plant().recorded()).into_iter().filter(|start| *start >= from).collect();
    let expected = (until - from) / CYCLE_TICKS;
    assert!(
        (expected..=expected + 1).contains(&(requests.len() as u64)),
        "{} requests in {expected} cycles",
        requests.len()
    );
    // Measured against one grid from the first request to the last: a period that is off by a tick drifts out of it.
    let places = requests.iter().zip(0..).map(|(start, count)| *start as i64 - (count * CYCLE_TICKS) as i64);
    let (earliest, latest) = places.fold((i64::MAX, i64::MIN), |(low, high), at| (low.min(at), high.max(at)));
    println!("position requests: jitter {:.2} us", (latest - earliest) as f64 / sim::TICKS_PER_MICROSECOND as f64);
    assert!(latest - earliest <= JITTER as i64, "the grid wanders by {} ticks", latest - earliest);
    assert_eq!(expect(arm.statistics()).missed_deadlines, 0);
}

#[test]
fn no_torque_flows_before_a_person_commands() {
    let mut arm = at_rest("sim:seed=13");
    watch(&mut arm, control::RATE_HZ as usize / 2);
    let plant = simulation(arm.transport()).plant();
    let sent = torques(plant.recorded());
    assert!(sent.len() > 100, "the pucks must be told zero explicitly: {} frames", sent.len());
    assert_eq!(sent.iter().find(|(_, units)| *units != [0; 4]), None, "torque without a command");
    assert_eq!(plant.trace().count(FrameClass::PackedTorque), sent.len() as u64);
    assert_eq!(State::from_code(expect(arm.status()).state), Some(State::Idle));
}

#[test]
fn gravity_compensation_holds_the_arm_still() {
    let mut arm = ready("sim:seed=14");
    expect(arm.gravity());
    let start = simulation(arm.transport()).world().grasp_pose().position;
    let telemetry = watch(&mut arm, 3 * control::RATE_HZ as usize);
    assert!(telemetry.iter().all(|cycle| State::from_code(cycle.state) == Some(State::Gravity)));
    let end = simulation(arm.transport()).world().grasp_pose().position;
    let drift = distance(&start, &end);
    println!("drift in 3 s: {:.3} mm", drift * 1e3);
    assert!(drift < 5e-3, "the floating arm drifted {:.1} mm in 3 s", drift * 1e3);
    // It is the arm that is held, not a brake: the torques carry it.
    let carrying = telemetry.iter().flat_map(|cycle| cycle.tau).fold(0.0, |largest: f32, tau| largest.max(tau.abs()));
    assert!(carrying > 1.0, "no torque carries the arm: {carrying} N m at the most");
}
