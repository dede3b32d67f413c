#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

pub mod application;
pub mod command;
pub mod controller;
pub mod cycle;
pub mod device_controller;
pub mod estimate;
pub mod filter;
pub mod image;
pub mod library;
pub mod limit;
pub mod motion;
pub mod number;
pub mod primitive;
pub mod record;
pub mod startup;

pub use application::{HandApplication, Session};
pub use command::Command;
pub use device_controller::DeviceController;
pub use library::Library;
pub use number::Number;
pub use primitive::{FingerPrimitive, FingerTables, Rollout};
pub use record::Record;

/// Digits of the hand: spread, F1, F2, F3.
pub const DIGITS: usize = 4;

/// Fingers, each with a strain gauge.
pub const FINGERS: usize = 3;

/// Most kernels of a row.
pub const KERNELS: usize = link::image::KERNEL_LIMIT;

/// Time without a reply of a digit before torque ends, and that a gauge is believed: 17 ms, in control periods, as for
/// the positions of an arm (A3). Behind an arm it is `control::sense::hand::LOST_CYCLES`, for the reason given there.
pub const LOST_CYCLES: u8 = control::time::few_periods(1.0 / 60.0);

/// Ranges of the digits (rad).
pub const RANGES: [[f64; 2]; DIGITS] = {
    use control::model::{FINGER_RANGE, SPREAD_RANGE};
    [SPREAD_RANGE, FINGER_RANGE, FINGER_RANGE, FINGER_RANGE]
};

/// The same as numbers of the control path.
pub(crate) const RANGE_NUMBERS: [[Number; 2]; DIGITS] = [
    number::constants(RANGES[0]),
    number::constants(RANGES[1]),
    number::constants(RANGES[2]),
    number::constants(RANGES[3]),
];
