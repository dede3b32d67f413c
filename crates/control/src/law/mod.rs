//! The controllers: Eq (11) in [`operational`], Eq (10) in [`joint`], Eq (12) in [`force`]; their sum is Eq (13).
//! Beside them [`integral`], for the postures that are held, and Eq (14) in [`hand`].

pub(crate) mod breakaway;
pub mod force;
pub mod gains;
pub mod hand;
pub mod integral;
pub mod joint;
pub mod operational;
pub mod settling;
pub mod soft_limits;
pub(crate) mod spring;
pub mod support;
pub mod window;

pub use force::ForceController;
pub use gains::{Gains, HandGains, Tracking};
pub use hand::HandController;
pub use integral::PostureIntegral;
pub use joint::JointController;
pub use operational::OperationalController;
pub use settling::Settling;
pub use soft_limits::SoftLimits;
pub use support::Support;
pub use window::Window;
