//! Requests of the link session to the control half, and the reasons for which they are refused.

use core::fmt;

use crate::stage::Stage;

/// One request of a person, on its way to the control half. Each is answered by exactly one
/// [`crate::EventKind::Accepted`] or [`crate::EventKind::Refused`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// "The arm stands at these joint angles (rad)": define the encoder positions and tell the safety module.
    Zero {
        /// Joint angles of the present pose, rad.
        home: [f32; 7],
    },
    /// "The hand may open": drive its digits to their open stops and count from there.
    InitialiseHand,
    /// Anything the control cycle decides about.
    Control(control::Command),
}

impl From<control::Command> for Command {
    fn from(command: control::Command) -> Command {
        Command::Control(command)
    }
}

/// Why a command was refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refusal {
    /// The control cycle refused it.
    Control(control::Refusal),
    /// The bus start-up has not got that far.
    NotReady(Stage),
    /// The arm can only be zeroed while the safety module is IDLE and no torque is asked for.
    ZeroNeedsIdle,
    /// No hand answers on the bus.
    NoHand,
    /// The hand is being initialised already, or a movement runs.
    HandBusy,
    /// This home angle (0 = J1) is not a number, is outside the joint's limits, or does not fit into the encoder's
    /// range.
    HomeOutOfRange {
        /// Index of the joint.
        joint: u8,
    },
}

impl fmt::Display for Refusal {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Refusal::Control(reason) => reason.fmt(formatter),
            Refusal::NotReady(stage) => {
                write!(formatter, "the bus start-up is still busy: {stage}")
            }
            Refusal::ZeroNeedsIdle => {
                formatter.write_str("the arm can only be zeroed at rest, while the safety module is idle")
            }
            Refusal::NoHand => formatter.write_str("the arm has no hand that answers"),
            Refusal::HandBusy => formatter.write_str("the hand is being initialised, or a movement runs"),
            Refusal::HomeOutOfRange { joint } => {
                write!(formatter, "the home angle of joint {} is outside what the joint can reach", joint + 1)
            }
        }
    }
}

impl core::error::Error for Refusal {}
