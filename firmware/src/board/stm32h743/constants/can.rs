//! Bit timing, queues and message memory of the two CAN controllers.
//!
//! FDCAN1 is the arm's bus, FDCAN2 a bus to the host. Both are classic CAN at 1 Mbit/s.

use super::clocks::CAN_HZ;
use super::filters;

/// One bit: one quantum to synchronise, `before_sample` quanta, the sample, `after_sample` quanta.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitTiming {
    /// Ticks of the kernel clock in a quantum.
    pub prescaler: u32,
    /// Quanta between the synchronisation quantum and the sample point (propagation and phase segment 1).
    pub before_sample: u32,
    /// Quanta after the sample point (phase segment 2).
    pub after_sample: u32,
    /// Most quanta by which one edge may shift the sample point.
    pub jump: u32,
}

impl BitTiming {
    /// Quanta of a bit.
    #[must_use]
    pub const fn quanta(&self) -> u32 {
        1 + self.before_sample + self.after_sample
    }

    /// Bits per second at the kernel clock [`CAN_HZ`].
    #[must_use]
    pub const fn bits_per_second(&self) -> u32 {
        CAN_HZ / (self.prescaler * self.quanta())
    }

    /// Where in the bit it is sampled, per mille.
    #[must_use]
    pub const fn sample_point_per_mille(&self) -> u32 {
        1000 * (1 + self.before_sample) / self.quanta()
    }
}

/// The timing Barrett's manual gives for the arm: 1 Mbit/s, 8 quanta, sampled at 75 %, jump of one quantum. A node that
/// samples elsewhere works on a short bus and fails on a long one.
pub const BIT_TIMING: BitTiming = BitTiming { prescaler: 10, before_sample: 5, after_sample: 2, jump: 1 };

/// The same from the 40 MHz that the chip's own oscillator makes.
pub const BIT_TIMING_OF_HSI: BitTiming = BitTiming { prescaler: 5, ..BIT_TIMING };

/// Bits per second of both buses.
pub const BITS_PER_SECOND: u32 = 1_000_000;

/// Bits of CCCR that name a mode, none of which is set while a controller sends and receives as it should:
/// initialisation, configuration, restricted operation, clock stop and its answer, bus monitoring, no repetition, test,
/// flexible data rate and what belongs to it. The bits between and above them are reserved.
pub const MODE_BITS: u32 = 0xF3FF;

/// Words of a queue element: two of head, two for the eight bytes.
pub const ELEMENT_WORDS: u32 = 4;

/// Words of the message memory that both controllers share.
pub const MEMORY_WORDS: u32 = 2560;

/// Where one controller keeps what in the shared message memory, in words; sizes in elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MessageMemory {
    /// First word of the filters.
    pub filters_at: u32,
    /// Filter elements, one word each.
    pub filters: u32,
    /// First word of the receive queue.
    pub receive_at: u32,
    /// Frames the receive queue holds; at most 64.
    pub receive: u32,
    /// First word of the transmit queue.
    pub transmit_at: u32,
    /// Frames the transmit queue holds; at most 32.
    pub transmit: u32,
}

impl MessageMemory {
    /// Queues one behind the other from word `at` on.
    const fn from(at: u32, filters: u32, receive: u32, transmit: u32) -> Self {
        let receive_at = at + filters;
        let transmit_at = receive_at + receive * ELEMENT_WORDS;
        Self { filters_at: at, filters, receive_at, receive, transmit_at, transmit }
    }

    /// First word behind it.
    #[must_use]
    pub const fn end(&self) -> u32 {
        self.transmit_at + self.transmit * ELEMENT_WORDS
    }
}

/// The arm's bus. Receive: 32 frames, more than the 24 of the shortest that fit into a slot of 1.11 ms, while
/// `CAN_RECEIVE` waits for the control slot for at most half of that. Transmit: 8 frames, all that a cycle sends
/// (questions, torques of arm, wrist and hand, one slow question), so the controller never waits for software within a
/// cycle; no more, because what waits there cannot be taken back for a newer torque.
pub const ARM: MessageMemory = MessageMemory::from(0, filters::ARM_ELEMENTS as u32, 32, 8);

/// The host's bus. Receive: 64 frames, 7 ms of a full line; the session fetches them every 1.1 ms. Transmit: 32 frames,
/// 3.5 ms of a full line, so that the line stays busy between two visits of the session.
pub const HOST: MessageMemory = MessageMemory::from(ARM.end(), filters::HOST_ELEMENTS as u32, 64, 32);

/// First revision of the chip (REV_ID) on which both controllers may run: before it (revisions Z, Y, W) the processor
/// may read wrong words from the message memory while both are active (errata sheet ES0392, 2.24.2).
const FIRST_REVISION_FOR_BOTH: u16 = 0x2001;

/// True if a chip of this revision bears the host's bus beside the arm's.
#[must_use]
pub const fn bears_both(revision: u16) -> bool {
    revision >= FIRST_REVISION_FOR_BOTH
}
