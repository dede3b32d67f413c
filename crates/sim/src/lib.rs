#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod boot;
mod bus;
mod chain;
pub mod fault;
mod firmware;
mod force_torque;
mod hand;
mod inbox;
mod link_wire;
pub mod lockstep;
mod motors;
mod noise;
mod operator;
mod plant;
mod plant_error;
mod properties;
mod puck_model;
#[cfg(feature = "render")]
pub mod render;
mod rotation;
mod safety;
mod speed;
mod steady_hand;
pub mod teacher;
mod time;
mod trace;
pub mod wire;
pub mod world;

pub use bus::{Bus, FOREIGN};
pub use force_torque::ForceTorqueConfig;
pub use hand::HandConfig;
pub use link_wire::{BYTE_TICKS, CHUNK, LinkLine, PlainLine};
pub use lockstep::{Lockstep, LockstepError, Served};
pub use noise::Noise;
pub use operator::{OperatorConfig, PendantAction};
pub use plant::{Event, Plant, PlantConfig};
pub use plant_error::PlantError;
pub use puck_model::PuckConfig;
pub use safety::SafetyConfig;
pub use time::*;
pub use trace::{BusTrace, FrameClass};
pub use wire::Passage;
pub use world::{FingerObstacle, FreeJoints, HOME, HandState, HandTargets, Held, NotHeld, Pose, World};
