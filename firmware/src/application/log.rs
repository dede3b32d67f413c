//! Tells people what happened.

use device::Event;
use device::storage::Opening;
use heapless::spsc::Consumer;

use crate::meters::Meters;

/// Where words for people go.
pub trait Log {
    /// The control half tells something.
    fn event(&mut self, event: &Event);

    /// So many frames and events have been lost between the tasks since start-up.
    fn lost(&mut self, count: u32);

    /// Tells the content of the storage at start-up.
    fn storage(&mut self, opening: &Opening);
}

/// The task that runs when there is something to tell.
pub struct LogTask {
    to_tell: Consumer<'static, Event>,
    told_dropped: u32,
}

impl LogTask {
    pub(super) fn new(to_tell: Consumer<'static, Event>) -> Self {
        Self { to_tell, told_dropped: 0 }
    }

    /// Tells everything there is.
    pub fn run(&mut self, meters: &Meters, log: &mut impl Log) {
        while let Some(event) = self.to_tell.dequeue() {
            log.event(&event);
        }
        let dropped = meters.dropped();
        if dropped != self.told_dropped {
            self.told_dropped = dropped;
            log.lost(dropped);
        }
    }
}
