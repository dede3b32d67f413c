//! A line between host and co-controller that takes no time: for devices that keep the time of their line themselves.

use std::collections::VecDeque;

use sim::{LinkLine, Ticks};

/// Bytes that are at the other end as soon as they are sent.
pub(super) struct UntimedLine {
    to_device: VecDeque<u8>,
    from_device: Vec<u8>,
    chunk: usize,
}

impl UntimedLine {
    /// A line that hands at most `chunk` bytes to the device at a time; the lock step carries no more than [`sim::CHUNK`].
    pub(super) fn new(chunk: usize) -> Self {
        Self { to_device: VecDeque::new(), from_device: Vec::new(), chunk }
    }
}

impl LinkLine for UntimedLine {
    fn send_to_device(&mut self, _now: Ticks, bytes: &[u8]) {
        self.to_device.extend(bytes);
    }

    fn send_from_device(&mut self, _now: Ticks, bytes: &[u8]) {
        self.from_device.extend_from_slice(bytes);
    }

    /// A time that has passed: the device asks at once.
    fn next_time(&self) -> Option<Ticks> {
        (!self.to_device.is_empty()).then_some(0)
    }

    fn take_to_device(&mut self, _now: Ticks) -> Vec<u8> {
        let count = self.to_device.len().min(self.chunk);
        self.to_device.drain(..count).collect()
    }

    fn take_from_device(&mut self, _now: Ticks) -> Vec<u8> {
        std::mem::take(&mut self.from_device)
    }

    fn backlog_from_device(&self, _now: Ticks) -> usize {
        0
    }
}
