//! The tests of the parts of the control code, one program: each file is a module of it.

mod estimation;
mod force_control;
mod gains;
mod golden_dynamics;
mod hand;
mod hostile_input;
mod inverse_dynamics_control;
mod kinematics;
mod limits;
mod primitive;
mod state_machine;
mod wrench;
