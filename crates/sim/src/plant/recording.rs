//! Frames that are kept: as they were sent, or as the others had them.

use super::Plant;
use crate::wire::Passage;

impl Plant {
    /// Keeps every frame from now on.
    pub fn record_bus(&mut self) {
        self.bus.record();
    }

    /// The frames kept since [`Plant::record_bus`].
    #[must_use]
    pub fn recorded(&self) -> &[Passage] {
        self.bus.recorded()
    }

    /// Takes out the frames kept since [`Plant::record_bus`] or the last call; the last one may still be on the wire.
    pub fn take_recorded(&mut self) -> Vec<Passage> {
        self.bus.take_recorded()
    }

    /// Keeps every frame from now on as a log has it: those of the co-controller as it sent them, all others as they
    /// were received, where a fault lost, changed or delayed them.
    pub fn record_heard(&mut self) {
        self.bus.record_heard();
    }

    /// Takes out the frames kept since [`Plant::record_heard`] or the last call.
    pub fn take_heard(&mut self) -> Vec<Passage> {
        self.bus.take_heard()
    }
}
