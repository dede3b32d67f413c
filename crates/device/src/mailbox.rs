//! `Mailbox`: the place for the reply of one sender in one round of requests.

/// The place for the reply of one sender in one round.
///
/// A frame carries no cycle number. Two different replies of one sender within a round mean that one of them is late;
/// as nothing tells which, both are discarded.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) enum Mailbox<T> {
    #[default]
    Empty,
    Holds(T),
    /// Different replies came: one is late, nobody knows which.
    Contradicted,
}

impl<T: Copy + PartialEq> Mailbox<T> {
    /// Puts a reply in; whether another was there before.
    pub(crate) fn put(&mut self, reply: T) -> bool {
        let before = *self;
        *self = match before {
            Mailbox::Empty => Mailbox::Holds(reply),
            Mailbox::Holds(earlier) if earlier == reply => before,
            Mailbox::Holds(_) | Mailbox::Contradicted => Mailbox::Contradicted,
        };
        before != Mailbox::Empty
    }

    /// The reply of this round.
    pub(crate) fn reply(&self) -> Option<T> {
        match self {
            Mailbox::Holds(reply) => Some(*reply),
            Mailbox::Empty | Mailbox::Contradicted => None,
        }
    }
}
