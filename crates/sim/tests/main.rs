//! The tests of the simulator, one program: each file is a module of it.

mod common;

mod bus;
mod faults;
mod hand;
mod hand_in_mujoco;
mod imperfections;
mod lockstep;
mod mujoco_world;
mod objects;
mod pictures;
mod plant;
mod pucks;
mod safety;
mod sensor;
mod started;
mod startup;
mod taught_movements;
mod teaching;
mod urdf;
mod wire;
