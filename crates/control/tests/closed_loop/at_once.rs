//! Two things that happen in one cycle, or in two that follow each other: both are told, and neither undoes the other.

use control::command::{Command, Refusal};
use control::{Event, Fault, State};
use puck::SafetyMode;

use crate::primitives::GOAL;
use crate::rig::Rig;

/// An arm that holds its posture, at rest.
fn holding() -> Rig<f32> {
    let mut rig = Rig::new(GOAL, 1);
    rig.command(Command::Hold);
    rig.run_for(2.0);
    rig
}

/// Presses the hand of an arm that holds beyond the force limit; `command` comes in the cycle in which that stops it.
fn stop_by_contact(rig: &mut Rig<f32>, command: Option<Command>) -> Option<Event> {
    rig.plant.glitch = 100.0;
    rig.tick(None);
    assert_eq!(rig.cycle.state(), State::Hold, "one sample may be corrupt");
    rig.tick(command).event
}

/// Seen: a clear was taken up in the very cycle in which a contact stopped the arm that held; the fault was gone before
/// any record or event had told of it, and the arm floated. The change that makes it fail: a clear does not ask whether
/// its fault was there before the cycle.
#[test]
fn a_clear_that_comes_in_the_cycle_of_a_fault_does_not_clear_it() {
    let mut rig = holding();
    let answer = stop_by_contact(&mut rig, Some(Command::ClearFault));
    rig.plant.glitch = 0.0;
    assert_eq!(answer, Some(Event::Refused(Refusal::CauseRemains)));
    assert_eq!((rig.cycle.state(), rig.cycle.fault()), (State::SoftStop, Fault::ContactForce));
    assert_eq!(rig.tick(None).event, Some(Event::Entered(State::SoftStop, Fault::ContactForce)));
    rig.run_for(1.0);
    rig.command(Command::ClearFault);
    assert_eq!((rig.cycle.state(), rig.cycle.fault()), (State::Gravity, Fault::None));
}

/// The same where the safety module takes the torque away, as an emergency stop does. The change that makes it fail is
/// the same.
#[test]
fn a_clear_that_comes_in_the_cycle_in_which_the_safety_module_drops_does_not_clear_that() {
    let mut rig = holding();
    rig.safety = SafetyMode::EStop;
    let answer = rig.tick(Some(Command::ClearFault)).event;
    assert_eq!(answer, Some(Event::Refused(Refusal::CauseRemains)));
    assert_eq!((rig.cycle.state(), rig.cycle.fault()), (State::Idle, Fault::SafetyDropped));
    rig.command(Command::ClearFault);
    assert_eq!(rig.cycle.fault(), Fault::None);
}

/// Seen: a command was answered in the cycle in which a contact stopped the arm, and a clear in the next one; that the
/// arm had stopped, and why, was told to nobody. The change that makes it fail: an event that waits behind an answer
/// gives way to the next one.
#[test]
fn what_waits_behind_an_answer_is_told_though_more_happens_before_its_turn() {
    let mut rig = holding();
    let answer = stop_by_contact(&mut rig, Some(Command::SetSpeed { factor: 1.0 }));
    rig.plant.glitch = 0.0;
    assert_eq!(answer, Some(Event::Refused(Refusal::WrongState)));
    rig.command(Command::ClearFault);
    rig.command(Command::Hold);
    let told: Vec<_> = (0..5).filter_map(|_| rig.tick(None).event).collect();
    let expected = [
        Event::Entered(State::SoftStop, Fault::ContactForce),
        Event::Entered(State::Gravity, Fault::None),
        Event::Entered(State::Hold, Fault::None),
    ];
    assert_eq!(told, expected);
}
