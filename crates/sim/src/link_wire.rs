//! The line between host and co-controller in virtual time: any [`LinkLine`], the serial one, 921 600 baud 8N1, and one
//! without delay.
//!
//! On the serial line, towards the device, bytes are handed over in chunks of at most 64, as a UART with DMA and an
//! idle-line interrupt does: one event per chunk instead of one per byte. A chunk becomes due when its last byte has
//! arrived.

use crate::time::Ticks;
use std::collections::VecDeque;

/// Ten bit times at 921 600 baud: 271.27 ticks, rounded down (0.1 % fast, within what a real divider does).
pub const BYTE_TICKS: Ticks = 271;

/// Most bytes that one event hands to the device.
pub const CHUNK: usize = 64;

/// Carries the bytes of the host link between host and co-controller.
///
/// Everything happens at the `now` it is told, which never goes backwards; what was begun keeps its end.
pub trait LinkLine: Send {
    /// The host sends bytes; transmission begins at `now` or when the line is free.
    fn send_to_device(&mut self, now: Ticks, bytes: &[u8]);

    /// The device sends bytes.
    fn send_from_device(&mut self, now: Ticks, bytes: &[u8]);

    /// When the device must look next: bytes towards it are complete, or the line itself has something to do.
    fn next_time(&self) -> Option<Ticks>;

    /// Bytes that have reached the device by `now`, at most [`CHUNK`] of them.
    fn take_to_device(&mut self, now: Ticks) -> Vec<u8>;

    /// Returns the bytes that the host has received by `now`.
    fn take_from_device(&mut self, now: Ticks) -> Vec<u8>;

    /// Bytes that the device has handed over and that have not left by `now`.
    fn backlog_from_device(&self, now: Ticks) -> usize;
}

/// Both directions of the serial line.
#[derive(Clone, Debug, Default)]
pub(crate) struct SerialLine {
    to_device: VecDeque<(Ticks, u8)>,
    to_device_free: Ticks,
    from_device: VecDeque<(Ticks, u8)>,
    from_device_free: Ticks,
}

impl LinkLine for SerialLine {
    fn send_to_device(&mut self, now: Ticks, bytes: &[u8]) {
        transmit(&mut self.to_device, &mut self.to_device_free, now, bytes);
    }

    fn send_from_device(&mut self, now: Ticks, bytes: &[u8]) {
        transmit(&mut self.from_device, &mut self.from_device_free, now, bytes);
    }

    /// When the next chunk towards the device is complete.
    fn next_time(&self) -> Option<Ticks> {
        let due = self.to_device.iter().take(CHUNK).map(|(due, _)| *due);
        // A gap on the line ends a chunk.
        due.scan(None, |previous: &mut Option<Ticks>, due| {
            let is_contiguous = previous.is_none_or(|before| due - before <= BYTE_TICKS);
            *previous = Some(due);
            is_contiguous.then_some(due)
        })
        .last()
    }

    /// The chunk that is complete by `now`, or nothing.
    fn take_to_device(&mut self, now: Ticks) -> Vec<u8> {
        match self.next_time() {
            Some(due) if due <= now => take_due(&mut self.to_device, due),
            _ => Vec::new(),
        }
    }

    fn take_from_device(&mut self, now: Ticks) -> Vec<u8> {
        take_due(&mut self.from_device, now)
    }

    fn backlog_from_device(&self, now: Ticks) -> usize {
        self.from_device.iter().filter(|(due, _)| *due > now).count()
    }
}

/// A line that takes no time, for a device that does its own: what one side sends the other has at once.
#[derive(Clone, Debug)]
pub struct PlainLine {
    to_device: VecDeque<u8>,
    /// When the oldest bytes towards the device were sent.
    offered_at: Ticks,
    from_device: VecDeque<u8>,
    /// Bytes that must not be handed to the device apart.
    record: usize,
}

impl PlainLine {
    /// A line of records of 1 to [`CHUNK`] bytes: the host sends whole ones, and the device gets whole ones.
    #[must_use]
    pub fn of_records(bytes: usize) -> Self {
        Self { to_device: VecDeque::new(), offered_at: 0, from_device: VecDeque::new(), record: bytes.clamp(1, CHUNK) }
    }
}

impl Default for PlainLine {
    /// A line of single bytes.
    fn default() -> Self {
        Self::of_records(1)
    }
}

impl LinkLine for PlainLine {
    fn send_to_device(&mut self, now: Ticks, bytes: &[u8]) {
        if self.to_device.is_empty() {
            self.offered_at = now;
        }
        self.to_device.extend(bytes);
    }

    fn send_from_device(&mut self, _now: Ticks, bytes: &[u8]) {
        self.from_device.extend(bytes);
    }

    fn next_time(&self) -> Option<Ticks> {
        (!self.to_device.is_empty()).then_some(self.offered_at)
    }

    fn take_to_device(&mut self, _now: Ticks) -> Vec<u8> {
        let count = self.to_device.len().min(CHUNK);
        let count = count - count % self.record;
        self.to_device.drain(..count).collect()
    }

    fn take_from_device(&mut self, _now: Ticks) -> Vec<u8> {
        self.from_device.drain(..).collect()
    }

    fn backlog_from_device(&self, _now: Ticks) -> usize {
        0
    }
}

fn transmit(line: &mut VecDeque<(Ticks, u8)>, free: &mut Ticks, now: Ticks, bytes: &[u8]) {
    *free = (*free).max(now);
    for &byte in bytes {
        *free += BYTE_TICKS;
        line.push_back((*free, byte));
    }
}

fn take_due(line: &mut VecDeque<(Ticks, u8)>, now: Ticks) -> Vec<u8> {
    let count = line.iter().take_while(|(due, _)| *due <= now).count();
    line.drain(..count).map(|(_, byte)| byte).collect()
}
