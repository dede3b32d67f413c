#![no_std]
#![forbid(unsafe_code)]
#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "`!(x > 0)` also refuses NaN, which `x <= 0` would let through")]
#![doc = include_str!("../README.md")]

#[cfg(feature = "std")]
extern crate std;

pub mod bounds;
mod configuration;
mod coupling;
mod expected_sensors;
mod forcing;
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
mod scalar;
mod sensor_statistics;
mod table;
mod time_scale;
mod transformation;
mod vector;

#[cfg(feature = "std")]
pub mod fit;

pub use configuration::{Configuration, Velocity};
pub use coupling::{
    COUPLED_ROWS, Coupling, Feedback, GAIN_CAPACITY, GainSchedule, Limits, SENSORS, SensorMap, Stiffness,
};
pub use expected_sensors::{EXPECTED_CAPACITY, ExpectedWrench};
pub use forcing::{Activations, Basis, ForcingTerm};
pub use log_map::RotationChart;
pub use orientation::{OrientationError, OrientationInput, OrientationState, OrientationSystem, orientation_error};
pub use phase::{CanonicalSystem, Phase};
pub use primitive::{
    CONTROL_PERIOD, HAND_ROWS, Hemisphere, ORIENTATION_ROWS, POSITION_ROWS, POSTURE_ROWS, Primitive, PrimitiveTables,
    ROWS,
};
pub use primitive_error::{Part, PrimitiveError, Row};
pub use quaternion::Quaternion;
pub use reference::{OrientationReference, Reference, StartState, Trajectory};
pub use rollout::{Rollout, RolloutError};
#[cfg(feature = "fixed")]
pub use scalar::FixedPoint;
pub use scalar::Scalar;
pub use sensor_statistics::{EXPERIENCE_CAPACITY, EXPERIENCE_CHANNELS, Experience};
pub use table::{Entry, PhaseTable, TableError};
pub use transformation::{GainError, PointInput, PointState, TransformationSystem};
