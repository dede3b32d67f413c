#![doc = include_str!("../README.md")]
#![no_std]
// The initialiser of a large struct is a macro that calls itself for each field.
#![recursion_limit = "256"]
#![forbid(unsafe_code)]

mod application;
mod background;
pub mod bus;
pub mod calibration;
mod caution;
pub mod command;
pub mod controller;
pub mod event;
mod fault_memory;
pub mod hand;
pub mod health;
mod mailbox;
pub mod recorded_filter;
mod round;
mod stage;
mod startup;
pub mod time;
mod wire;

pub use application::{
    Action, Application, Controller, ControllerIo, CycleReport, Message, QueueFull, Refused, Saved, SessionPort, Slot,
    TimedRecord, finite,
};
pub use calibration::{Home, HomeError, StoredHome};
pub use caution::Watch;
pub use command::{Command, Refusal};
pub use controller::DeviceController;
pub use event::{Event, EventKind};
pub use fault_memory::{FAULT_CYCLES, FaultMemory};
pub use hand::HandFailure;
pub use health::{Counters, Health, Timing};
pub use stage::{Stage, StartupError};

mod port;
pub mod secret;
mod session;
pub mod storage;
mod store;
pub mod weight;

pub use port::{CheckedPrimitive, StoredPrimitive};
pub use secret::StoredSecret;
pub use session::{ArmApplication, HostSession, Identity, PENDING_COMMANDS, Session};
pub use store::{RamStore, STORE_SLOT_BYTES, STORE_SLOTS, Store, StoreError, stage_copy};
pub use weight::StoredWeight;
pub use wire::{PrimitiveDefect, StartupFailure};
