//! Moves to a posture and to the start of a primitive.

use std::time::Duration;

use control::State;
use link::{HandStage, Refusal};

use super::ProcedureError;
use super::hand::{HandReach, move_hand, move_hand_to_the_end};
use super::wait::{EndCondition, pass, wait_for};
use crate::client::Client;
use crate::device::Device;
use crate::error::{Capability, HostError};
use crate::primitive_file::Waypoint;

/// Longest move to a posture, s: what `control` allows.
const LONGEST_TRAVEL: u64 = 125;

/// Time for which an arm that has just got its torque holds still before it moves. Whoever held it until then lets go:
/// a hand that still does would be worked against, and the torque for that would be too much a moment later.
const LET_GO: Duration = Duration::from_secs(1);

/// Longest time in which an arm that holds comes to rest: one that carries a kilogram of which its device does not know
/// sinks until the integral of the hold bears it.
const REST: Duration = Duration::from_secs(10);

/// Time between two tries to begin a move, while the arm comes to rest.
const REST_TRY: Duration = Duration::from_millis(200);

/// Begins the move of the joints to `q` (rad) within `seconds`, or longer where the device asks for it; waits before
/// until the arm has come to rest.
///
/// # Errors
/// As [`travel`].
pub(super) fn approach(client: &mut Client<Device>, q: [f32; 7], seconds: f32) -> Result<(), ProcedureError> {
    let end = client.now() + REST;
    loop {
        match client.approach(q, seconds) {
            Err(HostError::Refused { reason: Refusal::Moving, .. }) if client.now() < end => {
                pass(client, REST_TRY, EndCondition::OnAnyStop)?;
            }
            begun => return Ok(begun?),
        }
    }
}

/// Moves the joints to `q` (rad) and waits until the arm holds there. `progress` hears the time since the start, s.
///
/// # Errors
/// [`ProcedureError`]: the device refuses, the arm stops by itself, or it takes too long.
pub fn travel(client: &mut Client<Device>, q: [f32; 7], progress: impl FnMut(f64)) -> Result<(), ProcedureError> {
    within(client, q, 0.0, progress)
}

/// The same within `seconds`, or longer where the device asks for it.
///
/// # Errors
/// As [`travel`].
pub(super) fn within(
    client: &mut Client<Device>,
    q: [f32; 7],
    seconds: f32,
    progress: impl FnMut(f64),
) -> Result<(), ProcedureError> {
    client.require(Capability::Arm)?;
    hold(client)?;
    client.take_events();
    approach(client, q, seconds)?;
    wait_for("the move to the posture", LONGEST_TRAVEL, client, progress)
}

/// Longest time for which an arm that something has pushed aside on its way is waited for.
const COMING_BACK: Duration = Duration::from_secs(5);

/// A joint farther than this from the start posture makes the arm go there first, rad; the device refuses at 50 mrad.
const START_TOLERANCE: f64 = 0.02;

/// A digit farther than this from the start posture makes the hand go there first, rad; the device refuses at 0.15 rad.
const HAND_TOLERANCE: f64 = 0.08;

/// Brings arm and hand to where a primitive begins, if they are not there yet. The arm holds then. `progress` hears the
/// time since the start, s.
///
/// # Errors
/// As [`travel`]; [`ProcedureError::Hand`] if the hand cannot open.
pub fn go_to_start(
    client: &mut Client<Device>,
    start: &Waypoint,
    progress: impl FnMut(f64),
) -> Result<(), ProcedureError> {
    let far = |at: &[f32], to: &[f64], tolerance: f64| {
        at.iter().zip(to).any(|(at, to)| (f64::from(*at) - to).abs() > tolerance)
    };
    let status = client.status()?;
    let holds = State::from_code(status.state) == Some(State::Hold);
    if !client.hello().capabilities.arm {
        // A hand alone goes to its part of the start.
        hold(client)?;
    } else if !holds || far(&status.q, &start.posture, START_TOLERANCE) {
        travel(client, start.posture.map(|angle| angle as f32), progress)?;
        // What was in its way has let its springs go, and it comes back slowly.
        let end = client.now() + COMING_BACK;
        while client.now() < end && far(&client.status()?.q, &start.posture, START_TOLERANCE) {
            pass(client, REST_TRY, EndCondition::OnAnyStop)?;
        }
    }
    let status = client.status()?;
    if status.hand_stage == HandStage::Ready && far(&status.hand, &start.hand, HAND_TOLERANCE) {
        let hand = start.hand.map(|angle| angle as f32);
        // An arm plays while its hand comes to the end of its plan; a hand alone takes no run before.
        let moved = if client.hello().capabilities.arm {
            move_hand(client, hand)?
        } else {
            move_hand_to_the_end(client, hand)?
        };
        if let HandReach::Stopped(at) = moved
            && far(&at, &start.hand, HAND_TOLERANCE)
        {
            return Err(ProcedureError::Hand("something keeps it from going to where the movement begins"));
        }
    }
    Ok(())
}

/// Torque begins with holding: from rest the arm must first carry itself before it may move.
fn hold(client: &mut Client<Device>) -> Result<(), ProcedureError> {
    if State::from_code(client.status()?.state) != Some(State::Hold) {
        client.hold()?;
        pass(client, LET_GO, EndCondition::OnAnyStop)?;
    }
    Ok(())
}
