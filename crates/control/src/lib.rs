//! Everything that decides torque for the Barrett WAM: model, estimation, controllers, limits, supervisor.
#![no_std]
#![forbid(unsafe_code)]
