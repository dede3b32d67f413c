//! Which identifiers each CAN controller lets through: everything else never costs the processor an instruction.
//!
//! Every identifier of the arm's bus is named, two a filter element, so the set is exact: 26 of 2048. Rejected are,
//! among others, the safety module's broadcasts to the pucks (0x540), other hosts' questions, and nodes no WAM has.

use puck::{Group, Node};

/// Identifiers of positions: from every motor.
const POSITIONS: usize = Node::ARM.len() + Node::HAND.len();
/// Identifiers of ordinary properties: from every motor, the force/torque sensor and the safety module.
const PROPERTIES: usize = POSITIONS + 2;
/// Identifiers of the sensor's force and torque.
const WRENCHES: usize = 2;

/// Identifiers the arm's bus has for the host.
pub const ARM_IDS: usize = POSITIONS + PROPERTIES + WRENCHES;

/// Identifier of a reply of `node` to `group` (docs/barrett-can.md: group flag, sender, group).
const fn reply(node: Node, group: Group) -> u16 {
    0x400 | (node.number() as u16) << 5 | group.number() as u16
}

/// The identifiers, in filter order.
pub const ARM_ACCEPTED: [u16; ARM_IDS] = {
    let mut ids = [0; ARM_IDS];
    let mut motor = 0;
    while motor < POSITIONS {
        let arm = Node::ARM.len();
        let node = if motor < arm { Node::ARM[motor] } else { Node::HAND[motor - arm] };
        ids[2 * motor] = reply(node, Group::POSITION_REPLIES);
        ids[2 * motor + 1] = reply(node, Group::PROPERTY_REPLIES);
        motor += 1;
    }
    ids[2 * POSITIONS] = reply(Node::FORCE_TORQUE, Group::PROPERTY_REPLIES);
    ids[2 * POSITIONS + 1] = reply(Node::SAFETY_MODULE, Group::PROPERTY_REPLIES);
    ids[2 * POSITIONS + 2] = reply(Node::FORCE_TORQUE, Group::FORCE_REPLIES);
    ids[2 * POSITIONS + 3] = reply(Node::FORCE_TORQUE, Group::TORQUE_REPLIES);
    ids
};

/// Filter elements of the arm's bus.
pub const ARM_ELEMENTS: usize = ARM_IDS.div_ceil(2);

/// Element type: two single identifiers.
const TWO_IDS: u32 = 0b01 << 30;
/// Element type: identifier and mask.
const MASKED: u32 = 0b10 << 30;
/// Element action: into receive queue 0.
const TO_QUEUE_0: u32 = 0b001 << 27;

/// The filter elements as the controller reads them.
pub const ARM_FILTERS: [u32; ARM_ELEMENTS] = {
    let mut elements = [0; ARM_ELEMENTS];
    let mut index = 0;
    while index < ARM_ELEMENTS {
        let first = ARM_ACCEPTED[2 * index];
        // An odd count repeats the last identifier.
        let second = if 2 * index + 1 < ARM_IDS { ARM_ACCEPTED[2 * index + 1] } else { first };
        elements[index] = TWO_IDS | TO_QUEUE_0 | (first as u32) << 16 | second as u32;
        index += 1;
    }
    elements
};

/// Number of this device on the host's bus.
pub const HOST_DEVICE: link::can::DeviceNumber = link::can::DeviceNumber::FIRST;

/// Filter elements of the host's bus: one range, the segments to this device.
pub const HOST_ELEMENTS: usize = 1;

/// The filter element of the host's bus.
pub const HOST_FILTERS: [u32; HOST_ELEMENTS] = {
    let (id, mask) = link::can::filter(link::can::Direction::ToDevice, HOST_DEVICE);
    [MASKED | TO_QUEUE_0 | (id as u32) << 16 | mask as u32]
};

/// True if a controller with these elements, rejecting what matches none, takes a standard data frame. This is the
/// controller's own rule, for the tests.
#[must_use]
pub fn accepts(elements: &[u32], id: u16) -> bool {
    elements.iter().any(|element| {
        let first = (element >> 16 & 0x7FF) as u16;
        let second = (element & 0x7FF) as u16;
        let stored = element & 0b111 << 27 == TO_QUEUE_0;
        stored
            && match element & 0b11 << 30 {
                TWO_IDS => id == first || id == second,
                MASKED => id & second == first & second,
                _ => false,
            }
    })
}
