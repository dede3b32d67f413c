//! Recording a demonstration: the arm is weightless, and a person, or the simulated teacher, guides it.

use std::io::Write;

use control::{Fault, State};

use super::ProcedureError;
use super::recorder::{Recorder, Take};
use crate::client::Client;
use crate::device::Device;

/// A demonstration that was recorded.
#[derive(Debug)]
pub struct Demonstrated<W> {
    /// Where the recording went.
    pub output: W,
    /// Samples in it.
    pub samples: usize,
    /// Time that it covers, s, with the samples that were lost on the line.
    pub seconds: f64,
    /// True if the movement came to its end, false if the time was over before.
    pub is_complete: bool,
}

/// Records until the movement is shown, and `post_roll` s of rest after it; at most `limit` s. `is_shown` is asked
/// after every sample and hears how long the recording is, s.
///
/// # Errors
/// [`ProcedureError::Stopped`] when the arm leaves gravity compensation, and as [`Recorder::take`].
pub fn record_demonstration<W: Write>(
    client: &mut Client<Device>,
    mut recorder: Recorder<W>,
    limit: f64,
    post_roll: f64,
    mut is_shown: impl FnMut(&mut Client<Device>, f64) -> bool,
) -> Result<Demonstrated<W>, ProcedureError> {
    let mut end = None;
    loop {
        let Take::Cycle(telemetry) = recorder.take(client)? else { continue };
        // A lost reply of a motor is bridged, and the person leads on.
        if !matches!(State::from_code(telemetry.state), Some(State::Gravity | State::Coast)) {
            return Err(ProcedureError::Stopped(Fault::from_code(telemetry.fault).unwrap_or(Fault::None)));
        }
        let seconds = recorder.seconds();
        if is_shown(client, seconds) && end.is_none() {
            end = Some(seconds + post_roll);
        }
        if seconds >= end.unwrap_or(limit).min(limit) {
            break;
        }
    }
    let (samples, seconds) = (recorder.rows(), recorder.seconds());
    Ok(Demonstrated { output: recorder.finish(client)?, samples, seconds, is_complete: end.is_some() })
}

/// The simulated teacher beside an arm in the MuJoCo world.
pub mod teacher {
    #[cfg(feature = "mujoco")]
    use sim::teacher::{GuidedWorld, Stage};
    #[cfg(feature = "mujoco")]
    use sim::world::mujoco::MujocoWorld;

    use super::{Client, Device};

    /// The world of a device that has a simulated teacher.
    #[cfg(feature = "mujoco")]
    fn guided(client: &mut Client<Device>) -> Option<&mut GuidedWorld<MujocoWorld>> {
        let world: &mut dyn std::any::Any = client.transport().simulation()?.world();
        world.downcast_mut()
    }

    /// True if a simulated teacher stands beside the arm.
    pub fn is_present(client: &mut Client<Device>) -> bool {
        #[cfg(feature = "mujoco")]
        return guided(client).is_some();
        #[cfg(not(feature = "mujoco"))]
        {
            let _ = client;
            false
        }
    }

    /// Tells the teacher to begin; false if there is none.
    pub fn begin(client: &mut Client<Device>) -> bool {
        #[cfg(feature = "mujoco")]
        if let Some(world) = guided(client) {
            world.teacher_mut().begin();
            return true;
        }
        let _ = client;
        false
    }

    /// True once the teacher has let go of the hand at the end of the movement.
    pub fn has_finished(client: &mut Client<Device>) -> bool {
        #[cfg(feature = "mujoco")]
        return guided(client).is_some_and(|world| world.teacher().stage() == Stage::Done);
        #[cfg(not(feature = "mujoco"))]
        {
            let _ = client;
            false
        }
    }
}
