//! Words for people, as defmt frames; where they go is the board's business.

use device::Event;
use device::storage::Opening;

use crate::application::Log;

/// The log of the images.
#[derive(Clone, Copy, Debug, Default)]
pub struct DefmtLog;

impl Log for DefmtLog {
    fn event(&mut self, event: &Event) {
        defmt::info!("cycle {=u64}: {}", event.cycle, defmt::Debug2Format(&event.kind));
    }

    fn lost(&mut self, count: u32) {
        defmt::warn!("{=u32} frames or events lost between the tasks", count);
    }

    fn storage(&mut self, opening: &Opening) {
        if opening.failed {
            defmt::error!("{}", defmt::Display2Format(opening));
        } else {
            defmt::info!("{}", defmt::Display2Format(opening));
        }
    }
}
