//! A start-up behind a fault: who may say where the arm stands, and that a latched fault is told before anybody waits.

use std::time::Duration;

use control::Fault;
use device::Stage;
use faults::bench::{connected, plant, simulation};
use lab::client::Client;
use lab::device::Device;
use lab::procedure::{EndCondition, ProcedureError, make_ready, pass, start_up};
use lab::transport::SimulatorKind;
use sim::PendantAction;
use sim::fault::{FaultKind, FrameKind, Injection};

fn wait(arm: &mut Client<Device>, seconds: u64) {
    let end = arm.now() + Duration::from_secs(seconds);
    while arm.now() < end {
        arm.next(Duration::from_millis(500)).unwrap();
    }
}

/// A simulated arm stands at home when it is switched on, and is zeroed there unasked. One whose counts jumped later
/// lies where it sank to: only a person knows where that is, as with a real one.
#[test]
fn g2_a_simulated_arm_whose_counts_jumped_is_not_taken_to_stand_at_home() {
    let mut arm = connected(simulation(0, Duration::ZERO, SimulatorKind::InProcess).unwrap()).unwrap();
    make_ready(&mut arm, false, |_| {}).unwrap();
    arm.hold().unwrap();
    pass(&mut arm, Duration::from_secs(2), EndCondition::OnAnyStop).unwrap();
    let jump = FaultKind::CountJump { node: 4, by: 5000 };
    plant(&mut arm).inject(&[Injection { at: 0.0, lasts: f64::INFINITY, every: 0.0, times: 1, what: jump }]);
    let stopped = pass(&mut arm, Duration::from_secs(1), EndCondition::OnFault);
    assert!(matches!(stopped, Err(ProcedureError::Stopped(Fault::ImplausiblePosition))), "{stopped:?}");
    plant(&mut arm).press(PendantAction::ShiftIdle);
    // It sinks, its motors shorted, and then lies somewhere.
    wait(&mut arm, 20);
    let unasked = start_up(&mut arm, false, Stage::WaitingForActive, |_| {});
    assert!(matches!(unasked, Err(ProcedureError::NotZeroed)), "{unasked:?}");
    // Emergency stop; a person carries it back and says where it stands, and then clears: it holds where it truly is.
    plant(&mut arm).press(PendantAction::PressEStop);
    plant(&mut arm).carry_home();
    wait(&mut arm, 2);
    plant(&mut arm).press(PendantAction::ReleaseEStop);
    plant(&mut arm).press(PendantAction::ShiftIdle);
    wait(&mut arm, 4);
    let stands = plant(&mut arm).world().joint_positions().map(|angle| angle as f32);
    arm.zero(stands).unwrap();
    start_up(&mut arm, false, Stage::WaitingForActive, |_| {}).unwrap();
    arm.clear_fault().unwrap();
    // The fault's end is told a cycle later; it is none of the hold.
    wait(&mut arm, 1);
    plant(&mut arm).press(PendantAction::ShiftActivate);
    start_up(&mut arm, false, Stage::Ready, |_| {}).unwrap();
    arm.take_events();
    arm.hold().unwrap();
    pass(&mut arm, Duration::from_secs(1), EndCondition::OnAnyStop).unwrap();
    let (told, truth) = (arm.status().unwrap().q, plant(&mut arm).world().joint_positions());
    for (told, truth) in told.into_iter().zip(truth) {
        assert!((f64::from(told) - truth).abs() < 0.005, "{told} rad, is {truth} rad");
    }
}

/// Who activates an arm under a latched fault has its brakes set again, so nobody is told to.
#[test]
fn e8_a_latched_fault_is_told_before_anybody_is_sent_to_the_pendant() {
    let mut arm = connected(simulation(0, Duration::ZERO, SimulatorKind::InProcess).unwrap()).unwrap();
    make_ready(&mut arm, false, |_| {}).unwrap();
    arm.hold().unwrap();
    pass(&mut arm, Duration::from_secs(2), EndCondition::OnAnyStop).unwrap();
    let refuse = FaultKind::Refuse(FrameKind::Torques);
    plant(&mut arm).inject(&[Injection { at: 0.0, lasts: 0.3, every: 0.0, times: 1, what: refuse }]);
    wait(&mut arm, 20);
    let begun = arm.now();
    let waiting = start_up(&mut arm, false, Stage::Ready, |_| {});
    assert!(matches!(waiting, Err(ProcedureError::Faulted(Fault::BusFault))), "{waiting:?}");
    assert!(arm.now() - begun < Duration::from_secs(5), "{:?}", arm.now() - begun);
    // Clearing comes first, and needs nobody at the pendant.
    arm.clear_fault().unwrap();
    plant(&mut arm).press(PendantAction::ShiftActivate);
    start_up(&mut arm, false, Stage::Ready, |_| {}).unwrap();
    arm.take_events();
    arm.hold().unwrap();
    pass(&mut arm, Duration::from_secs(1), EndCondition::OnAnyStop).unwrap();
}
