#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]
#![warn(clippy::must_use_candidate)]

mod bits;
pub mod can;
pub mod device;
pub mod force_torque;
pub mod gauge;
pub mod hand;
pub mod message;
pub mod position;
pub mod property;
pub mod reply;
pub mod safety;
pub mod state;
pub mod tactile;
pub mod transmission;
pub mod units;

pub use can::{CanFrame, CanId, Destination, Group, Node};
pub use device::{Action, Request, RequestError};
pub use force_torque::{GaugeStatus, RawWrench};
pub use message::{get, hand_stop_frames, packed_torques, set, set_short, stop_frames, zero_torques};
pub use property::{Property, PropertyId, PropertyTable, UnknownFirmware};
pub use reply::{Reply, ReplyError};
pub use safety::{PendantState, SafetyMode};
pub use state::{MotorMode, Role, Status};
pub use transmission::{Drives, Ratios, Transmission, TransmissionError};
pub use units::{Counts, NotFinite, PuckTorque, Real};
