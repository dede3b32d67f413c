#![doc = include_str!("../README.md")]
#![no_std]
// The initialiser of a large struct is a macro that calls itself for each field.
#![recursion_limit = "256"]
#![forbid(unsafe_code)]

mod bus;
pub mod calibration;
pub mod command;
pub mod core;
pub mod event;
pub mod hand;
pub mod health;
mod mailbox;
pub mod recorded_filter;
mod round;
mod slow;
pub mod startup;
pub mod time;

pub use self::core::{Core, CoreIo, Slot};
pub use calibration::{Home, HomeError, StoredHome};
pub use command::{Command, Refusal};
pub use event::{Event, EventKind};
pub use hand::HandTrouble;
pub use health::{Counters, Health};
pub use startup::{Stage, StartupError};

mod port;
mod session;
pub mod storage;
mod store;

pub use port::{FitPrimitive, QueueFull, SessionPort, StoredPrimitive, TimedRecord, Timing};
pub use session::{Asker, Identity, Owner, Pending, PrimitiveTrouble, Session, StartupTrouble, Turn};
pub use store::{RamStore, STORE_SLOT_BYTES, STORE_SLOTS, Store, StoreError};
