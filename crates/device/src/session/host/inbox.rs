//! Requests that have arrived and are not handled yet: those of the host that has the session first, others at a rate
//! that they cannot raise.

use heapless::Deque;
use link::Request;
use link::frame::Frame;

/// Requests of the owner. A host waits for its answers, so two would do.
const OWNER_REQUESTS: usize = 4;

/// Requests of others.
const OTHER_REQUESTS: usize = 2;

/// Time that a request of another host costs, ms: with its answer it takes a twentieth of the slowest line.
const OTHER_COST_MS: u32 = 2;

/// Largest debt of the other hosts, ms: several may ask at once.
const OTHER_CREDIT_MS: u32 = 16;

/// Requests in the order in which they are due.
#[derive(Debug, Default)]
pub(super) struct Inbox {
    owner: Deque<Frame<Request>, OWNER_REQUESTS>,
    others: Deque<Frame<Request>, OTHER_REQUESTS>,
    /// Until when the requests of others are paid for, ms.
    paid_until_ms: u32,
}

impl Inbox {
    /// Takes a request; false if one had to give way. A stop never does, and never waits behind anything else.
    pub(super) fn push(&mut self, frame: Frame<Request>, is_owner: bool) -> bool {
        if is_owner { push(&mut self.owner, frame) } else { push(&mut self.others, frame) }
    }

    /// The next request. `is_owner` tells by its session number whether a host has the session; a device without a
    /// session owes nobody anything, so that `is_free` lets every host pass.
    pub(super) fn pop(&mut self, now_ms: u32, is_free: bool, is_owner: impl Fn(u16) -> bool) -> Option<Frame<Request>> {
        if let Some(frame) = self.owner.pop_front() {
            return Some(frame);
        }
        let next = self.others.front()?;
        if !(is_free || next.message == Request::Stop || is_owner(next.envelope.session)) {
            // The clock wraps. More than the largest debt lies behind now: long ago.
            let ahead = self.paid_until_ms.wrapping_sub(now_ms);
            let debt = if ahead > OTHER_CREDIT_MS + OTHER_COST_MS { 0 } else { ahead };
            if debt > OTHER_CREDIT_MS {
                return None;
            }
            self.paid_until_ms = now_ms.wrapping_add(debt).wrapping_add(OTHER_COST_MS);
        }
        self.others.pop_front()
    }
}

/// Puts a stop to the front and everything else to the end; false if a request was lost.
fn push<const N: usize>(queue: &mut Deque<Frame<Request>, N>, frame: Frame<Request>) -> bool {
    let is_full = queue.is_full();
    if frame.message == Request::Stop {
        if is_full {
            queue.pop_back();
        }
        let _ = queue.push_front(frame);
    } else if !is_full {
        let _ = queue.push_back(frame);
    }
    !is_full
}
