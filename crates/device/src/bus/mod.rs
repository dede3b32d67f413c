//! The way out to the bus: where frames are sent, questions with their answers, and the pauses that devices need.

mod exchange;
mod pace;

use puck::CanFrame;

pub use exchange::{Answer, Exchange};
pub(crate) use pace::Pacer;

/// Where a frame is sent, at a moment of device time.
pub trait Outlet {
    /// Device time of this slot, us.
    fn now_us(&self) -> u64;
    /// Sends the frame, unless a pause is not over or the controller has no room. Whether it was sent.
    fn send(&mut self, frame: CanFrame) -> bool;
}
