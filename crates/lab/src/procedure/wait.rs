//! Waiting while a device works: for the end of a motion, or for a time.

use std::time::Duration;

use control::{Fault, State};
use link::EventKind;

use super::ProcedureError;
use crate::client::{Client, Incoming};
use crate::device::Device;

/// The changes of state that end a wait.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EndCondition {
    /// Every state in which the arm no longer does what it was told.
    OnAnyStop,
    /// A fault only: the arm may go from state to state meanwhile.
    OnFault,
}

/// Lets `time` pass. Telemetry of that time is dropped.
///
/// # Errors
/// [`ProcedureError::Stopped`] or [`ProcedureError::Diverted`] when the arm leaves its state in a way that ends the
/// wait.
pub fn pass(client: &mut Client<Device>, time: Duration, condition: EndCondition) -> Result<(), ProcedureError> {
    let end = client.now() + time;
    while client.now() < end {
        if let Some(Incoming::Event(event)) = client.next(end.saturating_sub(client.now()))?
            && event.kind == EventKind::State
            && (condition == EndCondition::OnAnyStop || event.detail != 0)
        {
            after(event.code, event.detail)?;
        }
    }
    Ok(())
}

/// A motion of whose end nothing is heard is looked at so often: the event may have been lost on the line.
const LOOK: Duration = Duration::from_secs(5);

/// Waits until a motion that was just commanded has arrived.
///
/// # Errors
/// As [`super::travel`].
pub fn wait_for(
    what: &'static str,
    seconds: u64,
    client: &mut Client<Device>,
    mut progress: impl FnMut(f64),
) -> Result<(), ProcedureError> {
    let started = client.now();
    let mut look_at = started + LOOK;
    loop {
        let passed = client.now().saturating_sub(started);
        if passed > Duration::from_secs(seconds) {
            client.stop()?;
            return Err(ProcedureError::TooLong { what, seconds });
        }
        progress(passed.as_secs_f64());
        if client.now() >= look_at {
            look_at = client.now() + LOOK;
            let status = client.status()?;
            if State::from_code(status.state) == Some(State::Hold) {
                return Ok(());
            }
            after(status.state.into(), status.fault.into())?;
        }
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

/// True if a state entered during a motion ends it.
pub fn after(code: u16, detail: u32) -> Result<(), ProcedureError> {
    let state = u8::try_from(code).ok().and_then(State::from_code);
    let fault = u8::try_from(detail).ok().and_then(Fault::from_code).unwrap_or(Fault::None);
    match state {
        Some(State::Idle | State::SoftStop | State::Lower | State::Fault) if fault != Fault::None => {
            Err(ProcedureError::Stopped(fault))
        }
        Some(state @ (State::Idle | State::SoftStop | State::Lower | State::Fault | State::Gravity)) => {
            Err(ProcedureError::Diverted(state.name()))
        }
        _ => Ok(()),
    }
}
