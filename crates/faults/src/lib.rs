//! The fault catalogue, run: each entry of `tests/faults` against the simulated arm, its bars, and the way back.
//!
//! `cargo xtask faults` runs all of it. How a script is written: `docs/faults.md`.

pub mod bench;
pub mod bus;
pub mod catalogue;
pub mod endurance;
pub mod entry;
pub mod figure;
pub mod measure;
pub mod movement;
pub mod recovery;
pub mod report;
pub mod run;
pub mod storm;
pub mod watch;
