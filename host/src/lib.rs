//! Host side of Tactus.

pub mod arm;
mod boxed;
pub mod can;
pub mod check;
pub mod client;
pub mod cmd;
pub mod demonstration;
pub mod device;
pub mod difference;
pub mod error;
pub mod experiment;
pub mod failure;
pub mod image_file;
pub mod learn;
pub mod plan;
pub mod plot;
pub mod primitive_file;
pub mod probe;
pub mod procedure;
pub mod simulation;
pub mod table;
pub mod tracking;
pub mod transport;
