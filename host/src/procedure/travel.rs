//! Waiting for motions to end.

use std::time::Duration;

use control::{Fault, State};
use link::EventKind;

use super::ProcedureError;
use crate::client::{Client, Incoming};
use crate::device::Device;

/// Longest move to a posture, s: what `control` allows.
const LONGEST_TRAVEL: u64 = 125;

/// How long an arm that has just got its torque holds still before it moves. Whoever held it until then lets go: a hand that still does
/// would be worked against, and the torque for that would be too much a moment later.
const LET_GO: Duration = Duration::from_secs(1);

/// Moves the joints to `q` (rad) and waits until the arm holds there. `progress` hears the time since the start, s.
///
/// # Errors
/// [`ProcedureError`]: the device refuses, the arm stops by itself, or it takes too long.
pub fn travel(client: &mut Client<Device>, q: [f32; 7], progress: impl FnMut(f64)) -> Result<(), ProcedureError> {
    // Torque begins with holding: from rest the arm must first carry itself before it may move.
    if State::from_code(client.status()?.state) != Some(State::Hold) {
        client.hold()?;
        pass(client, LET_GO)?;
    }
    client.take_events();
    client.approach(q, 0.0)?;
    wait_for("the move to the posture", LONGEST_TRAVEL, client, progress)
}

/// Waits until a motion that was just commanded has arrived.
///
/// # Errors
/// As [`travel`].
pub fn wait_for(
    what: &'static str,
    seconds: u64,
    client: &mut Client<Device>,
    mut progress: impl FnMut(f64),
) -> Result<(), ProcedureError> {
    let started = client.now();
    loop {
        let passed = client.now().saturating_sub(started);
        if passed > Duration::from_secs(seconds) {
            client.stop()?;
            return Err(ProcedureError::TooLong { what, seconds });
        }
        progress(passed.as_secs_f64());
        let Some(Incoming::Event(event)) = client.next(Duration::from_millis(100))? else {
            continue;
        };
        match event.kind {
            EventKind::Arrived => return Ok(()),
            EventKind::State => after(event.code, event.detail)?,
            _ => {}
        }
    }
}

/// Lets time pass; the arm must not leave its state meanwhile.
fn pass(client: &mut Client<Device>, time: Duration) -> Result<(), ProcedureError> {
    let end = client.now() + time;
    while client.now() < end {
        if let Some(Incoming::Event(event)) = client.next(end.saturating_sub(client.now()))?
            && event.kind == EventKind::State
        {
            after(event.code, event.detail)?;
        }
    }
    Ok(())
}

/// Whether a state entered during a motion ends it.
pub fn after(code: u16, detail: u32) -> Result<(), ProcedureError> {
    let state = u8::try_from(code).ok().and_then(State::from_code);
    let fault = u8::try_from(detail).ok().and_then(Fault::from_code).unwrap_or(Fault::None);
    match state {
        Some(State::Idle | State::SoftStop | State::Fault) if fault != Fault::None => {
            Err(ProcedureError::Stopped(fault))
        }
        Some(state @ (State::Idle | State::SoftStop | State::Fault | State::Gravity)) => {
            Err(ProcedureError::Diverted(state.name()))
        }
        _ => Ok(()),
    }
}
