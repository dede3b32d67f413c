//! A zero that is lost in the simulated arm: who may say where it stands.

use std::time::Duration;

use control::Fault;
use device::Stage;
use faults::bench::{connected, plant, simulation};
use lab::procedure::{EndCondition, ProcedureError, make_ready, pass, start_up};
use lab::transport::SimulatorKind;
use sim::PendantAction;
use sim::fault::{FaultKind, Injection};

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
    let lies = arm.now() + Duration::from_secs(20);
    while arm.now() < lies {
        arm.next(Duration::from_millis(500)).unwrap();
    }
    let unasked = start_up(&mut arm, false, Stage::WaitingForActive, |_| {});
    assert!(matches!(unasked, Err(ProcedureError::NotZeroed)), "{unasked:?}");
    start_up(&mut arm, true, Stage::WaitingForActive, |_| {}).unwrap();
}
