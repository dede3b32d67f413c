//! Classic CAN frames and Barrett's eleven-bit identifier `G FFFFF TTTTT`.
//!
//! Bit 10 (`G`) tells whether the low five bits name a group or a node, bits 9..5 name the sender. The host is node 0,
//! therefore every host frame wins arbitration against every frame of a puck.

use core::fmt;
use embedded_can::{Frame, Id, StandardId};

/// Bit 10 of an identifier: the destination is a group.
const GROUP_BIT: u16 = 0x400;
/// Destination and sender fields are five bits wide.
const ADDRESS_MASK: u16 = 0x1F;
/// Position of the sender field.
const SENDER_SHIFT: u16 = 5;

/// One participant of the bus, 0..=31. To reach several at once, send to a [`Group`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Node(u8);

impl Node {
    /// The master: a PC, or this co-controller.
    pub const HOST: Node = Node(0);
    /// The wrist force/torque sensor.
    pub const FORCE_TORQUE: Node = Node(8);
    /// The puck on the safety board.
    pub const SAFETY_MODULE: Node = Node(10);
    /// The three fingers F1, F2, F3 of the hand.
    pub const FINGERS: [Node; 3] = [Node(11), Node(12), Node(13)];
    /// The spread of the hand (F4).
    pub const SPREAD: Node = Node(14);
    /// The motor pucks of the seven-joint arm, M1 first.
    pub const ARM: [Node; 7] = [Node(1), Node(2), Node(3), Node(4), Node(5), Node(6), Node(7)];
    /// The four pucks of the hand: fingers, then spread.
    pub const HAND: [Node; 4] = [Node(11), Node(12), Node(13), Node(14)];

    /// A node by number; `None` above 31.
    #[must_use]
    pub const fn new(number: u8) -> Option<Node> {
        if number as u16 <= ADDRESS_MASK { Some(Node(number)) } else { None }
    }

    /// The number, 0..=31.
    #[must_use]
    pub const fn number(self) -> u8 {
        self.0
    }

    /// Index 0..=6 of an arm motor puck; `None` for every other node.
    #[must_use]
    pub const fn arm_index(self) -> Option<usize> {
        if self.0 >= 1 && self.0 <= 7 { Some(self.0 as usize - 1) } else { None }
    }

    /// Index 0..=3 of a hand puck; `None` for every other node.
    #[must_use]
    pub const fn hand_index(self) -> Option<usize> {
        if self.0 >= 11 && self.0 <= 14 { Some(self.0 as usize - 11) } else { None }
    }
}

/// A multicast address, 0..=31. A puck belongs to up to three; replies travel to groups of their own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Group(u8);

impl Group {
    /// Every motor puck, arm *and* hand. Not the safety module. Setting MODE here also reaches the hand.
    pub const ALL_MOTORS: Group = Group(0);
    /// Packed torques of M1..M4; the safety module listens.
    pub const ARM_TORQUES: Group = Group(1);
    /// Packed torques of M5..M7; the safety module listens.
    pub const WRIST_TORQUES: Group = Group(2);
    /// Position replies; the safety module listens.
    pub const POSITION_REPLIES: Group = Group(3);
    /// GET and SET to all pucks of the arm.
    pub const ARM: Group = Group(4);
    /// GET, SET and packed torques to the hand.
    pub const HAND: Group = Group(5);
    /// Ordinary property replies.
    pub const PROPERTY_REPLIES: Group = Group(6);
    /// Replies to a GET of the secondary position alone.
    pub const SECONDARY_POSITION_REPLIES: Group = Group(7);
    /// Tactile top-10 replies.
    pub const TACTILE_TOP_REPLIES: Group = Group(8);
    /// Full tactile replies, five frames per puck.
    pub const TACTILE_FULL_REPLIES: Group = Group(9);
    /// Force frames of the force/torque sensor.
    pub const FORCE_REPLIES: Group = Group(10);
    /// Torque frames of the force/torque sensor.
    pub const TORQUE_REPLIES: Group = Group(11);
    /// Acceleration frames of the force/torque sensor.
    pub const ACCELERATION_REPLIES: Group = Group(12);

    /// A group by number; `None` above 31.
    #[must_use]
    pub const fn new(number: u8) -> Option<Group> {
        if number as u16 <= ADDRESS_MASK { Some(Group(number)) } else { None }
    }

    /// The number, 0..=31.
    #[must_use]
    pub const fn number(self) -> u8 {
        self.0
    }

    /// True if only replies travel to this group, never requests.
    #[must_use]
    pub const fn carries_only_replies(self) -> bool {
        self.0 == 3 || (self.0 >= 6 && self.0 <= 12)
    }
}

/// Destination of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub enum Destination {
    /// One node.
    Node(Node),
    /// Every member of a group.
    Group(Group),
}

impl From<Node> for Destination {
    fn from(node: Node) -> Destination {
        Destination::Node(node)
    }
}

impl From<Group> for Destination {
    fn from(group: Group) -> Destination {
        Destination::Group(group)
    }
}

/// An eleven-bit identifier. A smaller one wins arbitration.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct CanId(u16);

impl CanId {
    /// An identifier from its raw value; `None` above 0x7FF.
    #[must_use]
    pub const fn new(raw: u16) -> Option<CanId> {
        if raw <= 0x7FF { Some(CanId(raw)) } else { None }
    }

