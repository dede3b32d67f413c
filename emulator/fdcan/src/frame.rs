//! A classic CAN frame: its content, its place in arbitration, its bits on the wire.
//!
//! Source: Bosch CAN 2.0, parts A and B.

/// Generator polynomial of the checksum: x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1.
const CRC_POLYNOMIAL: u16 = 0x4599;
/// Bits of the checksum.
const CRC_BITS: u32 = 15;
/// After five equal bits the transmitter inserts their complement.
const STUFF_AFTER: u32 = 5;
/// Delimiter of the checksum 1, acknowledge slot and delimiter 2, end of frame 7: never stuffed.
const TAIL_BITS: u32 = 10;
/// Intermission between two frames.
pub(crate) const INTERMISSION_BITS: u32 = 3;

/// Identifier of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Id {
    /// 11 bits.
    Standard(u16),
    /// 29 bits.
    Extended(u32),
}

/// A data frame or a remote frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Identifier.
    pub id: Id,
    /// A remote frame carries a length but no data.
    pub remote: bool,
    /// Data bytes, 0 to 8.
    pub length: u8,
    /// Data; bytes from `length` on mean nothing.
    pub data: [u8; 8],
}

impl Frame {
    /// A data frame with an identifier of 11 bits; bits and bytes that are too many are left out.
    #[must_use]
    pub fn standard(id: u16, data: &[u8]) -> Self {
        let mut frame = Self { id: Id::Standard(id & 0x7FF), remote: false, length: 0, data: [0; 8] };
        for (place, byte) in frame.data.iter_mut().zip(data) {
            *place = *byte;
            frame.length += 1;
        }
        frame
    }

    /// The data, without the bytes that mean nothing; empty for a remote frame.
    #[must_use]
    pub fn payload(&self) -> &[u8] {
        let length = if self.remote { 0 } else { usize::from(self.length) };
        self.data.get(..length).unwrap_or(&self.data)
    }

    /// Place in arbitration: among frames that start together the one with the lowest number wins.
    #[must_use]
    pub fn arbitration(&self) -> u32 {
        let remote = u32::from(self.remote);
        match self.id {
            Id::Standard(id) => u32::from(id & 0x7FF) << 21 | remote << 20,
            Id::Extended(id) => (id >> 18 & 0x7FF) << 21 | 0b11 << 19 | (id & 0x3_FFFF) << 1 | remote,
        }
    }

    /// Bits from the start of frame to the end of the intermission, stuff bits included.
    #[must_use]
    pub fn bits(&self) -> u32 {
        self.stuffed_bits() + TAIL_BITS + INTERMISSION_BITS
    }

    /// Bits from the start of frame to the last bit of the checksum, stuff bits included.
    pub(crate) fn stuffed_bits(&self) -> u32 {
        let mut line = Serialiser::default();
        let remote = u32::from(self.remote);
        line.put(0, 1);
        match self.id {
            // Identifier, remote request, two dominant bits.
            Id::Standard(id) => line.put(u32::from(id & 0x7FF) << 3 | remote << 2, 14),
            Id::Extended(id) => {
                // Upper 11 bits, substitute remote request and identifier extension; the rest; two dominant bits.
                line.put((id >> 18 & 0x7FF) << 2 | 0b11, 13);
                line.put((id & 0x3_FFFF) << 3 | remote << 2, 21);
            }
        }
        line.put(u32::from(self.length), 4);
        for byte in self.payload() {
            line.put(u32::from(*byte), 8);
        }
        line.put(u32::from(line.crc), CRC_BITS);
        line.bits
    }
}

/// The transmitter's output: checksum and stuff bits.
#[derive(Default)]
struct Serialiser {
    crc: u16,
    level: bool,
    run: u32,
    bits: u32,
}

impl Serialiser {
    /// Appends the lowest `count` bits of `value`, the highest first.
    fn put(&mut self, value: u32, count: u32) {
        for shift in (0..count).rev() {
            let bit = value >> shift & 1 == 1;
            let carry = (self.crc >> (CRC_BITS - 1) & 1 == 1) != bit;
            self.crc = (self.crc << 1 & 0x7FFF) ^ if carry { CRC_POLYNOMIAL } else { 0 };
            self.run = if bit == self.level { self.run + 1 } else { 1 };
            self.level = bit;
            self.bits += 1;
            if self.run == STUFF_AFTER {
                (self.level, self.run) = (!bit, 1);
                self.bits += 1;
            }
        }
    }
}
