//! Settings of a CAN controller, register by register: what is written when it starts, whenever it is brought back, and
//! what it is compared with while it runs (a bit that falls over there would otherwise be seen by nobody).
//!
//! Offsets and fields: RM0433, registers of the FDCAN. All of them keep what is written; none changes by itself.

use super::can::{BitTiming, MessageMemory};

/// A register and its value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Setting {
    /// Byte offset in the controller.
    pub offset: u32,
    /// Its value while the controller runs.
    pub value: u32,
}

/// Registers that are set.
pub const SETTINGS: usize = 15;

/// NBTP, nominal bit timing: jump, prescaler, segments in front of and behind the sample, each less one.
const fn timing(timing: &BitTiming) -> u32 {
    (timing.jump - 1) << 25 | (timing.prescaler - 1) << 16 | (timing.before_sample - 1) << 8 | (timing.after_sample - 1)
}

/// GFC: standard and extended frames that match no filter are rejected (ANFS, ANFE), and so are remote frames of both
/// kinds (RRFS, RRFE).
const REJECT_ALL_ELSE: u32 = 0b10 << 4 | 0b10 << 2 | 0b11;

/// Bits of IR, IE and ILS.
pub mod flag {
    /// A frame has come.
    pub const RECEIVED: u32 = 1 << 0;
    /// A frame was lost.
    pub const LOST: u32 = 1 << 3;
    /// A frame has left.
    pub const SENT: u32 = 1 << 9;
    /// The message memory did not answer in time.
    pub const STARVED: u32 = 1 << 17;
    /// Bus-off has begun or ended.
    pub const BUS_OFF: u32 = 1 << 25;
}

/// Interrupts of the arm's controller.
pub const ARM_INTERRUPTS: u32 = flag::RECEIVED | flag::LOST | flag::SENT | flag::STARVED | flag::BUS_OFF;

/// Of these are told by the second line; the first tells the others.
pub const SECOND_LINE: u32 = flag::SENT;

/// The settings of a controller with this message memory, this timing and these interrupts. Registers left out here
/// keep their values after a reset, or belong to functions that are off.
#[must_use]
pub const fn settings(memory: &MessageMemory, bit: &BitTiming, interrupts: u32) -> [Setting; SETTINGS] {
    const fn set(offset: u32, value: u32) -> Setting {
        Setting { offset, value }
    }
    let lines = if interrupts == 0 { 0 } else { 0b11 };
    [
        // NBTP.
        set(0x01C, timing(bit)),
        // IE, ILS, ILE.
        set(0x054, interrupts),
        set(0x058, interrupts & SECOND_LINE),
        set(0x05C, lines),
        // GFC, SIDFC, XIDFC: standard filters alone.
        set(0x080, REJECT_ALL_ELSE),
        set(0x084, memory.filters << 16 | memory.filters_at << 2),
        set(0x088, 0),
        // RXF0C: a full queue keeps what it has, for the oldest reply belongs to the oldest question. RXF1C: none.
        set(0x0A0, memory.receive << 16 | memory.receive_at << 2),
        set(0x0B0, 0),
        // RXESC, TXESC, TXEFC: elements of eight bytes, no queue of events.
        set(0x0BC, 0),
        set(0x0C8, 0),
        set(0x0F0, 0),
        // TXBC: first in, first out; the order in which the application hands frames over is part of the protocol.
        set(0x0C0, memory.transmit << 24 | memory.transmit_at << 2),
        // TXBTIE: a frame's departure is told only for the places that ask for it. TXBCIE.
        set(0x0E0, if interrupts == 0 { 0 } else { u32::MAX }),
        set(0x0E4, 0),
    ]
}
