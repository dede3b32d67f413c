//! The STM32H743 image executed on an emulated chip.

pub mod board;
pub mod cache;
pub mod can;
pub mod core;
pub mod excuses;
pub mod findings;
pub mod host_bus;
pub mod image;
pub mod log;
pub mod part;
pub mod run;
pub mod serial;
pub mod watchdog;
pub mod world;
