//! The host link: bytes on the simulator's wire, at the pace of the serial line it models.

use super::device::PERIPHERAL_HZ;
use super::lockstep::Request;
use super::{can, clock};
use crate::board::LinkPort;

/// Bytes the transmitter holds: 22 ms of a full line, several of the longest messages.
const TRANSMIT_DEPTH: u64 = 2048;

/// Bits per second of the line.
const BAUD: u32 = 921_600;

/// Ticks of one byte on the line: start bit, eight bits, stop bit; rounded up, so that the transmitter is never faster
/// than the line.
const BYTE_TICKS: u64 = (PERIPHERAL_HZ as u64 * 10).div_ceil(BAUD as u64);

/// Most bytes in one request to the simulator: its length field is one byte.
const LONGEST_REQUEST: usize = 255;

/// The link as the session sees it.
pub struct Port {
    /// Tick at which all bytes written so far will have left.
    free_at: u64,
}

impl Port {
    pub(super) const fn new() -> Self {
        Self { free_at: 0 }
    }
}

impl LinkPort for Port {
    fn read(&mut self, buffer: &mut [u8]) -> usize {
        can::with(|controller| {
            // Bytes sent while the bus is silent would wait for its next frame: ask for them.
            controller.tell(&Request::Event);
            controller.link.give(buffer)
        })
    }

    fn write(&mut self, bytes: &[u8]) {
        self.free_at = self.free_at.max(clock::now()) + bytes.len() as u64 * BYTE_TICKS;
        for part in bytes.chunks(LONGEST_REQUEST) {
            can::with(|controller| controller.tell(&Request::Link(part)));
        }
    }

    fn room(&self) -> usize {
        let unsent = self.free_at.saturating_sub(clock::now()).div_ceil(BYTE_TICKS);
        TRANSMIT_DEPTH.saturating_sub(unsent) as usize
    }
}
