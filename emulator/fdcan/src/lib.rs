#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod access;
mod controller;
mod controllers;
mod errors;
mod filter;
mod frame;
mod memory;
mod random;
mod receive;
mod registers;
mod remark;
mod timing;
mod transmit;
mod unit;

pub use controller::wire::{Fault, Handler, WireEvent};
pub use controllers::{Controllers, Line, Options, Status};
pub use errors::BusError;
pub use frame::{Frame, Id};
pub use memory::WORDS as MEMORY_WORDS;
pub use remark::{Remark, RemarkKind};
pub use timing::BitTiming;
pub use transmit::Cancellation;
pub use unit::Unit;

/// Virtual time: nanoseconds since power-up.
pub type Nanoseconds = u64;
