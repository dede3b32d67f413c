//! The account of what went over the bus: counts per class, load, invalid frames, and a hash that two equal runs share.

use crate::time::{Ticks, seconds};
use crate::wire::Passage;
use puck::{CanFrame, Destination, Group, Node, Reply, Request};
use std::fmt;

/// Offset basis of FNV-1a, 64 bits.
const FNV_OFFSET: u64 = 0xCBF2_9CE4_8422_2325;
/// Prime of FNV-1a, 64 bits.
const FNV_PRIME: u64 = 0x0000_0100_0000_01B3;

/// Class of a frame, by its identifier alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum FrameClass {
    /// Host to one node: directed GET or SET.
    Directed,
    /// Host to a group, other than torques: GET or SET to several nodes.
    GroupRequest,
    /// Host to groups 1, 2: packed torques of the arm. (Hand torques travel to group 5 and count as group requests.)
    PackedTorque,
    /// Puck to group 3: position.
    Position,
    /// Node to group 6: ordinary property reply.
    PropertyReply,
    /// Sensor to groups 10..12: force, torque, acceleration.
    ForceTorque,
    /// Safety module to group 0, 0x540.
    SafetyBroadcast,
    /// Anything else.
    Other,
}

impl FrameClass {
    /// All classes, in the order of [`BusTrace::frames`].
    pub const ALL: [FrameClass; 8] = [
        FrameClass::Directed,
        FrameClass::GroupRequest,
        FrameClass::PackedTorque,
        FrameClass::Position,
        FrameClass::PropertyReply,
        FrameClass::ForceTorque,
        FrameClass::SafetyBroadcast,
        FrameClass::Other,
    ];

    /// The class of a frame.
    #[must_use]
    pub fn of(frame: &CanFrame) -> Self {
        let from_host = frame.can_id().sender() == Node::HOST;
        match frame.can_id().destination() {
            Destination::Node(_) if from_host => Self::Directed,
            Destination::Node(_) => Self::Other,
            Destination::Group(Group::ARM_TORQUES | Group::WRIST_TORQUES) if from_host => Self::PackedTorque,
            Destination::Group(_) if from_host => Self::GroupRequest,
            Destination::Group(Group::POSITION_REPLIES) => Self::Position,
            Destination::Group(Group::PROPERTY_REPLIES) => Self::PropertyReply,
            Destination::Group(Group::FORCE_REPLIES | Group::TORQUE_REPLIES | Group::ACCELERATION_REPLIES) => {
                Self::ForceTorque
            }
            Destination::Group(Group::ALL_MOTORS) if frame.can_id().sender() == Node::SAFETY_MODULE => {
                Self::SafetyBroadcast
            }
            Destination::Group(_) => Self::Other,
        }
    }
}

impl fmt::Display for FrameClass {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Directed => "directed",
            Self::GroupRequest => "group request",
            Self::PackedTorque => "packed torque",
            Self::Position => "position",
            Self::PropertyReply => "property reply",
            Self::ForceTorque => "force/torque",
            Self::SafetyBroadcast => "safety broadcast",
            Self::Other => "other",
        })
    }
}

/// Statistics of the bus since the start.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BusTrace {
    /// FNV-1a-64 over (start tick u64 LE, id u16 LE, dlc u8, data) of every frame in order.
    pub hash: u64,
    /// Frames per class, in the order of [`FrameClass::ALL`].
    pub frames: [u64; FrameClass::ALL.len()],
    /// Frames that `crates/puck` does not accept as a request (from the host) or a reply (from a node).
    pub invalid: u64,
    /// The first few invalid frames, to tell what went wrong.
    pub invalid_examples: Vec<CanFrame>,
    /// Ticks the bus was busy, interframe spaces included.
    pub busy: Ticks,
}

impl Default for BusTrace {
    fn default() -> Self {
        Self { hash: FNV_OFFSET, frames: [0; FrameClass::ALL.len()], invalid: 0, invalid_examples: Vec::new(), busy: 0 }
    }
}

impl BusTrace {
    /// Number of invalid frames that are kept as examples.
    const EXAMPLES: usize = 8;

    /// Number of frames of one class.
    #[must_use]
    pub fn count(&self, class: FrameClass) -> u64 {
        self.frames[class as usize]
    }

    /// Number of all frames.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.frames.iter().sum()
    }

    /// Part of `elapsed` during which the bus was busy, 0..=1; 0 for no time at all.
    #[must_use]
    pub fn load(&self, elapsed: Ticks) -> f64 {
        if elapsed == 0 { 0.0 } else { seconds(self.busy) / seconds(elapsed) }
    }

    /// Adds a frame at its start.
    pub(crate) fn note(&mut self, passage: &Passage) {
        let frame = &passage.frame;
        self.mix(&passage.start.to_le_bytes());
        self.mix(&frame.can_id().raw().to_le_bytes());
        self.mix(&[frame.payload().len() as u8]);
        self.mix(frame.payload());
        self.frames[FrameClass::of(frame) as usize] += 1;
        self.busy += passage.end - passage.start;
        if !is_valid(frame) {
            self.invalid += 1;
            if self.invalid_examples.len() < Self::EXAMPLES {
                self.invalid_examples.push(*frame);
            }
        }
    }

    fn mix(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.hash = (self.hash ^ u64::from(byte)).wrapping_mul(FNV_PRIME);
        }
    }
}

/// True if `crates/puck` accepts the frame: as a request if the host or the safety module sent it, else as a reply.
fn is_valid(frame: &CanFrame) -> bool {
    let is_reply = Reply::decode(frame).is_ok();
    match frame.can_id().sender() {
        Node::HOST => Request::decode(frame).is_ok(),
        Node::SAFETY_MODULE if FrameClass::of(frame) == FrameClass::SafetyBroadcast => {
            is_reply && Request::decode(frame).is_ok()
        }
        _ => is_reply,
    }
}
