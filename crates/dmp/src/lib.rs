#![no_std]
#![forbid(unsafe_code)]
#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "`!(x > 0)` also refuses NaN, which `x <= 0` would let through")]
#![cfg_attr(feature = "std", doc = include_str!("../README.md"))]
#![cfg_attr(
    not(feature = "std"),
    doc = "Dynamic movement primitives for any robot, without the fitting: see the README."
)]

#[cfg(feature = "std")]
extern crate std;

pub mod bounds;
mod configuration;
mod coupling;
mod expected_sensors;
mod forcing;
mod gains;
mod log_map;
mod orientation;
mod orientation_rows;
mod phase;
mod point_rows;
mod primitive;
mod primitive_error;
mod quaternion;
mod reference;
mod rollout;
mod rollout_error;
mod scalar;
mod sensor_statistics;
mod table;
mod time_scale;
mod transformation;
mod vector;

#[cfg(feature = "std")]
pub mod fit;

pub use configuration::{Configuration, Pose, Twist, Velocity};
pub use coupling::{Coupling, CouplingGains, DisplacementLimits, PoseCoupling, PoseLimits};
pub use expected_sensors::ExpectedSensors;
pub use forcing::{Activations, Basis, ForcingTerm};
pub use gains::{Gain, Gains, PoseGains, Stiffness};
pub use log_map::LogMap;
pub use orientation::{
    Hemisphere, OrientationError, OrientationInput, OrientationState, OrientationSystem, orientation_error,
};
pub use phase::{CanonicalSystem, Phase};
pub use primitive::{Primitive, PrimitiveTables};
pub use primitive_error::{Group, Part, PrimitiveError};
pub use quaternion::Quaternion;
pub use reference::{OrientationReference, PoseReference, Reference, Trajectory};
pub use rollout::{Rollout, StartState};
pub use rollout_error::RolloutError;
#[cfg(feature = "fixed")]
pub use scalar::FixedPoint;
pub use scalar::{Kernels, Scalar};
pub use sensor_statistics::SensorStatistics;
pub use table::{Entry, PhaseTable, TableError};
pub use transformation::{GainError, PointInput, PointState, TransformationSystem};
