//! Tactile frames of the hand: 24 cells of 12 bits in five frames, or the ten highest in one.

use crate::bits::appended;
use crate::can::{CanFrame, CanId, Group, Node};
use crate::units::Real;

/// N/cm^2 per count of a full cell (exact in binary).
pub const NEWTON_PER_SQUARE_CENTIMETRE_PER_COUNT: f64 = 1.0 / 256.0;
/// Cells of one array.
pub const CELLS: usize = 24;

/// TACT: which frames a tactile puck sends. Setting it also triggers one reply at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum TactileFormat {
    /// 0: nothing.
    Off,
    /// 1: the ten highest cells, one frame.
    TopTen,
    /// 2: all cells, five frames.
    Full,
    /// 3: make the present pressure the zero.
    Tare,
}

impl TactileFormat {
    /// The value of TACT.
    #[must_use]
    pub const fn value(self) -> i32 {
        self as i32
    }
}

/// One of the five frames of a full tactile reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct TactileBlock {
    /// 0..=4: the block holds cells `5 * sequence` and following.
    pub sequence: u8,
    /// Five 12-bit cells, 1/256 N/cm^2 per count. The fifth of block 4 does not exist; it reads as sent, usually 0.
    pub cells: [u16; 5],
}

impl TactileBlock {
    /// Number of cells that exist: five, and four in the last block.
    #[must_use]
    pub const fn cell_count(&self) -> usize {
        if self.sequence == 4 { 4 } else { 5 }
    }

    /// The pressures in N/cm^2.
    #[must_use]
    pub fn pressures<R: Real>(&self) -> [R; 5] {
        self.cells.map(|cell| R::from_i32(cell as i32) * R::from_f64(NEWTON_PER_SQUARE_CENTIMETRE_PER_COUNT))
    }

    /// `NNNN AAAAAAAAAAAA BBBBBBBBBBBB ...` as one big-endian integer; `None` for another length or a sequence above 4.
    pub(crate) fn decode(payload: &[u8]) -> Option<TactileBlock> {
        let bits = u64::from_be_bytes(payload.try_into().ok()?);
        let sequence = (bits >> 60) as u8;
        let cell = |index: u64| (bits >> (48 - 12 * index)) as u16 & 0xFFF;
        (sequence <= 4).then(|| TactileBlock { sequence, cells: [cell(0), cell(1), cell(2), cell(3), cell(4)] })
    }

    /// Device side: the frame. Sequence and cells are cut to four and twelve bits.
    #[must_use]
    pub fn frame(&self, node: Node) -> CanFrame {
        let bits = self
            .cells
            .iter()
            .fold((self.sequence & 0xF) as u64, |bits, cell| appended(bits, 12, (*cell & 0xFFF) as u64));
        CanFrame::with_payload(CanId::encode(node, Group::TACTILE_FULL_REPLIES), bits.to_be_bytes())
    }
}

/// The ten highest cells of one array.
///
/// Two drivers disagree on which bit of the map is cell 0 (most significant, or least significant first): this type
/// keeps the map as sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct TactileTop {
    /// Bytes 0..=2, the first in bits 23..16: a set bit for each cell that has a value below.
    pub map: u32,
    /// Ten values of four bits, N/cm^2, in the order of the set bits.
    pub values: [u8; 10],
}

impl TactileTop {
    /// `None` unless there are eight bytes.
    pub(crate) fn decode(payload: &[u8]) -> Option<TactileTop> {
        let bits = u64::from_be_bytes(payload.try_into().ok()?);
        let mut values = [0; 10];
        for (value, shift) in values.iter_mut().rev().zip((0_u32..).step_by(4)) {
            *value = (bits >> shift) as u8 & 0xF;
        }
        Some(TactileTop { map: (bits >> 40) as u32, values })
    }

    /// Device side: the frame. Map and values are cut to 24 and four bits.
    #[must_use]
    pub fn frame(&self, node: Node) -> CanFrame {
        let map = (self.map & 0xFF_FFFF) as u64;
        let bits = self.values.iter().fold(map, |bits, value| appended(bits, 4, (*value & 0xF) as u64));
        CanFrame::with_payload(CanId::encode(node, Group::TACTILE_TOP_REPLIES), bits.to_be_bytes())
    }
}
