//! The `tactus` command: its subcommands, and what only they need.

pub mod check;
pub mod cmd;
pub mod config;
pub mod monitor;
pub mod probe;
pub mod schemas;
