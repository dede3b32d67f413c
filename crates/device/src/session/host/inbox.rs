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
    /// Takes a request; false if one had to give way. A stop never does, and never waits behind anything else; a
    /// farewell gives way to a stop alone.
    pub(super) fn push(&mut self, frame: Frame<Request>, is_owner: bool) -> bool {
        if is_owner { push(&mut self.owner, frame) } else { push(&mut self.others, frame) }
    }

    /// The next request; where `stops_only` is set only a stop. `is_owner` tells by its session number whether a host
    /// has the session; a device without a session owes nobody anything, so that `is_free` lets every host pass.
    pub(super) fn pop(
        &mut self,
        now_ms: u32,
        is_free: bool,
        stops_only: bool,
        is_owner: impl Fn(u16) -> bool,
    ) -> Option<Frame<Request>> {
        // Every stop was put to the front.
        let is_due = |frame: &&Frame<Request>| !stops_only || frame.message == Request::Stop;
        if self.owner.front().filter(is_due).is_some() {
            return self.owner.pop_front();
        }
        let next = self.others.front().filter(is_due)?;
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

/// Puts a stop to the front and everything else to the end; false if a request was lost. What its host repeats gives
/// way to a stop, and to a farewell: nobody repeats that, and the place of one who has left would be kept.
fn push<const N: usize>(queue: &mut Deque<Frame<Request>, N>, frame: Frame<Request>) -> bool {
    let is_full = queue.is_full();
    let is_stop = frame.message == Request::Stop;
    if is_full {
        let repeated = queue.iter().rposition(|frame| !matches!(frame.message, Request::Stop | Request::Goodbye));
        match repeated {
            Some(place) if is_stop || frame.message == Request::Goodbye => remove(queue, place),
            None if is_stop => drop(queue.pop_back()),
            _ => return false,
        }
    }
    let _ = if is_stop { queue.push_front(frame) } else { queue.push_back(frame) };
    !is_full
}

/// Takes out what is at this place; the others keep their order.
#[inline(never)]
fn remove<const N: usize>(queue: &mut Deque<Frame<Request>, N>, place: usize) {
    for other in 0..queue.len() {
        if let Some(frame) = queue.pop_front().filter(|_| other != place) {
            let _ = queue.push_back(frame);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use link::frame::Envelope;

    /// The session number of the owner.
    const OWNER: u16 = 7;

    fn frame(session: u16, message: Request) -> Frame<Request> {
        Frame { envelope: Envelope { session, sequence: 0, time_ms: 0 }, message }
    }

    /// A request of another host arrives and is asked for at once; true if it is handled.
    fn passes(inbox: &mut Inbox, now_ms: u32, session: u16, message: Request) -> bool {
        assert!(inbox.push(frame(session, message), false));
        let passed = inbox.pop(now_ms, false, false, |session| session == OWNER).is_some();
        if !passed {
            // Nobody has the session: it is not kept waiting.
            assert!(inbox.pop(now_ms, true, false, |_| false).is_some());
        }
        passed
    }

    #[test]
    fn others_may_ask_nine_times_at_once_and_then_every_two_milliseconds() {
        // The clock wraps: from all of it, and from just before the wrap.
        for start in [1000, u32::MAX - 5] {
            let mut inbox = Inbox { paid_until_ms: start, ..Inbox::default() };
            let at = |ms: u32| start.wrapping_add(ms);
            let passed: [bool; 11] = core::array::from_fn(|_| passes(&mut inbox, at(0), 99, Request::Ping));
            assert_eq!(passed.iter().filter(|passed| **passed).count(), 9);
            assert!(passed[8] && !passed[9]);
            assert!(!passes(&mut inbox, at(1), 99, Request::Ping));
            assert!(passes(&mut inbox, at(2), 99, Request::Ping));
            assert!(!passes(&mut inbox, at(2), 99, Request::Ping));
            assert!(passes(&mut inbox, at(4), 99, Request::Ping));
            // A stop costs nothing and owes nothing, and no more does what the owner said before it had the session.
            assert!(passes(&mut inbox, at(4), 99, Request::Stop) && passes(&mut inbox, at(4), OWNER, Request::Ping));
            assert!(!passes(&mut inbox, at(4), 99, Request::Ping));
        }
    }

    #[test]
    fn a_debt_of_long_ago_is_none_wherever_the_clock_has_wrapped_to() {
        for ahead in (OTHER_CREDIT_MS + OTHER_COST_MS + 1..60).chain([1 << 31, u32::MAX]) {
            let mut inbox = Inbox { paid_until_ms: 5000, ..Inbox::default() };
            assert!(passes(&mut inbox, 5000_u32.wrapping_sub(ahead), 99, Request::Ping), "{ahead} ms");
        }
    }

    #[test]
    fn a_stop_goes_before_what_waits_and_takes_the_place_of_the_last_where_all_are_taken() {
        for (is_owner, places) in [(true, OWNER_REQUESTS), (false, OTHER_REQUESTS)] {
            let mut inbox = Inbox::default();
            for _ in 0..places {
                assert!(inbox.push(frame(OWNER, Request::Ping), is_owner));
            }
            assert!(!inbox.push(frame(OWNER, Request::Status), is_owner), "it is lost");
            assert!(!inbox.push(frame(OWNER, Request::Stop), is_owner), "another is lost");
            let mut next = || inbox.pop(0, true, false, |_| false).map(|frame| frame.message);
            assert_eq!(next(), Some(Request::Stop));
            for _ in 1..places {
                assert_eq!(next(), Some(Request::Ping));
            }
            assert_eq!(next(), None);
            let mut inbox = Inbox::default();
            assert!(inbox.push(frame(OWNER, Request::Ping), is_owner));
            assert!(inbox.push(frame(OWNER, Request::Stop), is_owner), "there was room for both");
        }
    }

    #[test]
    fn what_finds_no_place_is_lost_and_nothing_that_waits_gives_way_to_it() {
        for (is_owner, places) in [(true, OWNER_REQUESTS), (false, OTHER_REQUESTS)] {
            for waiting in [Request::Ping, Request::Goodbye, Request::Stop] {
                let mut inbox = Inbox::default();
                for _ in 0..places {
                    assert!(inbox.push(frame(OWNER, waiting.clone()), is_owner));
                }
                assert!(!inbox.push(frame(OWNER, Request::Status), is_owner), "behind {waiting:?}");
                let words = core::iter::from_fn(|| inbox.pop(0, true, false, |_| false).map(|frame| frame.message));
                assert!(words.eq(core::iter::repeat_n(waiting, places)));
            }
        }
    }

    #[test]
    fn a_goodbye_takes_the_place_of_what_will_be_repeated_and_keeps_its_turn() {
        for (is_owner, places) in [(true, OWNER_REQUESTS), (false, OTHER_REQUESTS)] {
            for stopping in [false, true] {
                let mut inbox = Inbox::default();
                let first = if stopping { Request::Stop } else { Request::Ping };
                assert!(inbox.push(frame(OWNER, first.clone()), is_owner));
                for _ in 1..places {
                    assert!(inbox.push(frame(OWNER, Request::Status), is_owner));
                }
                assert!(!inbox.push(frame(OWNER, Request::Goodbye), is_owner), "a status is lost");
                let words = core::iter::from_fn(|| inbox.pop(0, true, false, |_| false).map(|frame| frame.message));
                let expected = [Request::Status, Request::Status, Request::Goodbye];
                assert!(words.eq(core::iter::once(first).chain(expected.into_iter().skip(4 - places))));
            }
        }
        // Only farewells and a stop: the newest farewell is lost, the stop never.
        let mut inbox = Inbox::default();
        for message in [Request::Goodbye, Request::Goodbye, Request::Goodbye, Request::Stop, Request::Goodbye] {
            inbox.push(frame(99, message), false);
        }
        let words = core::iter::from_fn(|| inbox.pop(0, true, false, |_| false).map(|frame| frame.message));
        assert!(words.eq([Request::Stop, Request::Goodbye]));
    }

    #[test]
    fn the_owner_s_requests_come_before_those_of_others() {
        let mut inbox = Inbox::default();
        assert!(inbox.push(frame(99, Request::Status), false) && inbox.push(frame(OWNER, Request::Ping), true));
        let mut next = || inbox.pop(0, false, false, |session| session == OWNER).map(|frame| frame.message);
        assert_eq!((next(), next(), next()), (Some(Request::Ping), Some(Request::Status), None));
    }
}
