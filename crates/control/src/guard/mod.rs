//! Guards: faults, the monitor of limits, the state machine, the watch for unusual runs.

pub(crate) mod disagreement;
pub mod fault;
pub mod joint_limits;
pub mod monitor;
pub mod supervisor;
pub mod watch;

pub use fault::Fault;
pub use joint_limits::JointBounds;
pub use supervisor::{State, Supervisor, Trigger};
pub use watch::Watch;
