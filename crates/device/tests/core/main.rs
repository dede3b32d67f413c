//! The control half on a double of the arm's bus: start-up, rounds, slow polls, and every way out of torque.

mod arbitrary;
mod cycles;
mod double;
mod startup;
