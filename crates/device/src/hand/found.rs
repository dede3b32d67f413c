//! `Found`: the result of the start-up for a hand.

use puck::hand::HandCommander;
use puck::{Node, PropertyId};

use super::failure::HandFailure;

/// The numbers of the hand's properties that the device uses, the same on all four pucks, and how its digits rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HandProperties {
    /// The frames of its commands.
    pub commander: HandCommander,
    /// SG.
    pub gauge: PropertyId,
    /// TSTOP.
    pub stall: PropertyId,
    /// HOLD of each digit: whether it stays in MODE 3 after a move.
    pub holds: [bool; 4],
}

/// A hand as the start-up leaves it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Found {
    /// No hand, or one that is unfit because of this puck.
    Nothing(Option<(Node, HandFailure)>),
    /// Four pucks of one kind, awake.
    Hand {
        properties: HandProperties,
        /// They were awake before the start-up: what they count from is as it was.
        was_awake: bool,
    },
}
