//! Frames of the simulated bus, read with the device side of the protocol.

use puck::{Action, Group, PropertyId, Request};
use sim::{Passage, Ticks};

pub use lab::simulation::CYCLE_TICKS;

use crate::{Arm, simulation};

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

/// Spread of the starts of the torque frames of these cycles, ticks: latest minus earliest place in the cycle.
#[must_use]
pub fn torque_jitter(starts: &[u64]) -> u64 {
    let places: Vec<u64> = starts.iter().map(|start| start % CYCLE_TICKS).collect();
    places.iter().max().zip(places.iter().min()).map_or(0, |(most, least)| most - least)
}

/// Starts of the torque frames to the arm (the first of two) between two virtual times.
///
/// # Panics
/// The device is not simulated.
pub fn arm_torques(arm: &mut Arm, from: u64, until: u64) -> Vec<u64> {
    let all = torques(simulation(arm.transport()).plant().recorded());
    let mut starts: Vec<u64> =
        all.into_iter().map(|(start, _)| start).filter(|at| (from..until).contains(at)).collect();
    // Arm, wrist, perhaps hand: the first of each cycle counts.
    starts.dedup_by_key(|start| *start / CYCLE_TICKS);
    starts
}
