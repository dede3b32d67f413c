//! Tests of the fixed-point finger controller against the arm's code in f64, golden vectors, and wide integers.

mod accuracy;
mod after_faults;
mod common;
mod force;
mod image;
mod ladder;
mod rig;
mod saturation;
mod sequences;
mod storm;
