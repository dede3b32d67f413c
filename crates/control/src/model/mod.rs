//! The arm before anything is measured: its numbers, kinematics, dynamics, and what is mounted on it.

pub mod arm;
pub mod calibration;
pub mod dynamics;
pub(crate) mod friction;
pub mod hand;
pub mod kinematics;
pub(crate) mod mass_matrix;
mod redundancy;
pub mod wam7;
pub mod weight;

pub use arm::ArmModel;
pub use calibration::{Calibration, CalibrationError, Payload};
pub use kinematics::{Frames, Jacobian};
pub use wam7::*;
pub use weight::{LinkWeight, MASS_SHARE, MOMENT_SHIFT, WeightCorrection, WeightError, WeightFault};
