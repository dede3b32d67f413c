//! Replies: decoding for the master, encoding for a device.
//!
//! Replies never go to the host's node number but to a group that names the format: 3 positions, 6 ordinary properties,
//! 7 secondary position, 8 and 9 tactile, 10..12 force/torque sensor. The group, not the request, decides how to read.

use core::fmt;

use embedded_can::Frame;

use crate::can::{CanFrame, CanId, Destination, Group, Node, classic_id};
use crate::force_torque::{self, GaugeStatus};
use crate::message::{SET_BIT, short, wide};
use crate::position;
use crate::property::PropertyId;
use crate::tactile::{TactileBlock, TactileTop};
use crate::units::Counts;

/// One frame from a device, decoded. Requests on the same bus are [`Request`](crate::Request)s; a frame that is neither
/// is an error.
///
/// ```
/// use puck::{Node, PropertyId, Reply, device};
///
/// let frame = device::reply16(Node::ARM[0], PropertyId::STAT, 2);
/// let reply = Reply::decode(&frame)?;
/// assert_eq!(reply, Reply::Property { node: Node::ARM[0], property: PropertyId::STAT, value: 2 });
/// # Ok::<(), puck::ReplyError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub enum Reply {
    /// The value of a property.
    Property {
        /// The node that answers.
        node: Node,
        /// The property.
        property: PropertyId,
        /// Its value, sign extended.
        value: i32,
    },
    /// The position of a motor.
    Position {
        /// The node that answers.
        node: Node,
        /// Motor encoder, 22 bits.
        primary: Counts,
        /// Secondary encoder, 22 bits, on pucks that have one.
        secondary: Option<Counts>,
    },
    /// The position of the secondary encoder alone.
    SecondaryPosition {
        /// The node that answers.
        node: Node,
        /// Secondary encoder, 22 bits.
        secondary: Counts,
    },
    /// The first half of a force/torque sample, 1/256 N.
    Force {
        /// The node that answers.
        node: Node,
        /// x, y, z.
        counts: [i16; 3],
        /// Not seen in practice on this frame, but accepted.
        status: Option<GaugeStatus>,
    },
    /// The second half of a force/torque sample, 1/4096 N m.
    Torque {
        /// The node that answers.
        node: Node,
        /// x, y, z.
        counts: [i16; 3],
        /// Present when a gauge has saturated since the last tare.
        status: Option<GaugeStatus>,
    },
    /// Acceleration, 1/1024.
    Acceleration {
        /// The node that answers.
        node: Node,
        /// x, y, z.
        counts: [i16; 3],
        /// Not seen in practice on this frame, but accepted.
        status: Option<GaugeStatus>,
    },
    /// A fifth of a full tactile reply.
    TactileFull {
        /// The node that answers.
        node: Node,
        /// Five cells.
        block: TactileBlock,
    },
    /// The ten highest tactile cells.
    TactileTop {
        /// The node that answers.
        node: Node,
        /// Map and values.
        top: TactileTop,
    },
    /// The safety module spoke to all motors (0x540) unasked, presumably setting their MODE. Payload undocumented:
    /// ignore.
    SafetyBroadcast,
}

/// Reason for which a frame is no reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ReplyError {
    /// Extended identifier or remote frame: not Barrett's protocol.
    NotClassic,
    /// The sender is node 0, the host itself.
    FromHost,
    /// The destination is a node; replies go to groups.
    ToNode,
    /// No reply format travels to this group.
    UnknownGroup,
    /// The format has another length.
    Length,
    /// Ordinary reply with bit 7 of byte 0 clear or byte 1 not zero.
    Header,
    /// Full tactile frame with a sequence number above 4.
    Sequence,
}

impl fmt::Display for ReplyError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            ReplyError::NotClassic => "extended or remote frame",
            ReplyError::FromHost => "frame of the host",
            ReplyError::ToNode => "reply to a node instead of a group",
            ReplyError::UnknownGroup => "no reply format for this group",
            ReplyError::Length => "wrong length for this reply",
            ReplyError::Header => "malformed header of an ordinary reply",
            ReplyError::Sequence => "tactile sequence number above 4",
        })
    }
}

impl core::error::Error for ReplyError {}

impl Reply {
    /// Decodes any frame from the bus.
    ///
    /// # Errors
    /// [`ReplyError`]: the frame is malformed, or not a reply at all.
    pub fn decode(frame: &impl Frame) -> Result<Reply, ReplyError> {
        if frame.is_remote_frame() {
            return Err(ReplyError::NotClassic);
        }
        let id = classic_id(frame).ok_or(ReplyError::NotClassic)?;
        let node = id.sender();
        if node == Node::HOST {
            return Err(ReplyError::FromHost);
        }
        let Destination::Group(group) = id.destination() else {
            return Err(ReplyError::ToNode);
        };
        let payload = frame.data();
        let wrench = || force_torque::decode(payload).ok_or(ReplyError::Length);
        match group {
            Group::POSITION_REPLIES => position::decode(payload)
                .map(|(primary, secondary)| Reply::Position { node, primary, secondary })
                .ok_or(ReplyError::Length),
            Group::PROPERTY_REPLIES => {
                decode_property(payload).map(|(property, value)| Reply::Property { node, property, value })
            }
            Group::SECONDARY_POSITION_REPLIES => position::decode_secondary(payload)
                .map(|secondary| Reply::SecondaryPosition { node, secondary })
                .ok_or(ReplyError::Length),
            Group::FORCE_REPLIES => wrench().map(|(counts, status)| Reply::Force { node, counts, status }),
            Group::TORQUE_REPLIES => wrench().map(|(counts, status)| Reply::Torque { node, counts, status }),
            Group::ACCELERATION_REPLIES => {
                wrench().map(|(counts, status)| Reply::Acceleration { node, counts, status })
            }
            Group::TACTILE_FULL_REPLIES if payload.len() != 8 => Err(ReplyError::Length),
            Group::TACTILE_FULL_REPLIES => TactileBlock::decode(payload)
                .map(|block| Reply::TactileFull { node, block })
                .ok_or(ReplyError::Sequence),
            Group::TACTILE_TOP_REPLIES => {
                TactileTop::decode(payload).map(|top| Reply::TactileTop { node, top }).ok_or(ReplyError::Length)
            }
            Group::ALL_MOTORS if node == Node::SAFETY_MODULE => Ok(Reply::SafetyBroadcast),
            _ => Err(ReplyError::UnknownGroup),
        }
    }
}

/// The property and value of a SET or ordinary reply: 16 or 32 bits, little-endian, sign extended.
pub(crate) fn decode_property(payload: &[u8]) -> Result<(PropertyId, i32), ReplyError> {
    let (header, padding, value) = match *payload {
        [header, padding, low, high] => (header, padding, i16::from_le_bytes([low, high]) as i32),
        [header, padding, a, b, c, d] => (header, padding, i32::from_le_bytes([a, b, c, d])),
        _ => return Err(ReplyError::Length),
    };
    if header & SET_BIT == 0 || padding != 0 {
        return Err(ReplyError::Header);
    }
    Ok((PropertyId::of_byte(header), value))
}

/// Device side: an ordinary reply of 16 bits.
#[must_use]
pub fn reply16(node: Node, property: PropertyId, value: i16) -> CanFrame {
    short(CanId::encode(node, Group::PROPERTY_REPLIES), property, value)
}

/// Device side: an ordinary reply of 32 bits.
#[must_use]
pub fn reply32(node: Node, property: PropertyId, value: i32) -> CanFrame {
    wide(CanId::encode(node, Group::PROPERTY_REPLIES), property, value)
}
