//! Duration of a classic CAN frame on the wire: the real bits, counted.
//!
//! Stuffing depends on the content, so a bound or a mean would shift every later frame of a run.
//! SOF, identifier, control, data and CRC-15 are written out and stuffed: after five equal bits the
//! transmitter inserts their complement, and the inserted bit counts for the next run. The CRC delimiter,
//! acknowledge, end of frame and interframe space are fixed-form and never stuffed.
//!
//! Source: Bosch CAN 2.0 part A; lengths agree with the table of docs/barrett-can.md (47 + 8n + stuff bits).

use crate::time::{TICKS_PER_BIT, Ticks};
use puck::{CanFrame, Node};

/// Generator polynomial of classic CAN's CRC: x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1.
const CRC_POLYNOMIAL: u16 = 0x4599;

/// CRC delimiter 1, acknowledge slot and delimiter 2, end of frame 7.
const UNSTUFFED_TAIL_BITS: u32 = 10;

/// Intermission between two frames, bits. No node may start earlier.
pub const INTERFRAME_BITS: u32 = 3;

/// SOF 1, identifier 11, RTR, IDE and reserved bit 3, length 4.
const HEADER_BITS: u32 = 19;

/// Bits of the checksum.
const CRC_BITS: u32 = 15;

/// Effect of one byte on the checksum, for each value of the register's upper eight bits combined with it.
const CRC_TABLE: [u16; 256] = {
    let mut table = [0; 256];
    let mut index = 0;
    while index < table.len() {
        let mut register = (index as u16) << (CRC_BITS - 8);
        let mut bit = 0;
        while bit < 8 {
            let carry = register >> (CRC_BITS - 1) & 1;
            register = (register << 1 & 0x7FFF) ^ (carry * CRC_POLYNOMIAL);
            bit += 1;
        }
        table[index] = register;
        index += 1;
    }
    table
};

/// A frame on the wire, or one that has just left it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passage {
    /// Start of frame.
    pub start: Ticks,
    /// End of the interframe space: the bus is free again.
    pub end: Ticks,
    /// Who transmits. The host is [`Node::HOST`].
    pub sender: Node,
    /// The frame.
    pub frame: CanFrame,
}

impl Passage {
    /// When every receiver has the frame: end of frame, three bits before the bus is free.
    #[must_use]
    pub fn received_at(&self) -> Ticks {
        self.end - Ticks::from(INTERFRAME_BITS) * TICKS_PER_BIT
    }
}

/// SOF, identifier, control: the first bits on the wire, dominant = 0, as a number.
fn header(frame: &CanFrame) -> u32 {
    // SOF, RTR, IDE and the reserved bit are all dominant.
    u32::from(frame.can_id().raw()) << 7 | frame.payload().len() as u32
}

/// The frame's CRC-15, over the unstuffed bits from SOF to the end of the data, as a bus analyser would show it.
#[must_use]
pub fn frame_crc(frame: &CanFrame) -> u16 {
    // The register starts at zero, so that the leading zeros which fill the header up to whole bytes change nothing.
    let [_, high, middle, low] = header(frame).to_be_bytes();
    [high, middle, low].iter().chain(frame.payload()).fold(0, |register: u16, byte| {
        let index = (register >> (CRC_BITS - 8)) as u8 ^ byte;
        (register << 8 & 0x7FFF) ^ CRC_TABLE[usize::from(index)]
    })
}

/// SOF to CRC of a frame, not yet stuffed: the bits at the upper end of the number, and how many.
fn stuffed_region(frame: &CanFrame) -> (u128, u32) {
    let data = frame.payload().iter().fold(u128::from(header(frame)), |bits, byte| bits << 8 | u128::from(*byte));
    let length = HEADER_BITS + 8 * frame.payload().len() as u32 + CRC_BITS;
    let bits = data << CRC_BITS | u128::from(frame_crc(frame));
    (bits << (u128::BITS - length), length)
}

/// The wire as the stuffing rule sees it: the last level times 5, plus how many bits have had it (0: before SOF; at
/// most 4).
type Run = u8;

/// A recessive wire before SOF.
const AT_REST: Run = 5;

/// One bit: the run it leaves behind, and whether a stuff bit follows it.
const fn extend(run: Run, bit: bool) -> (Run, bool) {
    let level = bit as Run * 5;
    let length = if run / 5 == bit as Run { run % 5 + 1 } else { 1 };
    // The stuff bit is the complement and opens a run of its own.
    if length == 5 { ((5 - level) + 1, true) } else { (level + length, false) }
}

/// For each run and each byte: the run it leaves behind, and the stuff bits it draws.
const STUFFING: [[(Run, u8); 256]; 10] = {
    let mut table = [[(0, 0); 256]; 10];
    let mut before = 0;
    while before < table.len() {
        let mut byte = 0;
        while byte < 256 {
            let (mut run, mut inserted, mut bit) = (before as Run, 0, 8);
            while bit > 0 {
                bit -= 1;
                let (next, is_stuffed) = extend(run, byte >> bit & 1 == 1);
                run = next;
                inserted += is_stuffed as u8;
            }
            table[before][byte] = (run, inserted);
            byte += 1;
        }
        before += 1;
    }
    table
};

/// Returns the number of stuff bits that the transmitter inserts into `length` bits, which start at the upper end of
/// `bits`.
fn stuff_bits(bits: u128, length: u32) -> u32 {
    let (mut run, mut inserted) = (AT_REST, 0);
    let odd = length % 8;
    for bit in 0..odd {
        let (next, is_stuffed) = extend(run, bits >> (u128::BITS - 1 - bit) & 1 == 1);
        (run, inserted) = (next, inserted + u32::from(is_stuffed));
    }
    for byte in (bits << odd).to_be_bytes().iter().take((length / 8) as usize) {
        let (next, count) = STUFFING[usize::from(run)][usize::from(*byte)];
        (run, inserted) = (next, inserted + u32::from(count));
    }
    inserted
}

/// Bits from SOF to the end of the interframe space.
#[must_use]
pub fn frame_bits(frame: &CanFrame) -> u32 {
    let (bits, length) = stuffed_region(frame);
    length + stuff_bits(bits, length) + UNSTUFFED_TAIL_BITS + INTERFRAME_BITS
}

/// Time a frame keeps the bus busy, interframe space included.
#[must_use]
pub fn frame_ticks(frame: &CanFrame) -> Ticks {
    Ticks::from(frame_bits(frame)) * TICKS_PER_BIT
}
