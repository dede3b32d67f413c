//! From power-up to an arm that can be commanded.

use std::time::Duration;

use control::{Fault, State};
use device::{Stage, StoreError};
use link::{HomeSource, Refusal};

use super::{ProcedureError, initialise_hand};
use crate::client::Client;
use crate::device::Device;
use crate::error::{HostError, explain_blocked};

/// Longest simulated start-up, s of virtual time; it takes about four.
const SIMULATED_TIMEOUT: u64 = 30;

/// Time that people get to reach the pendant, s.
const TIMEOUT: u64 = 600;

/// Period at which the stage is polled.
const LOOK: Duration = Duration::from_millis(50);

/// For how many control cycles an arm that is ready is left alone until its wrench has a zero: 5 s of the device's
/// time. The device takes its first rest, 0.3 s, for it, and only while nothing has been commanded; mostly it has
/// rested before it was activated.
const FIRST_REST: u32 = 1500;

/// Result of a start-up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Readiness {
    /// True if the wrench has a zero; `None` without a force/torque sensor.
    pub wrench_zeroed: Option<bool>,
    /// Whose home the arm was zeroed at; `None` if it had been zeroed before.
    pub zeroed_at: Option<HomeSource>,
}

/// One look at a start-up. It is told where it differs from the one before.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StartupLook {
    /// Stage that the start-up has reached.
    pub stage: Stage,
    /// Why it cannot go on, at [`Stage::Blocked`].
    pub blocked: Option<String>,
}

impl StartupLook {
    /// The look in words.
    #[must_use]
    pub fn explanation(&self) -> String {
        let stage = self.stage.explanation();
        self.blocked.as_ref().map_or_else(|| stage.to_owned(), |reason| format!("{stage}: {reason}"))
    }
}

/// Waits until the arm can be commanded, tells every stage, and initialises the hand where there is one.
///
/// A simulated arm stands at home when it is switched on, so it is zeroed there; which home that is the device knows.
/// For a real one, and for any whose zero was lost, `at_home` must come from a person.
///
/// # Errors
/// [`ProcedureError::NotZeroed`] if nobody vouches for the pose; [`ProcedureError::Faulted`] if a fault is to be
/// cleared before the arm is activated; [`ProcedureError::NotReady`] when the start-up is blocked for longer than
/// people need.
pub fn make_ready(
    client: &mut Client<Device>,
    at_home: bool,
    tell: impl FnMut(&StartupLook),
) -> Result<Readiness, ProcedureError> {
    let readiness = start_up(client, at_home, Stage::Ready, tell)?;
    initialise_hand(client)?;
    Ok(readiness)
}

/// Waits until the start-up has come as far as `goal`, and zeroes the arm on the way; nothing is commanded. An arm
/// that gets ready is left alone until its wrench has a zero, as far as one comes.
///
/// # Errors
/// As [`make_ready`].
pub fn start_up(
    client: &mut Client<Device>,
    at_home: bool,
    goal: Stage,
    mut tell: impl FnMut(&StartupLook),
) -> Result<Readiness, ProcedureError> {
    let simulated = client.is_simulated();
    let seconds = if simulated { SIMULATED_TIMEOUT } else { TIMEOUT };
    let deadline = client.now() + Duration::from_secs(seconds);
    let mut readiness = Readiness::default();
    let mut told: Option<StartupLook> = None;
    let mut ready_since = None;
    loop {
        let status = client.status()?;
        let stage = Stage::from_code(status.startup_stage);
        if let Some(stage) = stage {
            let blocked = status.blocked.filter(|_| stage == Stage::Blocked).map(explain_blocked);
            let look = StartupLook { stage, blocked };
            if told.as_ref() != Some(&look) {
                tell(&look);
                told = Some(look);
            }
        }
        // One that has lost its zero, for a reason, lies wherever it sank to.
        let stands_at_home = simulated && status.blocked.is_none();
        match stage {
            Some(Stage::Ready) => {
                let since = *ready_since.get_or_insert(status.cycle);
                let idle = State::from_code(status.state) == Some(State::Idle);
                let may_come = idle && status.cycle.wrapping_sub(since) < FIRST_REST;
                if status.wrench_zeroed != Some(false) || !may_come {
                    return Ok(Readiness { wrench_zeroed: status.wrench_zeroed, ..readiness });
                }
            }
            Some(Stage::WaitingForActive) if goal == Stage::WaitingForActive => {
                return Ok(Readiness { wrench_zeroed: status.wrench_zeroed, ..readiness });
            }
            // A device under a fault asks for the brakes again as soon as it is activated.
            Some(Stage::WaitingForActive) => refuse_fault(status.fault)?,
            // A person's word holds once: an arm that has lost its zero since may stand elsewhere.
            Some(Stage::WaitingForZero) if stands_at_home || (at_home && readiness.zeroed_at.is_none()) => {
                readiness.zeroed_at = zero(client)?.or(readiness.zeroed_at);
            }
            Some(Stage::WaitingForZero) => return Err(ProcedureError::NotZeroed),
            _ => {}
        }
        if client.now() > deadline {
            let stage = told.map_or("unknown stage", |look| look.stage.explanation());
            let blocked = status.blocked.map(explain_blocked);
            return Err(ProcedureError::NotReady(blocked.unwrap_or_else(|| stage.to_owned())));
        }
        client.next(LOOK)?;
    }
}

/// The fault that a person has to clear before the arm is activated. Activating ends what the pendant took, and a
/// start-up that finds another payload goes on by itself.
fn refuse_fault(code: u8) -> Result<(), ProcedureError> {
    match Fault::from_code(code) {
        None | Some(Fault::None | Fault::SafetyDropped | Fault::OtherPayload) => Ok(()),
        Some(fault) => Err(ProcedureError::Faulted(fault)),
    }
}

/// Zeroes the arm at the home that the device knows, and tells whose that is; `None`: the device is still reading its
/// storage.
fn zero(client: &mut Client<Device>) -> Result<Option<HomeSource>, ProcedureError> {
    let busy = StoreError::Busy.code();
    match client.calibration() {
        Ok(calibration) => {
            client.zero(calibration.home)?;
            Ok(Some(calibration.source))
        }
        Err(HostError::Refused { reason: Refusal::StoreFailed, detail: [code, _], .. }) if code == busy => Ok(None),
        Err(error) => Err(error.into()),
    }
}
