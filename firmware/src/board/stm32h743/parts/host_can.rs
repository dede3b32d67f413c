//! The second CAN bus as a line to the host: the link's bytes in segments (`link::can`).
//!
//! Without interrupts: the controller holds 7 ms of received and 3.5 ms of waiting frames, and the session comes by
//! every 1.1 ms. Bytes wait in a queue of their own and are cut into segments only when the controller has room for a
//! frame, so that frames are full while the line is busy.

use heapless::Deque;
use link::can::{Direction, Reassembler, SEGMENT_BYTES, Segmenter};

use super::super::constants::filters::HOST_DEVICE;
use super::super::constants::lines::TRANSMIT_BYTES;
use super::fdcan::{HOST_CONTROLLER, Row};
use crate::board::LinkPort;

/// The line as the selector sees it.
pub struct HostCan {
    /// True if the controller runs. One that does not hears nothing, so the conversation is never here.
    runs: bool,
    segmenter: Segmenter,
    reassembler: Reassembler,
    to_send: Deque<u8, TRANSMIT_BYTES>,
    row: Row,
}

impl HostCan {
    /// Nothing sent, nothing received; `runs` tells whether the controller was started.
    pub(super) const fn new(runs: bool) -> Self {
        Self {
            runs,
            segmenter: Segmenter::new(Direction::ToHost, HOST_DEVICE),
            reassembler: Reassembler::new(Direction::ToDevice, HOST_DEVICE),
            to_send: Deque::new(),
            row: Row::NONE,
        }
    }

    /// Fills the controller.
    fn pump(&mut self) {
        while HOST_CONTROLLER.room() > 0 && !self.to_send.is_empty() {
            let mut bytes = [0; SEGMENT_BYTES];
            let mut count = 0;
            for place in &mut bytes {
                let Some(byte) = self.to_send.pop_front() else { break };
                *place = byte;
                count += 1;
            }
            if let Some(segment) = self.segmenter.cut(&mut bytes.get(..count).unwrap_or(&[])) {
                // There is room, see above; a segment that is lost all the same is noticed by its number.
                let _ = HOST_CONTROLLER.send(segment.id(), segment.data(), false);
            }
        }
    }
}

impl LinkPort for HostCan {
    fn read(&mut self, buffer: &mut [u8]) -> usize {
        if !self.runs {
            return 0;
        }
        // A controller that has left the bus, because nobody answers on it or for any other reason, comes back.
        HOST_CONTROLLER.tend();
        self.pump();
        let mut count = 0;
        // A segment is taken only if all it may bring fits: a segment and the mark of a loss before it.
        while buffer.len() - count > SEGMENT_BYTES {
            let Some((id, length, data)) = HOST_CONTROLLER.fetch(&mut self.row) else { break };
            let piece = self.reassembler.take(id, data.get(..length).unwrap_or(&[]));
            for (place, byte) in buffer.iter_mut().skip(count).zip(piece.iter()) {
                *place = *byte;
                count += 1;
            }
        }
        if self.row.is_endless() {
            self.row = Row::NONE;
            HOST_CONTROLLER.bring_back();
        }
        count
    }

    fn write(&mut self, bytes: &[u8]) {
        for byte in bytes {
            // Cannot fail within `room`.
            let _ = self.to_send.push_back(*byte);
        }
        self.pump();
    }

    fn room(&self) -> usize {
        TRANSMIT_BYTES - self.to_send.len()
    }
}