    /// The identifier of a frame from `sender` to `destination`.
    pub fn encode(sender: Node, destination: impl Into<Destination>) -> CanId {
        let address = match destination.into() {
            Destination::Node(node) => node.0 as u16,
            Destination::Group(group) => GROUP_BIT | group.0 as u16,
        };
        CanId(address | ((sender.0 as u16) << SENDER_SHIFT))
    }

    /// The raw value, 0..=0x7FF.
    #[must_use]
    pub const fn raw(self) -> u16 {
        self.0
    }

    /// The node that sent the frame.
    #[must_use]
    pub const fn sender(self) -> Node {
        Node(((self.0 >> SENDER_SHIFT) & ADDRESS_MASK) as u8)
    }

    /// The node or group the frame is for.
    #[must_use]
    pub const fn destination(self) -> Destination {
        let address = (self.0 & ADDRESS_MASK) as u8;
        if self.0 & GROUP_BIT != 0 { Destination::Group(Group(address)) } else { Destination::Node(Node(address)) }
    }
}

impl fmt::Debug for CanId {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{:#05X}", self.0)
    }
}

impl From<CanId> for StandardId {
    fn from(id: CanId) -> StandardId {
        // An eleven-bit value always fits; the fallback only spares a panic path in the image.
        StandardId::new(id.0).unwrap_or(StandardId::MAX)
    }
}

impl From<CanId> for Id {
    fn from(id: CanId) -> Id {
        Id::Standard(id.into())
    }
}

/// A classic data frame: eleven-bit identifier, up to eight bytes. Nothing else travels on the arm's bus.
///
/// Use it where frames are stored or built; the decoders take any driver's [`Frame`] as it is.
///
/// ```
/// use puck::{CanFrame, CanId, Group, Node};
///
/// let id = CanId::encode(Node::HOST, Group::ARM);
/// let frame = CanFrame::from_slice(id, &[48]).expect("at most eight bytes");
/// assert_eq!((frame.can_id().raw(), frame.payload()), (0x404, &[48][..]));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CanFrame {
    id: CanId,
    length: u8,
    data: [u8; 8],
}

impl CanFrame {
    /// A frame with the first `N` bytes of payload. Does not compile for more than eight.
    #[must_use]
    pub const fn with_payload<const N: usize>(id: CanId, payload: [u8; N]) -> CanFrame {
        const { assert!(N <= 8, "a classic CAN frame carries at most eight bytes") };
        let mut data = [0; 8];
        let mut index = 0;
        while index < N {
            data[index] = payload[index];
            index += 1;
        }
        CanFrame { id, length: N as u8, data }
    }

    /// A frame with a payload of run-time length; `None` if it is longer than eight bytes.
    #[must_use]
    pub fn from_slice(id: CanId, payload: &[u8]) -> Option<CanFrame> {
        let mut data = [0; 8];
        data.get_mut(..payload.len())?.copy_from_slice(payload);
        Some(CanFrame { id, length: payload.len() as u8, data })
    }

    /// A copy of any driver's frame; `None` for extended and remote frames and for more than eight bytes.
    pub fn copy_of(frame: &impl Frame) -> Option<CanFrame> {
        if frame.is_remote_frame() {
            return None;
        }
        CanFrame::from_slice(classic_id(frame)?, frame.data())
    }

    /// The same frame as a driver's type; `None` only if that driver refuses it.
    #[must_use]
    pub fn convert<F: Frame>(&self) -> Option<F> {
        F::new(self.id, self.payload())
    }

    /// The identifier.
    #[must_use]
    pub const fn can_id(&self) -> CanId {
        self.id
    }

    /// The bytes in bus order.
    #[must_use]
    pub fn payload(&self) -> &[u8] {
        // `length` never exceeds eight; `get` spares the panic path.
        self.data.get(..self.length as usize).unwrap_or(&[])
    }
}

/// The identifier of any frame, if it has eleven bits.
pub(crate) fn classic_id(frame: &impl Frame) -> Option<CanId> {
    match frame.id() {
        Id::Standard(id) => Some(CanId(id.as_raw())),
        Id::Extended(_) => None,
    }
}

impl fmt::Debug for CanFrame {
    /// `0x426#88 00 02 00`, as bus tools print it.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{:?}#", self.id)?;
        for (index, byte) in self.payload().iter().enumerate() {
            let blank = if index == 0 { "" } else { " " };
            write!(formatter, "{blank}{byte:02X}")?;
        }
        Ok(())
    }
}

impl Frame for CanFrame {
    /// `None` for an extended identifier or more than eight bytes.
    fn new(id: impl Into<Id>, data: &[u8]) -> Option<CanFrame> {
        match id.into() {
            Id::Standard(id) => CanFrame::from_slice(CanId(id.as_raw()), data),
            Id::Extended(_) => None,
        }
    }

    /// Always `None`: Barrett's protocol has no remote frames.
    fn new_remote(_id: impl Into<Id>, _dlc: usize) -> Option<CanFrame> {
        None
    }

    fn is_extended(&self) -> bool {
        false
    }

    fn is_remote_frame(&self) -> bool {
        false
    }

    fn id(&self) -> Id {
        self.id.into()
    }

    fn dlc(&self) -> usize {
        self.length as usize
    }

    fn data(&self) -> &[u8] {
        self.payload()
    }
}
