//! How long a classic CAN frame occupies the wire: the real bits, counted.
//!
//! Stuffing depends on the content, so a bound or a mean would shift every later frame of a run.
//! SOF, identifier, control, data and CRC-15 are written out and stuffed: after five equal bits the
//! transmitter inserts their complement, and the inserted bit counts for the next run. The CRC delimiter,
//! acknowledge, end of frame and interframe space are fixed-form and never stuffed.
//!
//! Source: Bosch CAN 2.0 part A; lengths agree with the table of wam-can 6.2 (47 + 8n + stuff bits).

use crate::time::{TICKS_PER_BIT, Ticks};
use puck::CanFrame;

/// Generator polynomial of classic CAN's CRC: x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1.
const CRC_POLYNOMIAL: u16 = 0x4599;

/// CRC delimiter 1, acknowledge slot and delimiter 2, end of frame 7.
const UNSTUFFED_TAIL_BITS: u32 = 10;

/// Intermission between two frames, bits. No node may start earlier.
pub const INTERFRAME_BITS: u32 = 3;

/// Bits of a stuffed region without stuff bits, at most: SOF 1 + id 11 + control 7 + data 64 + CRC 15.
const STUFFED_REGION_MAX: usize = 98;

/// The part of a frame that is stuffed, as single bits, dominant = `false`.
struct BitString {
    bits: [bool; STUFFED_REGION_MAX],
    length: usize,
}

impl BitString {
    fn push(&mut self, value: u32, width: u32) {
        for shift in (0..width).rev() {
            self.bits[self.length] = value >> shift & 1 == 1;
            self.length += 1;
        }
    }

    fn written(&self) -> &[bool] {
        &self.bits[..self.length]
    }
}

/// CRC-15 over the unstuffed bits from SOF to the end of the data.
fn crc15(bits: &[bool]) -> u16 {
    bits.iter().fold(0, |register: u16, &bit| {
        let feedback = bit != (register >> 14 & 1 == 1);
        let shifted = register << 1 & 0x7FFF;
        if feedback { shifted ^ CRC_POLYNOMIAL } else { shifted }
    })
}

/// SOF to CRC of a frame, not yet stuffed.
fn stuffed_region(frame: &CanFrame) -> BitString {
    let mut region = BitString { bits: [false; STUFFED_REGION_MAX], length: 0 };
    region.push(0, 1); // start of frame
    region.push(frame.can_id().raw().into(), 11);
    region.push(0, 3); // RTR, IDE and the reserved bit: data frame, base format
    region.push(frame.payload().len() as u32, 4);
    for &byte in frame.payload() {
        region.push(byte.into(), 8);
    }
    let crc = crc15(region.written());
    region.push(crc.into(), 15);
    region
}

/// How many stuff bits the transmitter inserts.
fn stuff_bits(bits: &[bool]) -> u32 {
    let mut inserted = 0;
    let mut run = 0;
    let mut last = None;
    for &bit in bits {
        run = if last == Some(bit) { run + 1 } else { 1 };
        last = Some(bit);
        if run == 5 {
            inserted += 1;
            // The stuff bit is the complement and opens a run of its own.
            last = Some(!bit);
            run = 1;
        }
    }
    inserted
}

/// Bits from SOF to the end of the interframe space.
#[must_use]
pub fn frame_bits(frame: &CanFrame) -> u32 {
    let region = stuffed_region(frame);
    region.length as u32 + stuff_bits(region.written()) + UNSTUFFED_TAIL_BITS + INTERFRAME_BITS
}

/// Time a frame keeps the bus busy, interframe space included.
#[must_use]
pub fn frame_ticks(frame: &CanFrame) -> Ticks {
    Ticks::from(frame_bits(frame)) * TICKS_PER_BIT
}

/// The frame's CRC-15, as a bus analyser would show it.
#[must_use]
pub fn frame_crc(frame: &CanFrame) -> u16 {
    let region = stuffed_region(frame);
    crc15(&region.written()[..region.length - 15])
}
