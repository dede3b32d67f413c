//! Host and device of Tactus: framing, messages and the primitive image.
//!
//! The only types both sides share. Everything is raw (`f32` arrays in SI units, plain codes): what
//! the numbers mean to the arm is decided in `control`, which this crate does not know.
//!
//! - [`message`]: [`Request`] (host to device) and [`Reply`] (device to host), append-only.
//! - [`frame`]: one message to bytes and back: postcard, CRC-32, COBS, terminated by a zero byte.
//! - [`can`]: the same bytes over classic CAN frames.
//! - [`metadata`]: [`ImageMetadata`], what a firmware image says about itself to those who have its file.
//! - [`secret`]: [`Secret`], what a host proves to know to a device that keeps one.
//! - [`image`]: [`PrimitiveImage`], a movement primitive as it is uploaded and stored.
//! - [`SCHEMA_HASH`]: a number that changes with every change of any of these layouts.
//!
//! The bytes are described in `docs/protocol.md` and `docs/image-format.md`.
//!
//! Conventions: quaternions are Hamilton, order (w, x, y, z); wrenches are those of the environment
//! on the robot; arrays of seven follow the joints from base to wrist.
#![no_std]
#![forbid(unsafe_code)]

pub mod can;
pub mod frame;
pub mod image;
pub mod message;
pub mod metadata;
pub mod name;
pub mod refusal;
pub mod report;
mod schema;
pub mod secret;
pub mod telemetry;

pub use image::{ImageError, PrimitiveImage};
pub use message::{Capabilities, DeviceHello, Goal, HostHello, Reply, Request, RunOptions};
pub use metadata::ImageMetadata;
pub use name::{Name, NameError, Text};
pub use refusal::Refusal;
pub use report::{
    Calibration, Event, EventKind, FaultRecord, HandStage, HomeSource, LinkCounters, Listing, LostImage, SecretReport,
    SecretState, SessionOwner, Statistics, Status, StorageReport, Weight,
};
pub use schema::{LINK_VERSION, SCHEMA_HASH};
pub use secret::Secret;
pub use telemetry::{ShortTelemetry, Telemetry};
