//! The controllers: Eq (11) in [`operational`], Eq (10) in [`joint`], Eq (12) in [`force`]; their sum is Eq (13). Beside
//! them [`integral`], for the postures that are held.

pub mod force;
pub mod gains;
pub mod integral;
pub mod joint;
pub mod joint_limits;
pub mod operational;
pub mod window;

pub use force::ForceController;
pub use gains::{Gains, HandGains, Tracking};
pub use integral::PostureIntegral;
pub use joint::{JointController, JointReference};
pub use joint_limits::JointBounds;
pub use operational::{OperationalController, TaskReference};
pub use window::Window;
