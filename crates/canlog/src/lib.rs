//! CAN buses seen from outside: logs, and what their frames mean. `lab::replay` plays a log to the control code.

mod candump;
mod decoder;
mod host_link;
pub mod names;
mod puck_state;
mod reader;
pub mod socketcand;
mod summary;
mod value;

pub use candump::{AnyFrame, LineError, LogLine};
pub use decoder::{Decoder, Kind, Meaning};
pub use host_link::{HostLink, Message};
pub use puck_state::{ASSUMED_FIRMWARE, PuckState};
pub use reader::{BusKind, Interface, Reader};
pub use summary::{CycleSummary, InterfaceTotals, KindSummary, NodeSummary, Summary};
pub use value::Reading;

/// The interface that stands for the arm's bus in the logs of simulated devices.
pub const ARM_INTERFACE: &str = "can0";

/// The interface that stands for the host's bus in the logs of simulated devices.
pub const HOST_INTERFACE: &str = "can1";
