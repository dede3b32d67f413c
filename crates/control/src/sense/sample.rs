//! Samples: the replies of one round on the bus.

use puck::{Counts, RawWrench, SafetyMode};

/// Replies of the hand's pucks since the last cycle, in the order F1, F2, F3, spread.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HandSample {
    /// Motor positions of the four pucks; `None` where the reply was lost or malformed.
    pub primary: [Option<Counts>; 4],
    /// Positions of the fingers' worm encoders; `None` where they were lost or do not exist.
    pub secondary: [Option<Counts>; 3],
    /// Raw counts of the fingers' strain gauges; `None` where the reply was lost.
    pub gauges: [Option<u16>; 3],
}

/// Replies of the bus round of one cycle.
///
/// Only replies of this cycle belong here: the caller empties its mailboxes before it sends the requests, so a late
/// reply is a missing one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BusSample {
    /// Motor positions of pucks 1 to 7; `None` where the reply was lost or malformed.
    pub positions: [Option<Counts>; 7],
    /// Wrist wrench; `None` where one of its two frames was lost.
    pub wrench: Option<RawWrench>,
    /// Latest mode of the safety module, where it was polled since the last cycle.
    pub safety: Option<SafetyMode>,
    /// Replies of the hand since the last cycle; `None` without a hand, or while it is not initialised.
    pub hand: Option<HandSample>,
}
