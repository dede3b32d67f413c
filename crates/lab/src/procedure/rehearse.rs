//! Playing a primitive once from its start posture: what a rehearsal is made of.

use link::{Name, RunOptions, Telemetry};

use super::run::{RunOutcome, RunRequest, play};
use super::travel::go_to_start;
use super::{ProcedureError, recording_text};
use crate::client::Client;
use crate::device::Device;
use crate::primitive_file::PrimitiveFile;
use crate::transport::TransportError;

/// Goes to the start of a primitive that the device holds and plays it; returns the recording as text with `notes`
/// above it. `progress` hears the number of samples.
///
/// # Errors
/// As [`go_to_start`] and [`play`]; the primitive's name is none that a device takes.
pub fn play_once(
    client: &mut Client<Device>,
    movement: &PrimitiveFile,
    options: RunOptions,
    notes: &str,
    progress: &mut dyn FnMut(usize),
) -> Result<(Vec<u8>, RunOutcome), ProcedureError> {
    let name = Name::new(&movement.name).map_err(|error| TransportError::other(error.to_string()))?;
    go_to_start(client, &movement.start, |_| {})?;
    let mut cycles: Vec<Telemetry> = Vec::new();
    let outcome = play(client, &RunRequest::new(name, movement.movement.duration, options), &mut |cycle| {
        cycles.push(*cycle);
        progress(cycles.len());
    })?;
    Ok((recording_text(&cycles, notes)?, outcome))
}
