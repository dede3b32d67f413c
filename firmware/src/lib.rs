//! The parts of the images that touch a board: its edge, its measurements, its last words, and the bodies of the tasks.
//!
//! The work of the co-controller (bus start-up, bus rounds, control cycle, link session, storage) is in `device`;
//! [`application`] wires it to the pieces of any board, and compiles on the host too; the binaries under `src/bin` bind
//! its tasks to interrupts. Nothing outside [`board`] knows a register.

#![cfg_attr(target_os = "none", no_std)]

pub mod application;
pub mod board;
#[cfg(target_os = "none")]
pub mod defmt_log;
pub mod hand;
pub mod in_place;
pub mod metadata;
pub mod meters;
#[cfg(target_os = "none")]
mod panic_handler;
