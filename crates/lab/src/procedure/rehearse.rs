//! Playing a primitive once from its start posture: what a rehearsal is made of.

use link::{Name, RunOptions, Telemetry};

use super::ProcedureError;
use super::run::{RunOutcome, RunRequest, play};
use super::travel::go_to_start;
use crate::client::Client;
use crate::device::Device;
use crate::primitive_file::PrimitiveFile;
use crate::transport::TransportError;

/// Goes to the start of a primitive that the device holds and plays it. `on_cycle` hears every cycle as it comes.
///
/// # Errors
/// As [`go_to_start`] and [`play`]; the primitive's name is none that a device takes.
pub fn play_once(
    client: &mut Client<Device>,
    movement: &PrimitiveFile,
    options: RunOptions,
    on_cycle: &mut dyn FnMut(&Telemetry),
) -> Result<RunOutcome, ProcedureError> {
    let name = Name::new(&movement.name).map_err(|error| TransportError::other(error.to_string()))?;
    go_to_start(client, &movement.start, |_| {})?;
    play(client, &RunRequest::new(name, movement.movement.duration, options), on_cycle)
}
