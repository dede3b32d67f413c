//! `HandFailure`: why a hand is not used.

use core::fmt;

use puck::Node;

/// Reason for which a puck of the hand cannot be used. The codes travel over the link and are never renumbered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum HandFailure {
    /// It does not answer, while other pucks of the hand do.
    Missing = 1,
    /// It did not answer a question.
    NoAnswer = 2,
    /// It was woken and still does not report READY.
    DidNotWake = 3,
    /// It has another role than that of a hand.
    WrongRole = 4,
    /// Its firmware has no property table, or is of another generation than that of the first finger.
    UnknownFirmware = 5,
    /// It does not listen to the hand's requests, or listens to those of the arm.
    WrongGroups = 6,
    /// It takes its torque from another place of the frame than its number demands.
    WrongPlace = 7,
    /// Its encoder or torque scale is not that of this hand.
    WrongScale = 8,
    /// It did not end its initialisation in time.
    TimedOut = 9,
    /// It has reset and lost its position.
    Reset = 10,
    /// It fell silent.
    Silent = 11,
    /// It did not take a setting.
    NotTaken = 12,
    /// It does not count from zero after its initialisation: something has broken that off.
    NotZeroed = 13,
}

impl HandFailure {
    /// Every reason, in the order of the codes.
    pub const ALL: [HandFailure; 13] = [
        HandFailure::Missing,
        HandFailure::NoAnswer,
        HandFailure::DidNotWake,
        HandFailure::WrongRole,
        HandFailure::UnknownFirmware,
        HandFailure::WrongGroups,
        HandFailure::WrongPlace,
        HandFailure::WrongScale,
        HandFailure::TimedOut,
        HandFailure::Reset,
        HandFailure::Silent,
        HandFailure::NotTaken,
        HandFailure::NotZeroed,
    ];

    /// Puck and reason as one number: the node in the low eight bits, the code above. The detail of
    /// `link::EventKind::Hand`.
    pub const fn number(self, node: Node) -> u32 {
        node.number() as u32 | (self as u32) << 8
    }

    /// Puck and reason of such a number; `None` for 0 and for what is none.
    pub fn from_number(number: u32) -> Option<(Node, HandFailure)> {
        let node = Node::new(u8::try_from(number & 0xFF).ok()?)?;
        let failure = HandFailure::ALL.into_iter().find(|failure| *failure as u32 == number >> 8)?;
        Some((node, failure))
    }
}

impl fmt::Display for HandFailure {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            HandFailure::Missing => "does not answer",
            HandFailure::NoAnswer => "did not answer a question",
            HandFailure::DidNotWake => "did not wake up",
            HandFailure::WrongRole => "is no puck of a hand",
            HandFailure::UnknownFirmware => "runs a firmware that is not supported, or another than the first finger",
            HandFailure::WrongGroups => "belongs to the wrong groups (GRPA, GRPB, GRPC)",
            HandFailure::WrongPlace => "has a PIDX that does not fit its number",
            HandFailure::WrongScale => "has impossible scales (CTS, IPNM)",
            HandFailure::TimedOut => "did not end its initialisation in time",
            HandFailure::Reset => "has reset and lost its position",
            HandFailure::Silent => "fell silent",
            HandFailure::NotTaken => "did not take a setting",
            HandFailure::NotZeroed => "does not count from its open stop: its initialisation was broken off",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reason_survives_its_number() {
        for failure in HandFailure::ALL {
            for node in Node::HAND {
                assert_eq!(HandFailure::from_number(failure.number(node)), Some((node, failure)));
            }
        }
        assert_eq!(HandFailure::from_number(0), None, "no cause");
        assert_eq!(HandFailure::from_number(200 << 8 | 11), None, "a reason of a later version");
    }
}
