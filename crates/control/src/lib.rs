#![doc = include_str!("../README.md")]
#![no_std]
// The initialiser of a large struct is a macro that calls itself for each field.
#![recursion_limit = "256"]
#![forbid(unsafe_code)]

pub mod actuation;
pub mod approach;
pub mod arm;
pub mod calibration;
pub mod command;
pub mod controller;
pub mod cycle;
pub mod deviation;
pub mod dynamics;
pub mod estimate;
pub mod fault;
pub mod filter;
pub mod hand;
pub mod kinematics;
pub mod limit;
pub mod load;
pub mod model;
pub mod monitor;
pub mod real;
pub mod record;
mod run;
pub mod supervisor;
pub mod units;
pub mod watch;
pub mod wrench;

pub use actuation::Actuation;
pub use calibration::{Calibration, CalibrationError, Payload};
pub use command::{AccelerationSource, Command, Goal, PoseFeedback, Refusal, RunOptions};
pub use cycle::{Cycle, MAX_KERNELS, PERIOD, RATE};
pub use fault::Fault;
pub use load::{Fit, LoadError, LoadRefusal};
pub use model::MODEL_HASH;
pub use real::Real;
pub use record::{BusSample, CycleInput, CycleOutput, CycleRecord, Event, HandSample, flags};
pub use supervisor::State;
