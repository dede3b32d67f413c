//! Problems of a CAN interface, each with the command that mends it.

use crate::error_code::ErrorCode;

/// Why an interface cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CanProblem {
    /// There is no interface of that name.
    #[error("there is no network interface '{interface}'; {}", found(.known))]
    NoInterface {
        /// Its name.
        interface: String,
        /// The CAN interfaces there are.
        known: Vec<String>,
    },
    /// The interface is no CAN interface.
    #[error("'{interface}' is no CAN interface; {}", found(.known))]
    NotCan {
        /// Its name.
        interface: String,
        /// The CAN interfaces there are.
        known: Vec<String>,
    },
    /// The interface is switched off.
    #[error("the CAN interface '{interface}' is down")]
    Down {
        /// Its name.
        interface: String,
    },
    /// The controller has left the bus after too many errors.
    #[error("the controller of '{interface}' is bus-off: too many errors on the wire")]
    BusOff {
        /// Its name.
        interface: String,
    },
    /// Frames do not leave: nobody acknowledges them.
    #[error("frames handed to '{interface}' have not left for {seconds} s: nobody on the bus acknowledges them")]
    NotSent {
        /// Its name.
        interface: String,
        /// Time waited, s.
        seconds: u64,
    },
    /// This kernel has no CAN, or this is not Linux.
    #[error("this system has no SocketCAN")]
    Unsupported(#[source] std::io::Error),
}

fn found(known: &[String]) -> String {
    if known.is_empty() { "no CAN interface was found".to_owned() } else { format!("there is {}", known.join(", ")) }
}

/// The commands that switch an interface on as the link needs it: 1 Mbit/s, back from bus-off by itself, and a queue
/// that holds a few messages.
fn switch_on(interface: &str) -> String {
    format!(
        "`sudo ip link set {interface} type can bitrate {} restart-ms 100 && sudo ip link set {interface} txqueuelen 256 up`",
        link::can::BITS_PER_SECOND
    )
}

impl CanProblem {
    /// Stable number.
    #[must_use]
    pub fn code(&self) -> ErrorCode {
        match self {
            Self::NoInterface { .. } => ErrorCode::NoCanInterface,
            Self::NotCan { .. } => ErrorCode::NotACanInterface,
            Self::Down { .. } => ErrorCode::CanInterfaceDown,
            Self::Unsupported(_) => ErrorCode::NoSocketCan,
            Self::BusOff { .. } => ErrorCode::BusOff,
            Self::NotSent { .. } => ErrorCode::FramesNotSent,
        }
    }

    /// The remedy here, where more is known than the code advises.
    #[must_use]
    pub fn help(&self) -> Option<String> {
        match self {
            Self::NoInterface { known, .. } | Self::NotCan { known, .. } => {
                known.first().map(|other| format!("`--device can:{other}`"))
            }
            Self::Down { interface } => Some(switch_on(interface)),
            Self::BusOff { interface } => Some(format!(
                "check bit rate, termination (120 ohm at both ends) and wiring, then `sudo ip link set {interface} down` and {}",
                switch_on(interface)
            )),
            Self::NotSent { interface, .. } => Some(format!(
                "check that the device has power and that its bit rate is the same; `ip -details link show {interface}` \
                 tells the state of the controller"
            )),
            Self::Unsupported(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interface_that_is_down_prints_the_command_that_switches_it_on() {
        let help = CanProblem::Down { interface: "can7".into() }.help().expect("a command");
        assert!(help.contains("sudo ip link set can7 type can bitrate 1000000"), "{help}");
        assert!(help.contains("sudo ip link set can7 txqueuelen 256 up"), "{help}");
    }
}
