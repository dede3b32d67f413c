//! The receive path of a puck: a shallow buffer that loses requests when they come too fast.
//!
//! This is the failure that the library's "blocking" SET (SET, then GET STAT and wait) guards against: there is no
//! acknowledgement, so a lost SET is silent. Depth and processing times are assumptions (docs/barrett-can.md): the
//! reply latency of 75 us is Barrett's own estimate, the rest is chosen so that SETs 1 ms apart are always safe.

use crate::time::{TICKS_PER_MICROSECOND, Ticks};
use puck::Action;
use std::collections::VecDeque;

/// Requests a device can hold, the one in work included. Assumed.
pub(crate) const DEPTH: usize = 4;

/// From the request to the sample of a position or the value of a reply (Barrett's estimate).
pub(crate) const REPLY_LATENCY: Ticks = 75 * TICKS_PER_MICROSECOND;

/// Time a device takes to carry out a SET. Assumed.
pub(crate) const SET_TIME: Ticks = 250 * TICKS_PER_MICROSECOND;

/// The requests a device has received and not yet carried out, each with the time it will be done.
#[derive(Clone, Debug)]
pub(crate) struct Inbox {
    waiting: VecDeque<(Ticks, Action)>,
    set_time: Ticks,
    busy_until: Ticks,
    lost: u64,
}

impl Inbox {
    /// An empty buffer of a device that takes `set_time` for each SET.
    pub(crate) fn new(set_time: Ticks) -> Self {
        Self { waiting: VecDeque::new(), set_time, busy_until: 0, lost: 0 }
    }

    /// A request arrives. If the buffer is full it is lost without a trace on the bus.
    pub(crate) fn receive(&mut self, at: Ticks, action: Action) {
        if self.waiting.len() >= DEPTH {
            self.lost += 1;
            return;
        }
        let duration = match action {
            Action::Get { .. } => REPLY_LATENCY,
            Action::Set { .. } | Action::PackedTorques { .. } => self.set_time,
        };
        self.busy_until = self.busy_until.max(at) + duration;
        self.waiting.push_back((self.busy_until, action));
    }

    /// When the next request will be done.
    pub(crate) fn next_time(&self) -> Option<Ticks> {
        self.waiting.front().map(|(done, _)| *done)
    }

    /// The next request that is done by `now`.
    pub(crate) fn take(&mut self, now: Ticks) -> Option<Action> {
        if self.next_time()? > now {
            return None;
        }
        self.waiting.pop_front().map(|(_, action)| action)
    }

    /// Forgets what is waiting: power lost, or rebooted.
    pub(crate) fn clear(&mut self) {
        self.waiting.clear();
        self.busy_until = 0;
    }

    /// Requests lost so far.
    pub(crate) fn lost(&self) -> u64 {
        self.lost
    }
}
