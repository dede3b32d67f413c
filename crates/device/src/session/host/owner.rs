//! The host that has the session, and the numbers of its requests.

use link::frame::LINK_TIMEOUT_MS;
use link::{Reply, Secret, SessionOwner, Text};

/// Treatment of a request, by its number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum RequestOrder {
    /// Handle it.
    New,
    /// It has been answered before: answer again.
    Again,
    /// It is being worked on, or was overtaken long ago.
    Ignore,
}

/// The host that has the session.
#[derive(Debug)]
pub(super) struct Owner {
    session: u16,
    name: Text,
    since_ms: u32,
    heard_ms: u32,
    newest: u16,
    answer: Option<Reply>,
    /// The challenge that it has not answered yet.
    nonce: Option<u64>,
    /// The secret that it has proven to know.
    proven: Option<Secret>,
}

impl Owner {
    /// A host whose hello had this number, and this name in it.
    pub(super) fn new(session: u16, sequence: u16, name: Text, now_ms: u32) -> Self {
        Self {
            session,
            name,
            since_ms: now_ms,
            heard_ms: now_ms,
            newest: sequence,
            answer: None,
            nonce: None,
            proven: None,
        }
    }

    /// Its name, and for how long it has had the session: for others, so without the number.
    pub(super) fn report(&self, now_ms: u32) -> SessionOwner {
        SessionOwner { name: self.name.clone(), since_ms: now_ms.wrapping_sub(self.since_ms) }
    }

    /// Its session number.
    pub(super) fn session(&self) -> u16 {
        self.session
    }

    /// It is given a number to prove the secret with, in place of one that it has not used.
    pub(super) fn challenge(&mut self, nonce: u64) {
        self.nonce = Some(nonce);
    }

    /// True if the proof is right. The challenge is used up by it, and a wrong one takes what was proven before.
    pub(super) fn prove(&mut self, secret: &Secret, proof: u64) -> bool {
        let is_right = self.nonce.take().is_some_and(|nonce| secret.proof(nonce, self.session) == proof);
        self.proven = is_right.then_some(*secret);
        is_right
    }

    /// True if it has proven to know this secret, and no other one.
    pub(super) fn knows(&self, secret: &Secret) -> bool {
        self.proven.as_ref() == Some(secret)
    }

    /// For how long it has not been heard, ms.
    pub(super) fn silence(&self, now_ms: u32) -> u32 {
        now_ms.wrapping_sub(self.heard_ms)
    }

    /// Time that another host must wait to take over, ms; 0 if it need not.
    pub(super) fn protected_for(&self, now_ms: u32) -> u32 {
        LINK_TIMEOUT_MS.saturating_sub(self.silence(now_ms))
    }

    /// Says what to do with its request of this number, and notes that it was heard: by a new request, or by the
    /// repetition of one that is worked on. Whatever else has its session number may be a replay.
    pub(super) fn order(&mut self, sequence: u16, now_ms: u32) -> RequestOrder {
        if sequence == self.newest {
            if self.answer().is_some() {
                return RequestOrder::Again;
            }
            self.heard_ms = now_ms;
            return RequestOrder::Ignore;
        }
        // Numbers wrap: one that is "behind" by less than half the circle is old.
        if sequence.wrapping_sub(self.newest) >= 0x8000 {
            return RequestOrder::Ignore;
        }
        (self.newest, self.heard_ms) = (sequence, now_ms);
        RequestOrder::New
    }

    /// The answer to the newest request, if there was one already.
    pub(super) fn answer(&self) -> Option<&Reply> {
        self.answer.as_ref().filter(|answer| answer.answers() == Some(self.newest))
    }

    /// Keeps the answer to the newest request.
    pub(super) fn remember(&mut self, answer: Reply) {
        if answer.answers() == Some(self.newest) {
            self.answer = Some(answer);
        }
    }
}
