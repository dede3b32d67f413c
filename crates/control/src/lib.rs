#![doc = include_str!("../README.md")]
#![no_std]
// The initialiser of a large struct is a macro that calls itself for each field.
#![recursion_limit = "256"]
#![forbid(unsafe_code)]

pub mod act;
pub mod command;
pub mod cycle;
pub mod guard;
pub mod law;
pub mod model;
pub mod plan;
pub mod real;
pub mod sense;
pub mod time;
pub mod units;

pub use act::Actuation;
pub use command::{AccelerationSource, Command, Goal, Refusal, RunOptions};
pub use cycle::record::{CycleInput, CycleOutput, CycleRecord, Event, flags};
pub use cycle::{Caution, Cycle, MAX_KERNELS};
pub use guard::{Fault, State};
pub use model::{Calibration, CalibrationError, MODEL_HASH, Payload};
pub use plan::load::{CheckedPrimitive, LoadError, LoadRefusal};
pub use real::Real;
pub use sense::{BusSample, HandSample};
pub use time::{PERIOD, RATE, RATE_HZ};
