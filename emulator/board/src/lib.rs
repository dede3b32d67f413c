//! The STM32H743 image executed on an emulated chip.

pub mod bank;
pub mod bank_file;
pub mod board;
pub mod cache;
pub mod can;
pub mod check;
pub mod clocks;
pub mod core;
pub mod excuses;
pub mod fault;
pub mod findings;
pub mod host;
pub mod host_bus;
pub mod image;
mod inject;
pub mod log;
pub mod notes;
pub mod part;
pub mod report;
pub mod run;
pub mod serial;
pub mod setup;
pub mod stack;
pub mod usb;
pub mod watchdog;
pub mod watcher;
pub mod world;
