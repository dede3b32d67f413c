//! The whole control cycle against a simulated arm.

mod authority;
mod contact;
mod losses;
mod postures;
mod primitives;
mod rig;
mod tracking;
