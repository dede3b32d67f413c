//! Commands on their way to the control half, in the order in which it will answer them.
//!
//! They outlive the session of the host that sent them: an answer must never be taken for that to a later command.

use heapless::Deque;

/// Commands that may be on their way to the control half at a time, all but `ORDERS` of them stops. A queue that
/// holds fewer would have no place for those.
pub const PENDING_COMMANDS: usize = 8;

/// Most of them that are no stops. The control half takes one in a cycle, and a stop behind them is to be obeyed within
/// 20 ms: four cycles, and the one that is under way.
const ORDERS: usize = 3;

/// A command that the control half does not answer within this time is given up, ms. It answers within two
/// cycles, 7 ms, and to zeroing after its last question to the safety module, 150 ms; longer means that it is not
/// running.
/// An answer that came later would be taken for that to the next command.
const ANSWER_TIMEOUT_MS: u32 = 200;

/// Who waits for an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Requester {
    /// Nobody: the device itself sent the command.
    Device,
    /// The host that had the session.
    Owner {
        /// Its session number.
        session: u16,
        /// Number of its request.
        of: u16,
    },
    /// A host without a session, which may do nothing but stop, or the owner who repeats a stop.
    OtherHost {
        /// The session number in its request.
        session: u16,
        /// Number of its request.
        of: u16,
    },
}

/// Commands without an answer, oldest first.
#[derive(Debug, Default)]
pub(super) struct Pending(Deque<(Requester, u32), PENDING_COMMANDS>);

impl Pending {
    /// True if another command can be tracked.
    pub(super) fn has_room(&self, stop: bool) -> bool {
        self.0.len() < if stop { PENDING_COMMANDS } else { ORDERS }
    }

    /// True if the control half owes no answer.
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// True if a host without a session waits for a stop.
    pub(super) fn holds_stop_of_others(&self) -> bool {
        self.0.iter().any(|(requester, _)| matches!(requester, Requester::OtherHost { .. }))
    }

    /// True if a host that had the session, now or before, waits for an answer.
    pub(super) fn holds_orders(&self) -> bool {
        self.0.iter().any(|(requester, _)| matches!(requester, Requester::Owner { .. }))
    }

    /// A command has been queued.
    pub(super) fn push(&mut self, requester: Requester, now_ms: u32) {
        // `has_room` was asked before; without room the answer would find nobody, and be ignored.
        let _ = self.0.push_back((requester, now_ms));
    }

    /// The oldest command has been answered: who asked? `None`: no command was on its way.
    pub(super) fn answered(&mut self) -> Option<Requester> {
        self.0.pop_front().map(|(requester, _)| requester)
    }

    /// Takes out the oldest command if it has waited too long: who asked, and how long ago, ms.
    pub(super) fn expired(&mut self, now_ms: u32) -> Option<(Requester, u32)> {
        let waited = now_ms.wrapping_sub(self.0.front()?.1);
        if waited < ANSWER_TIMEOUT_MS {
            return None;
        }
        self.0.pop_front().map(|(requester, _)| (requester, waited))
    }
}
