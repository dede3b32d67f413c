//! Frames of the simulated bus, read with the device side of the protocol.

use puck::{Action, Group, PropertyId, Request};
use sim::{Passage, Ticks};

pub use lab::simulation::CYCLE_TICKS;

/// The starts of all position requests to the whole arm.
#[must_use]
pub fn position_requests(frames: &[Passage]) -> Vec<Ticks> {
    frames
        .iter()
        .filter(|passage| {
            Request::decode(&passage.frame).is_ok_and(|request| {
                request.to == Group::ARM.into() && request.action == Action::Get { property: PropertyId::POSITION }
            })
        })
        .map(|passage| passage.start)
        .collect()
}

/// The torques of every packed frame, in units of the pucks, with the start of the frame.
#[must_use]
pub fn torques(frames: &[Passage]) -> Vec<(Ticks, [i16; 4])> {
    frames
        .iter()
        .filter_map(|passage| match Request::decode(&passage.frame).ok()?.action {
            Action::PackedTorques { torques, .. } => Some((passage.start, torques.map(|torque| torque.units()))),
            _ => None,
        })
        .collect()
}
