//! The host's CAN bus: 1 Mbit/s with the chip's second controller and the host on it.
//!
//! Frames travel to and from the other process as records of 11 bytes (`docs/lockstep.md`). Arbitration, frame times
//! and acknowledgement happen here.

use std::collections::VecDeque;

use fdcan_model::{Controllers, Frame, Id, Unit, WireEvent};

/// Bytes of a record: identifier, length, eight data bytes.
pub const RECORD_BYTES: usize = 11;

/// Nanoseconds of a bit.
const BIT_NS: u64 = 1000;

/// Who sends the frame on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sender {
    Chip,
    Host,
}

/// The wire and both queues.
#[derive(Debug, Default)]
pub struct HostBus {
    from_chip: VecDeque<Frame>,
    from_host: VecDeque<Frame>,
    on_wire: Option<(Sender, Frame, u64)>,
    free_at: u64,
    records: Vec<u8>,
    /// Bytes of a record that has not come whole.
    rest: Vec<u8>,
}

impl HostBus {
    /// The chip's controller offers a frame or takes back what has not begun.
    pub fn take(&mut self, _now: u64, event: WireEvent) {
        match event {
            WireEvent::Offer { frame, .. } => self.from_chip.push_back(frame),
            WireEvent::Withdraw { .. } => self.from_chip.clear(),
        }
    }

    /// The host hands frames over as records.
    pub fn offer(&mut self, now: u64, bytes: &[u8]) {
        self.free_at = self.free_at.max(if self.on_wire.is_none() && self.is_idle() { now } else { 0 });
        self.rest.extend(bytes);
        let whole = self.rest.len() / RECORD_BYTES * RECORD_BYTES;
        let records: Vec<u8> = self.rest.drain(..whole).collect();
        for [low, high, length, data @ ..] in records.as_chunks::<RECORD_BYTES>().0 {
            let data = data.get(..usize::from(*length).min(8)).unwrap_or(&[]);
            self.from_host.push_back(Frame::standard(u16::from_le_bytes([*low, *high]) & 0x7FF, data));
        }
    }

    fn is_idle(&self) -> bool {
        self.from_chip.is_empty() && self.from_host.is_empty()
    }

    /// Frames of the chip that the host has received, as records.
    pub fn take_records(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.records)
    }

    /// When something is due.
    #[must_use]
    pub fn next_time(&self) -> Option<u64> {
        match self.on_wire {
            Some((_, _, end)) => Some(end),
            None => (!self.is_idle()).then_some(self.free_at),
        }
    }

    /// Everything that is due by `now`.
    pub fn advance(&mut self, now: u64, controllers: &mut Controllers) {
        while let Some(at) = self.next_time()
            && at <= now
        {
            if let Some((sender, frame, end)) = self.on_wire.take() {
                self.free_at = end;
                self.finish(sender, &frame, controllers, now);
            } else {
                self.start(now, controllers);
            }
        }
    }

    fn finish(&mut self, sender: Sender, frame: &Frame, controllers: &mut Controllers, now: u64) {
        match sender {
            Sender::Host => controllers.received(Unit::Two, frame, now),
            Sender::Chip => {
                controllers.transmitted(Unit::Two, now);
                let Id::Standard(id) = frame.id else { return };
                self.records.extend(id.to_le_bytes());
                self.records.push(frame.length.min(8));
                self.records.extend(frame.data);
            }
        }
    }

    /// The lowest identifier begins.
    fn start(&mut self, now: u64, controllers: &mut Controllers) {
        let arbitration = |queue: &VecDeque<Frame>| queue.front().map_or(u32::MAX, Frame::arbitration);
        let (sender, queue) = if arbitration(&self.from_chip) <= arbitration(&self.from_host) {
            (Sender::Chip, &mut self.from_chip)
        } else {
            (Sender::Host, &mut self.from_host)
        };
        if sender == Sender::Chip {
            controllers.begun(Unit::Two, now);
        }
        if let Some(frame) = queue.pop_front() {
            self.on_wire = Some((sender, frame, now + u64::from(frame.bits()) * BIT_NS));
        }
    }
}
