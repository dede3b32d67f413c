//! The session against a bench: what a host may do, what it is refused, and what survives.

mod bounds;
mod calibration;
mod commands;
mod conversation;
mod fault_record;
mod in_use;
mod library;
mod losses;
mod observers;
mod rig;
mod saving;
mod secret;
mod strangers;
mod uploads;
mod weight;
