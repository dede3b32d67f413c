//! Frames of the master: GET, SET and packed torques.
//!
//! There is no acknowledgement to a SET. A puck that gets several without a GET in between may drop some, and the
//! safety module wants 10 ms between two.

use crate::bits::appended;
use crate::can::{CanFrame, CanId, Destination, Group, Node};
use crate::property::PropertyId;
use crate::state::MotorMode;
use crate::units::PuckTorque;

/// Bit 7 of byte 0: set in a SET and in a reply, clear in a GET.
pub(crate) const SET_BIT: u8 = 0x80;

/// Ask one puck, or every member of a group, for a property. DLC 1.
pub fn get(to: impl Into<Destination>, property: PropertyId) -> CanFrame {
    CanFrame::with_payload(CanId::encode(Node::HOST, to), [property.number()])
}

/// Set a property, as Barrett's library does it: always DLC 6, whatever the width of the property.
pub fn set(to: impl Into<Destination>, property: PropertyId, value: i32) -> CanFrame {
    wide(CanId::encode(Node::HOST, to), property, value)
}

/// Set a 16-bit property with DLC 4, as Barrett's wiki and other drivers do it. Pucks accept both forms.
pub fn set_short(to: impl Into<Destination>, property: PropertyId, value: i16) -> CanFrame {
    short(CanId::encode(Node::HOST, to), property, value)
}

/// Byte 0 of a SET and of a reply.
const fn head(property: PropertyId) -> u8 {
    SET_BIT | property.number()
}

/// SET bit and property, 0, then 32 bits little-endian: the same bytes serve SETs and replies.
pub(crate) fn wide(id: CanId, property: PropertyId, value: i32) -> CanFrame {
    let [a, b, c, d] = value.to_le_bytes();
    CanFrame::with_payload(id, [head(property), 0, a, b, c, d])
}

/// SET bit and property, 0, then 16 bits little-endian.
pub(crate) fn short(id: CanId, property: PropertyId, value: i16) -> CanFrame {
    let [low, high] = value.to_le_bytes();
    CanFrame::with_payload(id, [head(property), 0, low, high])
}

/// Torques for up to four pucks of a group in one frame, in the order of their PIDX 1..=4. Always DLC 8.
///
/// Bytes 1..=7 are one big-endian integer `A<<42 | B<<28 | C<<14 | D` of four 14-bit fields. `property` is T of the
/// group's firmware ([`PropertyId::TORQUE`] from 61 on). Call this from one place only, with torques that a limiter has
/// passed: the pucks apply whatever arrives.
#[must_use]
pub fn packed_torques(group: Group, property: PropertyId, torques: [PuckTorque; 4]) -> CanFrame {
    let fields = torques.iter().fold(0_u64, |packed, torque| appended(packed, 14, torque.bits()));
    let [_, b1, b2, b3, b4, b5, b6, b7] = fields.to_be_bytes();
    CanFrame::with_payload(CanId::encode(Node::HOST, group), [head(property), b1, b2, b3, b4, b5, b6, b7])
}

/// The frames that take the torque off: zero torque to arm and wrist, then MODE IDLE to the arm's pucks and to the
/// hand's.
///
/// A master sends them first and last. To keep the arm in torque mode, send [`zero_torques`] instead.
#[must_use]
pub fn stop_frames() -> [CanFrame; 4] {
    let [arm, wrist] = zero_torques();
    let idle = |group| set(group, PropertyId::MODE, MotorMode::Idle.value());
    [arm, wrist, idle(Group::ARM), idle(Group::HAND)]
}

/// The same for the four pucks of a hand alone: zero torque, then MODE IDLE.
#[must_use]
pub fn hand_stop_frames() -> [CanFrame; 2] {
    let zero = packed_torques(Group::HAND, PropertyId::TORQUE, [PuckTorque::ZERO; 4]);
    [zero, set(Group::HAND, PropertyId::MODE, MotorMode::Idle.value())]
}

/// Explicit zero torque for all seven motors. A puck is believed to keep its last torque until told otherwise, so send
/// these whenever control ends.
#[must_use]
pub fn zero_torques() -> [CanFrame; 2] {
    [Group::ARM_TORQUES, Group::WRIST_TORQUES]
        .map(|group| packed_torques(group, PropertyId::TORQUE, [PuckTorque::ZERO; 4]))
}
