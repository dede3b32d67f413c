//! The tests of the library below the command, one program: each file is a module of it.

mod common;
mod elf;

mod comparing;
mod emulated_board;
mod errors;
mod exporting;
mod friction;
mod learning;
mod learning_speed;
mod load;
mod lossy_line;
mod recording;
mod remembering;
mod report;
mod shown_hand;
mod shown_range;
mod weighing;
