//! The way out to the bus in one slot: counts every frame and keeps the pauses.

use puck::CanFrame;

use crate::application::ControllerIo;
use crate::bus::{Outlet, Pacer};
use crate::controller::DeviceController;
use crate::health::Counters;

/// The outlet of one slot.
pub(crate) struct SlotOutlet<'a, I: ControllerIo<DeviceController>> {
    pub(crate) io: &'a mut I,
    pub(crate) counters: &'a mut Counters,
    pub(crate) pacer: &'a mut Pacer,
    pub(crate) now_us: u64,
    /// The cyclic loop sends several frames per slot; there only the pauses of the safety module hold.
    pub(crate) cyclic: bool,
}

impl<I: ControllerIo<DeviceController>> Outlet for SlotOutlet<'_, I> {
    fn now_us(&self) -> u64 {
        self.now_us
    }

    fn send(&mut self, frame: CanFrame) -> bool {
        let permitted = if self.cyclic {
            self.pacer.permits_in_cycle(&frame, self.now_us)
        } else {
            self.pacer.permits(&frame, self.now_us)
        };
        if !permitted {
            return false;
        }
        let sent = self.io.transmit(frame);
        if sent {
            self.pacer.note(&frame, self.now_us);
            Counters::count(&mut self.counters.frames_sent);
        } else {
            Counters::count(&mut self.counters.frames_refused);
        }
        sent
    }
}
