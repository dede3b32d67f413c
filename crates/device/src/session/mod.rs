//! The low-priority half of a device: the link to the host, and what an arm does with its requests.

mod arm;
mod host;

pub use arm::{ArmApplication, Session};
pub use host::{HostSession, Identity, PENDING_COMMANDS};
