//! The hand: initialise it, move it, and tell whether something is in the way.

use std::time::Duration;

use control::State;
use device::HandFailure;
use link::{EventKind, HandStage};
use puck::Node;

use super::ProcedureError;
use super::wait::{EndCondition, after, pass};
use crate::client::{Client, Incoming};
use crate::device::Device;

/// Longest initialisation, s; it takes about five.
const INITIALISATION: u64 = 30;

/// Longest move of the hand, s: from stop to stop takes about three.
const LONGEST_MOVE: u64 = 15;

/// Period at which the hand is polled.
const LOOK: Duration = Duration::from_millis(50);

/// A digit nearer to its target than this has arrived, rad: friction in the drive was seen to leave 0.04 rad at the
/// spread.
const NEAR: f32 = 0.06;

/// A digit that moves less than this between two looks stands, rad.
const STANDING: f32 = 2e-3;

/// A hand that stands so long has met something; a minimum jerk is slow at its beginning, but not for so long.
const STILL: Duration = Duration::from_millis(800);

/// Longest time that a plan of the hand goes on after every digit was seen [`NEAR`] its end: the last eighth of the
/// longest one, which takes 3.05 s.
const TAIL: Duration = Duration::from_millis(500);

/// Longest plan of the hand, from stop to stop.
const LONGEST_PLAN: Duration = Duration::from_millis(3200);

/// Result of a move of the hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum HandReach {
    /// Every digit is at its target.
    Reached,
    /// The hand stands elsewhere: it has closed on something. Spread and fingers F1 to F3, rad.
    Stopped([f32; 4]),
}

/// Initialises the hand if there is one that needs it; gives its stage: ready, or absent.
///
/// The fingers move to their stops. Ask a person first. An arm without torque holds its pose before: it would sink in
/// the seconds this takes.
///
/// # Errors
/// [`ProcedureError::Hand`] if it fails, and as [`Client::request`].
pub fn initialise_hand(client: &mut Client<Device>) -> Result<HandStage, ProcedureError> {
    match client.status()?.hand_stage {
        stage @ (HandStage::Absent | HandStage::Ready) => Ok(stage),
        HandStage::Initialising => initialised(client),
        HandStage::NotInitialised | HandStage::Failed => initialise_hand_anew(client),
    }
}

/// The same of a hand in any stage: one that is ready counts from its open stops anew.
///
/// # Errors
/// As [`initialise_hand`].
pub fn initialise_hand_anew(client: &mut Client<Device>) -> Result<HandStage, ProcedureError> {
    if State::from_code(client.status()?.state) == Some(State::Idle) {
        client.hold()?;
    }
    client.initialise_hand()?;
    initialised(client)
}

/// Waits for the end of an initialisation that was begun.
fn initialised(client: &mut Client<Device>) -> Result<HandStage, ProcedureError> {
    let deadline = client.now() + Duration::from_secs(INITIALISATION);
    let mut cause = None;
    loop {
        look(client, &mut cause)?;
        match client.status()?.hand_stage {
            HandStage::Ready => return Ok(HandStage::Ready),
            HandStage::Absent => return Err(ProcedureError::Hand("a puck of it does not answer any more")),
            HandStage::Failed => {
                if let Some((node, failure)) = cause {
                    return Err(ProcedureError::HandPuck { node, failure });
                }
                return Err(ProcedureError::Hand("a finger did not come to its stop, or a puck fell silent"));
            }
            HandStage::NotInitialised => return Err(ProcedureError::Hand("its initialisation was stopped")),
            HandStage::Initialising if client.now() > deadline => {
                return Err(ProcedureError::TooLong { what: "initialising the hand", seconds: INITIALISATION });
            }
            HandStage::Initialising => {}
        }
    }
}

/// Lets a look's time pass, and keeps the puck and the reason for which the device gives the hand up.
fn look(client: &mut Client<Device>, cause: &mut Option<(Node, HandFailure)>) -> Result<(), ProcedureError> {
    let end = client.now() + LOOK;
    while client.now() < end {
        let Some(Incoming::Event(event)) = client.next(end.saturating_sub(client.now()))? else { continue };
        match event.kind {
            EventKind::State if event.detail != 0 => after(event.code, event.detail)?,
            EventKind::Hand => *cause = HandFailure::from_number(event.detail).or(*cause),
            _ => {}
        }
    }
    Ok(())
}

/// The angles of a hand that counts them: one that is lost in a move tells zeros, and has met nothing. Nor has one that
/// somebody has stopped.
fn angles(client: &mut Client<Device>) -> Result<[f32; 4], ProcedureError> {
    let status = client.status()?;
    // A move is possible in Gravity, which ends others.
    if State::from_code(status.state) != Some(State::Gravity) {
        after(status.state.into(), status.fault.into())?;
    }
    if status.hand_stage == HandStage::Ready { Ok(status.hand) } else { Err(ProcedureError::HandLost) }
}

/// Moves the hand to `q` (spread, F1, F2, F3; rad) and waits until it stands there or at something it has met. The
/// device may then have a little of its plan before it.
///
/// # Errors
/// The device refuses, for example without torque, the hand does not come to rest, or it is lost or stopped meanwhile.
pub fn move_hand(client: &mut Client<Device>, q: [f32; 4]) -> Result<HandReach, ProcedureError> {
    client.move_hand(q, 0.0)?;
    let started = client.now();
    let (mut last, mut moved) = (angles(client)?, started);
    loop {
        pass(client, LOOK, EndCondition::OnFault)?;
        let hand = angles(client)?;
        let distance = |to: &[f32; 4]| hand.iter().zip(to).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        if distance(&q) < NEAR {
            return Ok(HandReach::Reached);
        }
        if distance(&last) > STANDING {
            (last, moved) = (hand, client.now());
        } else if client.now().saturating_sub(moved) > STILL {
            return Ok(HandReach::Stopped(hand));
        }
        if client.now().saturating_sub(started) > Duration::from_secs(LONGEST_MOVE) {
            return Err(ProcedureError::TooLong { what: "moving the hand", seconds: LONGEST_MOVE });
        }
    }
}

/// As [`move_hand`], and waits until the device has come to the end of its plan: a host that leaves before is taken for
/// one that has died in a motion, and the arm is stopped.
///
/// # Errors
/// As [`move_hand`].
pub fn move_hand_to_the_end(client: &mut Client<Device>, q: [f32; 4]) -> Result<HandReach, ProcedureError> {
    let started = client.now();
    let reach = move_hand(client, q)?;
    let rest = match reach {
        HandReach::Reached => TAIL,
        HandReach::Stopped(_) => (started + LONGEST_PLAN).saturating_sub(client.now()),
    };
    pass(client, rest, EndCondition::OnFault)?;
    angles(client)?;
    Ok(reach)
}
