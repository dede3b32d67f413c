//! From the replies of the bus to what is known: joints, wrench, hand, and how they deviate from what is expected.

mod correction;
pub mod deviation;
pub mod drift;
pub mod filter;
pub mod hand;
pub mod joints;
pub mod leisure;
mod mass;
pub mod observer;
pub mod sample;
pub mod swing;
pub mod wrench;

pub use deviation::Deviation;
pub use drift::Drift;
pub use hand::{HandEstimator, HandState};
pub use joints::{JointEstimator, JointState};
pub use observer::MotionObserver;
pub use sample::{BusSample, HandSample};
pub use swing::Swings;
pub use wrench::WrenchEstimator;
