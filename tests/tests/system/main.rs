//! The whole system: firmware under QEMU or on the emulated board, bus, world, link, host tools. One program, so that
//! all share what was taught.

mod bad_input;
mod board;
mod boot;
mod calibration;
mod command_line;
mod cost;
mod determinism;
mod experiment;
mod firmware_ends;
mod flood;
mod hand;
mod journey;
mod metadata;
#[cfg(feature = "mujoco")]
mod payload;
mod python;
mod served_arm;
mod sil_and_qemu;
mod stopping;
mod storage;
#[cfg(feature = "mujoco")]
mod touch;
