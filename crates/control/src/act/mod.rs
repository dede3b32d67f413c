//! From the torque that is wanted to frames: limits, then packing.

pub mod actuation;
pub mod hand;
pub mod limit;

pub use actuation::Actuation;
pub use hand::{HandLimiter, LimitedHandTorques};
pub use limit::{LimitedTorques, TorqueLimiter};
