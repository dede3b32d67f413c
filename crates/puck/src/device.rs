//! The device side of requests, for a puck, the safety module or a simulator.
//!
//! The replies are built by [`crate::reply`], [`crate::position`], [`crate::force_torque`] and [`crate::tactile`].

use core::fmt;

use embedded_can::Frame;

use crate::can::{CanFrame, CanId, Destination, Group, Node, classic_id};
use crate::message::{SET_BIT, short};
use crate::property::PropertyId;
use crate::reply::{ReplyError, decode_property};
use crate::state::MotorMode;
use crate::units::PuckTorque;

pub use crate::force_torque::{acceleration_frame, force_frame, quantise, torque_frame};
pub use crate::position::{position_frame, secondary_position_frame};
pub use crate::reply::{reply16, reply32};

/// A frame that asks something of one device or of a group, decoded. The master builds such frames with
/// [`get`](crate::get), [`set`](crate::set) and [`packed_torques`](crate::packed_torques); what it receives is a
/// [`Reply`](crate::Reply).
///
/// ```
/// use puck::{Action, Group, PropertyId, Request, get};
///
/// let heard = Request::decode(&get(Group::ARM, PropertyId::POSITION))?;
/// assert_eq!(heard.action, Action::Get { property: PropertyId::POSITION });
/// # Ok::<(), puck::RequestError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Request {
    /// The sender: the host, or the safety module that sets modes.
    pub sender: Node,
    /// The node or group that is asked.
    pub to: Destination,
    /// The request itself.
    pub action: Action,
}

/// The content of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub enum Action {
    /// Send the value of a property.
    Get {
        /// The property.
        property: PropertyId,
    },
    /// Change a property. No reply.
    Set {
        /// The property.
        property: PropertyId,
        /// The new value, sign extended.
        value: i32,
    },
    /// Four values of one property in one frame, by PIDX. Only T is ever sent that way.
    PackedTorques {
        /// T of the firmware the sender believes in; a puck ignores the frame if this is not its T.
        property: PropertyId,
        /// In the order of PIDX 1..=4.
        torques: [PuckTorque; 4],
    },
}

impl Action {
    /// The value for the puck with this PIDX (1..=4) in a packed frame; `None` otherwise.
    #[must_use]
    pub fn torque_for(&self, place: u8) -> Option<PuckTorque> {
        match self {
            Action::PackedTorques { torques, .. } => torques.get(usize::from(place).checked_sub(1)?).copied(),
            _ => None,
        }
    }
}

/// Reason for which a frame is no request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum RequestError {
    /// Extended identifier or remote frame: not Barrett's protocol.
    NotClassic,
    /// The destination is a group that carries only replies.
    ReplyGroup,
    /// No request has this length.
    Length,
    /// GET with bit 7 of byte 0 set, SET with bit 7 clear, or byte 1 of a SET not zero.
    Header,
    /// Packed torques to a single node.
    PackedToNode,
}

impl fmt::Display for RequestError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            RequestError::NotClassic => "extended or remote frame",
            RequestError::ReplyGroup => "frame to a group that carries only replies",
            RequestError::Length => "no request has this length",
            RequestError::Header => "malformed header",
            RequestError::PackedToNode => "packed torques to a single node",
        })
    }
}

impl core::error::Error for RequestError {}

impl Request {
    /// Decodes any frame from the bus.
    ///
    /// # Errors
    /// [`RequestError`]: the frame is malformed, or not a request at all.
    pub fn decode(frame: &impl Frame) -> Result<Request, RequestError> {
        if frame.is_remote_frame() {
            return Err(RequestError::NotClassic);
        }
        let id = classic_id(frame).ok_or(RequestError::NotClassic)?;
        let to = id.destination();
        if matches!(to, Destination::Group(group) if group.carries_only_replies()) {
            return Err(RequestError::ReplyGroup);
        }
        let action = match *frame.data() {
            [header] if header & SET_BIT == 0 => Action::Get { property: PropertyId::of_byte(header) },
            [_] => return Err(RequestError::Header),
            [header, b1, b2, b3, b4, b5, b6, b7] => {
                if header & SET_BIT == 0 {
                    return Err(RequestError::Header);
                }
                if matches!(to, Destination::Node(_)) {
                    return Err(RequestError::PackedToNode);
                }
                let bits = u64::from_be_bytes([0, b1, b2, b3, b4, b5, b6, b7]);
                let field = |place: u32| PuckTorque::from_bits(bits >> (42 - 14 * place));
                Action::PackedTorques {
                    property: PropertyId::of_byte(header),
                    torques: [field(0), field(1), field(2), field(3)],
                }
            }
            ref payload => match decode_property(payload) {
                Ok((property, value)) => Action::Set { property, value },
                Err(ReplyError::Length) => return Err(RequestError::Length),
                Err(_) => return Err(RequestError::Header),
            },
        };
        Ok(Request { sender: id.sender(), to, action })
    }
}

/// The safety module's broadcast when the person presses Activate (`Torque`) or Idle (`Idle`): 0x540.
///
/// The best reading of undocumented frames: SET MODE to all motor pucks.
#[must_use]
pub fn safety_broadcast(mode: MotorMode) -> CanFrame {
    short(CanId::encode(Node::SAFETY_MODULE, Group::ALL_MOTORS), PropertyId::MODE, mode.value() as i16)
}
