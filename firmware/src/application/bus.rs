//! Frames between the controller and the core.

use embedded_can::nb::Can;
use heapless::spsc::{Consumer, Producer};
use puck::CanFrame;
use rtic_core::Mutex;

use crate::meters::Meters;

/// The controller holds received frames.
pub struct ReceiveTask {
    incoming: Producer<'static, CanFrame>,
}

impl ReceiveTask {
    /// Puts them into this queue.
    pub fn new(incoming: Producer<'static, CanFrame>) -> Self {
        Self { incoming }
    }

    /// Fetches all of them.
    pub fn run<C: Can<Frame = CanFrame>>(&mut self, mut can: impl Mutex<T = C>, meters: &Meters) {
        while let Ok(frame) = can.lock(|can| can.receive()) {
            if self.incoming.enqueue(frame).is_err() {
                meters.frame_dropped();
            }
        }
    }
}

/// The controller has room, or there is a frame for it.
pub struct TransmitTask {
    outgoing: Consumer<'static, CanFrame>,
}

impl TransmitTask {
    /// Takes them from this queue.
    pub fn new(outgoing: Consumer<'static, CanFrame>) -> Self {
        Self { outgoing }
    }

    /// Hands over as many as the controller takes; it interrupts again when it has room for more.
    pub fn run<C: Can<Frame = CanFrame>>(&mut self, mut can: impl Mutex<T = C>) {
        while let Some(frame) = self.outgoing.peek() {
            if can.lock(|can| can.transmit(frame)).is_err() {
                break;
            }
            self.outgoing.dequeue();
        }
    }
}
