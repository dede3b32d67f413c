//! Host side of Tactus.

pub mod arm;
pub mod check;
pub mod client;
pub mod cmd;
pub mod demonstration;
pub mod device;
pub mod error;
pub mod experiment;
pub mod failure;
pub mod learn;
pub mod plan;
pub mod plot;
pub mod primitive_file;
pub mod procedure;
pub mod simulation;
pub mod table;
pub mod tracking;
pub mod transport;
