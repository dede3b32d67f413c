//! The parts of the images that touch a board: its edge, its measurements, its last words.
//!
//! Application code (bus start-up, bus rounds, control cycle, link session) is in `device`; the binaries under
//! `src/bin` join the two. Nothing outside [`board`] knows a register.

#![no_std]

pub mod board;
pub mod last_words;
pub mod meters;
