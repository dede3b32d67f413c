//! `Buffer`: bytes from the host that the session has not fetched yet.

/// Received bytes held until the session fetches them: 11 ms of a full line.
const DEPTH: usize = 1024;

/// Bytes from the host: a ring, filled and emptied in runs. Both happen while everything waits, as on a real board only
/// silicon would; byte by byte, 128 of them would delay a slot by 6 us.
pub(super) struct Buffer {
    bytes: [u8; DEPTH],
    /// Place of the oldest byte.
    first: usize,
    count: usize,
}

impl Buffer {
    pub(super) const fn new() -> Self {
        Self { bytes: [0; DEPTH], first: 0, count: 0 }
    }

    /// Keeps received bytes as long as there is room; see [`crate::board::LinkPort::read`].
    pub(super) fn take(&mut self, mut bytes: &[u8]) {
        while !bytes.is_empty() && self.count < DEPTH {
            let free = (self.first + self.count) % DEPTH;
            let run = bytes.len().min(DEPTH - self.count).min(DEPTH - free);
            let (Some(to), Some((from, rest))) = (self.bytes.get_mut(free..free + run), bytes.split_at_checked(run))
            else {
                return;
            };
            to.copy_from_slice(from);
            self.count += run;
            bytes = rest;
        }
    }

    /// Moves the oldest bytes into `buffer`, and returns how many.
    pub(super) fn give(&mut self, buffer: &mut [u8]) -> usize {
        let mut given = 0;
        while self.count > 0 {
            let rest = buffer.get_mut(given..).unwrap_or_default();
            let run = rest.len().min(self.count).min(DEPTH - self.first);
            let (Some(to), Some(from)) = (rest.get_mut(..run), self.bytes.get(self.first..self.first + run)) else {
                break;
            };
            if run == 0 {
                break;
            }
            to.copy_from_slice(from);
            self.first = (self.first + run) % DEPTH;
            self.count -= run;
            given += run;
        }
        given
    }
}
