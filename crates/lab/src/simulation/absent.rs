//! The engine of a bus without co-controller: virtual time passes, and nobody hears what the arm says.

use sim::{Plant, Ticks};

use super::{Execute, SimulationError};

/// Nobody at the co-controller's end of the bus.
pub(super) struct Absent;

impl Execute for Absent {
    fn advance(&mut self, plant: &mut Plant, limit: Ticks) -> Result<Ticks, SimulationError> {
        match plant.next_event() {
            // What is not taken would be kept for ever.
            Some(at) if at <= limit => drop(plant.event(at)),
            _ => plant.advance(limit),
        }
        Ok(plant.now())
    }
}
