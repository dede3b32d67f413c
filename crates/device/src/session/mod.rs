//! The low-priority half of a device: the link to the host, and what an arm does with its requests.

mod arm;
mod calibration;
mod directory;
mod host;
mod owner;
mod pending;
mod primitive;
mod request;
mod saving;
mod upload;
mod wire;

pub use arm::{ArmApplication, Session};
pub use host::{HostSession, Identity};
pub use wire::{PrimitiveTrouble, StartupTrouble};
pub(crate) use wire::{event, refusal, telemetry};
