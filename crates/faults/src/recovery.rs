//! The way back: a person activates, clears, lets the arm hold, and has it do the whole movement.

use std::time::Duration;

use control::{Fault, State};
use device::Stage;
use lab::error::HostError;
use lab::procedure::{self, EndCondition, Mode, RunRequest};
use link::{Name, Refusal};
use puck::SafetyMode;
use sim::PendantAction;

use crate::bench::{Arm, Failure, plant};
use crate::entry::{Recover, Scenario};
use crate::measure::AT_REST;
use crate::movement::movement;

/// Longest time for the arm to be lowered and come to rest, and for a start-up.
const TIMEOUT: Duration = Duration::from_secs(60);

/// Time that a person takes between pendant and keyboard.
const NOTICE: Duration = Duration::from_millis(500);

/// Number of times that a person looks again whom the device tells that the cause is still there: for five seconds at
/// an arm that rests.
const LOOKS: u32 = 10;

/// Distance of the joint angles told from the true ones after a zeroing, rad: a count of M7, and what the arm moved.
const BELIEVED: f64 = 0.02;

/// Goes the whole way back.
///
/// # Errors
/// The step that failed, and why.
pub fn recover(arm: &mut Arm, way: Recover) -> Result<(), Failure> {
    if way == Recover::None {
        return Ok(());
    }
    if State::from_code(arm.status()?.state).is_some_and(|state| !matches!(state, State::Idle | State::Fault)) {
        arm.stop().map_err(|error| format!("stop: {error}"))?;
    }
    rest(arm)?;
    let has_zeroed = start_up(arm, way)?;
    if way != Recover::ZeroIfAsked && has_zeroed != (way == Recover::Zero) {
        let words = if has_zeroed { "zeroing was demanded" } else { "zeroing was not demanded" };
        return Err(words.into());
    }
    if Fault::from_code(arm.status()?.fault) != Some(Fault::None) {
        // Activated under a fault, it sinks until it is braked again.
        rest(arm)?;
        clear(arm)?;
        // A device with a fault goes on asking for IDLE.
        start_up(arm, way)?;
    }
    arm.take_events();
    arm.hold().map_err(|error| format!("hold: {error}"))?;
    procedure::pass(arm, Duration::from_millis(500), EndCondition::OnAnyStop)?;
    let told = arm.status()?.q.map(f64::from);
    let truth = plant(arm).world().joint_positions();
    if let Some(joint) = (0..7).find(|joint| (told[*joint] - truth[*joint]).abs() > BELIEVED) {
        return Err(format!("J{} is told as {:.3}, is {:.3} rad", joint + 1, told[joint], truth[joint]).into());
    }
    let movement = movement();
    // Whoever restarted the device has to give it the movement again.
    arm.upload(&movement.to_image()?, |_, _, _| {}).map_err(|error| format!("upload: {error}"))?;
    procedure::go_to_start(arm, &movement.start, |_| {}).map_err(|error| format!("to the start: {error}"))?;
    let request = RunRequest::new(Name::new(&movement.name)?, movement.movement.duration, Mode::Track.options());
    procedure::play(arm, &request, &mut |_| {}).map_err(|error| format!("run: {error}"))?;
    Ok(())
}

/// Goes the way back while the late faults of a scenario befall the arm, and waits until they are over. What fails by
/// them is told to nobody.
///
/// # Errors
/// The device does not answer any more.
pub fn hindered(arm: &mut Arm, scenario: &Scenario) -> Result<(), Failure> {
    let begin = arm.now();
    plant(arm).inject(&scenario.late);
    let _ = recover(arm, scenario.recover);
    let ends =
        scenario.late.iter().map(|fault| if fault.lasts.is_finite() { fault.at + fault.lasts } else { fault.at });
    let end = begin + Duration::from_secs_f64(ends.fold(0.0, f64::max)) + NOTICE;
    while arm.now() < end {
        arm.next(NOTICE)?;
    }
    Ok(())
}

/// Waits until the arm rests.
fn rest(arm: &mut Arm) -> Result<(), Failure> {
    let deadline = arm.now() + TIMEOUT;
    while arm.now() < deadline {
        if plant(arm).world().joint_velocities().iter().all(|speed| speed.abs() < AT_REST) {
            return Ok(());
        }
        arm.next(Duration::from_millis(20))?;
    }
    Err("the arm does not come to rest".into())
}

/// Clears the fault. A person who is told that the cause is still there lets the arm come to rest, as the device says,
/// and looks again: an arm may turn slowly on its brakes, and motors are asked for their temperature once a second.
fn clear(arm: &mut Arm) -> Result<(), Failure> {
    for _ in 0..LOOKS {
        match arm.clear_fault() {
            Err(HostError::Refused { reason: Refusal::CauseRemains, .. }) => {
                rest(arm)?;
                wait(arm)?;
            }
            cleared => return cleared.map_err(|error| format!("clear: {error}").into()),
        }
    }
    arm.clear_fault().map_err(|error| format!("clear: {error}").into())
}

/// Lets time pass; what the device tells meanwhile does not matter.
fn wait(arm: &mut Arm) -> Result<(), Failure> {
    let end = arm.now() + NOTICE;
    while arm.now() < end {
        arm.next(NOTICE)?;
    }
    Ok(())
}

/// At the pendant, until the device is ready and has noticed it; true if it demanded zeroing, which it then gets at the
/// true posture.
fn start_up(arm: &mut Arm, way: Recover) -> Result<bool, Failure> {
    let deadline = arm.now() + TIMEOUT;
    let mut has_zeroed = false;
    let mut refused = String::new();
    if plant(arm).safety_mode() == SafetyMode::EStop {
        plant(arm).press(PendantAction::ReleaseEStop);
        plant(arm).press(PendantAction::ShiftIdle);
    }
    loop {
        let status = arm.status()?;
        match Stage::from_code(status.startup_stage) {
            Some(Stage::WaitingForZero) => {
                if way != Recover::Run && !has_zeroed && arm.hold().is_ok() {
                    return Err("hold was accepted before zeroing".into());
                }
                if plant(arm).safety_mode() == SafetyMode::Active {
                    plant(arm).press(PendantAction::ShiftIdle);
                }
                let truth = plant(arm).world().joint_positions();
                match arm.zero(truth.map(|angle| angle as f32)) {
                    Ok(()) => has_zeroed = true,
                    Err(error) => refused = format!(", zeroing is refused: {error}"),
                }
            }
            Some(Stage::WaitingForIdle) => plant(arm).press(PendantAction::ShiftIdle),
            // It tries again by itself, each second.
            Some(Stage::Blocked) => refused = format!(", blocked: {:?}", status.blocked),
            Some(Stage::WaitingForActive) => {
                plant(arm).press(PendantAction::ShiftIdle);
                plant(arm).press(PendantAction::ShiftActivate);
            }
            Some(Stage::Ready) if plant(arm).safety_mode() == SafetyMode::Active => {
                // A device that still wants the brakes may take the arm out of ACTIVE once more; with a fault it does
                // so until that is cleared.
                wait(arm)?;
                if status.fault != Fault::None.code() || plant(arm).safety_mode() == SafetyMode::Active {
                    return Ok(has_zeroed);
                }
            }
            Some(Stage::Ready) => {
                plant(arm).press(PendantAction::ShiftIdle);
                plant(arm).press(PendantAction::ShiftActivate);
            }
            _ => {}
        }
        if arm.now() > deadline {
            return Err(format!("the start-up hangs in {:?}{refused}", Stage::from_code(status.startup_stage)).into());
        }
        arm.next(Duration::from_millis(100))?;
    }
}
