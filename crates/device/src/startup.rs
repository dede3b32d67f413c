//! The start of the bus: from power-up to a cyclic loop, as a state machine that sends at most one frame per slot.
//!
//! Nothing here sends a torque other than zero, wakes or zeroes a puck while the safety module is ACTIVE, or goes on
//! after a device has said something unexpected. After a failure it rests for a second and begins anew.

mod exchange;
mod hand;
mod home;
mod pace;
mod sequence;
mod stage;
mod survey;
mod waking;
mod zeroing;

pub use exchange::{Answer, Exchange};
pub(crate) use pace::Pacer;
pub(crate) use sequence::Startup;
pub use stage::{Stage, StartupError};
pub(crate) use survey::SafetyProperties;
