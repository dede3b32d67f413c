//! Position frames: 22-bit two's complement counts, big-endian, three bytes each.
//!
//! Byte 0 (and 3) carry flags in bits 7..6. Barrett's own parsers want bit 7 set, its manual draws it clear: a master
//! masks both bits off, a device sends bit 7. A puck with a secondary encoder answers with six bytes instead of three;
//! both may occur among the replies to one request.

use crate::can::{CanFrame, CanId, Group, Node};
use crate::units::Counts;

/// Bit 7 of the first byte of each position, as devices send it.
const FLAG: u8 = 0x80;
/// The six bits of the first byte that belong to the position.
const HIGH_BITS: u8 = 0x3F;

/// Three bytes to counts: flags masked, sign extended from bit 21.
const fn unpack(high: u8, middle: u8, low: u8) -> Counts {
    Counts(i32::from_be_bytes([0, high & HIGH_BITS, middle, low])).wrapped()
}

/// Counts to three bytes with the flag of a device.
const fn pack(position: Counts) -> [u8; 3] {
    let [_, high, middle, low] = position.0.to_be_bytes();
    [FLAG | (high & HIGH_BITS), middle, low]
}

/// The position and, if there are six bytes, the secondary position; `None` for any other length.
pub(crate) fn decode(payload: &[u8]) -> Option<(Counts, Option<Counts>)> {
    match *payload {
        [high, middle, low] => Some((unpack(high, middle, low), None)),
        [high, middle, low, high2, middle2, low2] => {
            Some((unpack(high, middle, low), Some(unpack(high2, middle2, low2))))
        }
        _ => None,
    }
}

/// A secondary position alone: exactly three bytes.
pub(crate) fn decode_secondary(payload: &[u8]) -> Option<Counts> {
    match *payload {
        [high, middle, low] => Some(unpack(high, middle, low)),
        _ => None,
    }
}

/// Device side: the reply to GET P. What exceeds 22 bits wraps, as on the puck.
#[must_use]
pub fn position_frame(node: Node, primary: Counts, secondary: Option<Counts>) -> CanFrame {
    let id = CanId::encode(node, Group::POSITION_REPLIES);
    let [a, b, c] = pack(primary);
    match secondary {
        None => CanFrame::with_payload(id, [a, b, c]),
        Some(secondary) => {
            let [d, e, f] = pack(secondary);
            CanFrame::with_payload(id, [a, b, c, d, e, f])
        }
    }
}

/// Device side: the reply to GET JP, the secondary position alone.
#[must_use]
pub fn secondary_position_frame(node: Node, secondary: Counts) -> CanFrame {
    CanFrame::with_payload(CanId::encode(node, Group::SECONDARY_POSITION_REPLIES), pack(secondary))
}
