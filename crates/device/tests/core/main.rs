//! The control half on a double of the arm's bus: start-up, rounds, slow polls, and every way out of torque.

mod anew;
mod answers;
mod arbitrary;
mod bus_time;
mod cycles;
mod digit;
mod double;
mod hand;
mod hand_anew;
mod late;
mod remembered_zero;
mod startup;
mod zero;
