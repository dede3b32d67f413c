//! One of the two receive FIFOs: indices, fill level, storing a frame.
//!
//! Source: RM0433, Rx FIFOs, Rx buffer and FIFO element, registers RXFnC, RXFnS, RXFnA, RXESC.

use crate::filter::Verdict;
use crate::frame::{Frame, Id};
use crate::memory::Memory;
use crate::registers::ir;

/// Words of an element for each code of a data field size.
pub(crate) const ELEMENT_WORDS: [u32; 8] = [4, 5, 6, 7, 8, 10, 14, 18];

/// First word of an element: the identifier has 29 bits.
pub(crate) const EXTENDED: u32 = 1 << 30;
/// First word of an element: a remote frame.
pub(crate) const REMOTE: u32 = 1 << 29;

/// Configuration of a FIFO.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layout {
    start: u32,
    element: u32,
    size: u32,
    watermark: u32,
    overwrites: bool,
}

impl Layout {
    /// From RXFnC and the code of the data field size in RXESC.
    pub(crate) fn new(rxfc: u32, size_code: u32) -> Self {
        Self {
            start: (rxfc & 0xFFFC) / 4,
            element: ELEMENT_WORDS[(size_code & 0b111) as usize],
            // More than 64 count as 64.
            size: (rxfc >> 16 & 0x7F).min(64),
            watermark: rxfc >> 24 & 0x7F,
            overwrites: rxfc >> 31 == 1,
        }
    }
}

/// Result of storing a frame.
pub(crate) struct Stored {
    /// Flags of IR, as for FIFO 0.
    pub(crate) flags: u32,
    /// The place it went to.
    pub(crate) index: Option<u32>,
    /// An element did not fit into the message memory.
    pub(crate) outside: bool,
}

/// Get index and fill level; the put index follows from both.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ReceiveFifo {
    get: u32,
    fill: u32,
    /// The get index does not move, whatever is acknowledged, and a frame seems to be there.
    stuck: bool,
}

impl ReceiveFifo {
    /// RXFnS, without the bit "lost", which is a copy of IR.
    pub(crate) fn status(&self, layout: &Layout) -> u32 {
        if self.stuck {
            return self.fill.max(1) | self.get << 8;
        }
        let full = u32::from(layout.size > 0 && self.fill == layout.size);
        let put = if layout.size > 0 { (self.get + self.fill) % layout.size } else { 0 };
        self.fill | self.get << 8 | put << 16 | full << 24
    }

    /// RXFnA: everything up to `index` has been read. `false` if that was not among what the FIFO holds.
    pub(crate) fn acknowledge(&mut self, layout: &Layout, index: u32) -> bool {
        if layout.size == 0 || index >= layout.size {
            return false;
        }
        if self.stuck {
            return true;
        }
        let taken = (index + layout.size - self.get) % layout.size + 1;
        let is_held = taken <= self.fill;
        let put = self.get + self.fill;
        self.get = (index + 1) % layout.size;
        // The silicon does not check: a wrong index moves the get index all the same.
        self.fill = if is_held { self.fill - taken } else { (put + layout.size - self.get) % layout.size };
        is_held
    }

    /// From now on nothing that is acknowledged leaves, until the configuration is opened.
    pub(crate) fn get_stuck(&mut self) {
        self.stuck = true;
    }

    /// Stores a frame.
    pub(crate) fn store(&mut self, layout: &Layout, memory: &mut Memory, frame: &Frame, verdict: &Verdict) -> Stored {
        let is_full = self.fill >= layout.size;
        if is_full && (!layout.overwrites || layout.size == 0) {
            return Stored { flags: ir::LOST, index: None, outside: false };
        }
        if is_full {
            self.get = (self.get + 1) % layout.size;
            self.fill -= 1;
        }
        let index = (self.get + self.fill) % layout.size;
        let is_inside = write_element(memory, layout.start + index * layout.element, frame, verdict.element);
        self.fill += 1;
        let mut flags = ir::NEW;
        // A watermark of 0 is switched off.
        if self.fill == layout.watermark {
            flags |= ir::WATERMARK;
        }
        if self.fill == layout.size {
            flags |= ir::FULL;
        }
        Stored { flags, index: Some(index), outside: !is_inside }
    }
}

/// Writes an element, data words only as far as the frame has data. [M: bytes behind the data are written as 0]
fn write_element(memory: &mut Memory, at: u32, frame: &Frame, element: Option<u32>) -> bool {
    let id = match frame.id {
        Id::Standard(id) => u32::from(id) << 18,
        Id::Extended(id) => id | EXTENDED,
    };
    let matched = element.map_or(1 << 31, |index| index << 24);
    let mut inside = memory.set(at, id | if frame.remote { REMOTE } else { 0 });
    // No time stamp: the model has no time stamp counter.
    inside &= memory.set(at + 1, u32::from(frame.length.min(8)) << 16 | matched);
    for (word, bytes) in frame.payload().chunks(4).enumerate() {
        let value = bytes.iter().rev().fold(0, |value, byte| value << 8 | u32::from(*byte));
        inside &= memory.set(at + 2 + word as u32, value);
    }
    inside
}
