//! From power-up to an arm that can be commanded.

use std::time::Duration;

use control::State;
use device::Stage;
use link::EventKind;

use super::{ProcedureError, initialise_hand};
use crate::client::{Client, Incoming};
use crate::device::Device;
use crate::error::explain_blocked;

/// How long a simulated start-up may take, s of virtual time; it takes about four.
const SIMULATED_PATIENCE: u64 = 30;

/// How long people get to reach the pendant, s.
const PATIENCE: u64 = 600;

/// How often the stage is looked at.
const LOOK: Duration = Duration::from_millis(50);

/// How long an arm that is ready is left alone: the device takes its first rest, 0.3 s, for the zero of its sensors, and takes it only
/// while nothing has been commanded.
const FIRST_REST: Duration = Duration::from_millis(500);

/// Waits until the arm can be commanded, tells every stage, and initialises the hand where there is one.
///
/// A simulated arm stands at home, so it is zeroed there. For a real one `at_home` must be the word of a person.
///
/// # Errors
/// [`ProcedureError::NotZeroed`] if nobody vouches for the pose; [`ProcedureError::NotReady`] when the start-up is blocked for
/// longer than people need.
pub fn make_ready(
    client: &mut Client<Device>,
    at_home: bool,
    mut tell: impl FnMut(Stage),
) -> Result<(), ProcedureError> {
    let simulated = client.hello().simulated;
    let seconds = if simulated { SIMULATED_PATIENCE } else { PATIENCE };
    let deadline = client.now() + Duration::from_secs(seconds);
    let mut told = None;
    let mut blocked = None;
    loop {
        let status = client.status()?;
        let stage = Stage::from_code(status.startup_stage);
        if let Some(stage) = stage.filter(|_| stage != told) {
            tell(stage);
            told = Some(stage);
        }
        match stage {
            Some(Stage::Ready) => {
                if State::from_code(status.state) == Some(State::Idle) {
                    leave_alone(client, FIRST_REST)?;
                }
                return initialise_hand(client).map(|_| ());
            }
            Some(Stage::WaitingForZero) if simulated || at_home => client.zero(home())?,
            Some(Stage::WaitingForZero) => return Err(ProcedureError::NotZeroed),
            _ => {}
        }
        if client.now() > deadline {
            let stage = told.map_or("unknown stage", Stage::explanation);
            return Err(ProcedureError::NotReady(blocked.unwrap_or_else(|| stage.to_owned())));
        }
        if let Some(Incoming::Event(event)) = client.next(LOOK)?
            && event.kind == EventKind::Startup
            && event.code == u16::from(Stage::Blocked.code())
        {
            blocked = Some(explain_blocked([event.detail, 0]));
        }
    }
}

/// Lets the device's time pass.
fn leave_alone(client: &mut Client<Device>, time: Duration) -> Result<(), ProcedureError> {
    let until = client.now() + time;
    while client.now() < until {
        client.next(until.saturating_sub(client.now()))?;
    }
    Ok(())
}

/// The home posture of the model, rad.
fn home() -> [f32; 7] {
    control::model::HOME.map(|angle| angle as f32)
}
