//! The tests of the command, one program: each file is a module of it.

#[path = "../../crates/lab/tests/common/mod.rs"]
mod common;
#[path = "../../crates/lab/tests/elf/mod.rs"]
mod elf;
#[path = "common/served_arm.rs"]
mod served_arm;
#[path = "common/tool.rs"]
mod tool;

mod advice;
mod answers_lost;
mod book;
mod can_bus;
mod can_link;
mod can_tools;
mod careless;
mod checking;
mod closed_terminal;
mod command_line;
mod damage;
mod defects;
mod environment;
mod faults;
mod features;
mod files;
mod first_hour;
mod flashing;
mod guide;
mod keep;
mod library;
mod looking;
mod monitor;
mod mutated;
mod outcomes;
mod overtaken;
mod payload;
mod schemas;
mod secret;
mod settings;
mod silent_hand;
mod stand_in;
mod storage;
mod strange_files;
mod tare;
mod warnings;
mod weighing;
