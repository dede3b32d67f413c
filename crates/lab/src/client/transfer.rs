//! Images in parts, several of them on the way at a time, so that the line never waits for an answer.
//!
//! The device takes parts in order and says which one it expects. So a part or an answer that got lost needs no
//! bookkeeping: what the device expects is where sending goes on, under new numbers. Reading is the same the other
//! way round.

use std::collections::VecDeque;
use std::time::Duration;

use link::frame::Envelope;
use link::message::{CHUNK_BYTES, ChunkData};
use link::{Name, Refusal, Reply, Request};

use super::{Client, REPEAT_AFTER};
use crate::error::HostError;
use crate::transport::Transport;

/// Parts on their way. Two keep a line busy whose answers come within the time of one part, which is so from 9 600
/// baud to 1 Mbit/s; the third covers a device that looks at its line once a slot. The device keeps four requests.
const WINDOW: usize = 3;

/// Throughput of an image over the line.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Transfer {
    /// Its length.
    pub bytes: usize,
    /// From its first part to the device's word that it has them all, in the transport's time.
    pub sent_in: Duration,
    /// From the first question to the last byte read back.
    pub read_in: Duration,
}

impl Transfer {
    /// Bytes of the image a second while it was sent; 0 for none.
    #[must_use]
    pub fn sending_rate(&self) -> f64 {
        rate(self.bytes, self.sent_in)
    }

    /// Bytes of the image a second while it was read back; 0 for none.
    #[must_use]
    pub fn reading_rate(&self) -> f64 {
        rate(self.bytes, self.read_in)
    }
}

fn rate(bytes: usize, time: Duration) -> f64 {
    if time.is_zero() { 0.0 } else { bytes as f64 / time.as_secs_f64() }
}

/// A request on its way: its number, and where in the image it ends.
type Sent = (u16, usize);

impl<T: Transport> Client<T> {
    /// Sends all parts of an image; `progress` hears the bytes that the device has.
    pub(super) fn send_parts(&mut self, image: &[u8], mut progress: impl FnMut(usize)) -> Result<(), HostError> {
        const WORD: &str = "upload";
        let started = self.now();
        let mut window = Window::new(started);
        progress(0);
        while window.done < image.len() {
            // Whoever sends the wrong one takes it back before it is stored.
            if self.interrupt.is_raised() {
                return Err(self.interrupted());
            }
            while window.has_room() && window.next < image.len() {
                let part = image.get(window.next..).unwrap_or_default();
                let part = part.get(..CHUNK_BYTES).unwrap_or(part);
                let data = ChunkData::from_slice(part).unwrap_or_default();
                let offset = u32::try_from(window.next).unwrap_or(u32::MAX);
                let end = window.next + part.len();
                let number = self.post(&Request::UploadChunk { offset, data })?;
                window.sent(number, end);
            }
            match self.answer_within(&mut window, WORD)? {
                None => {}
                Some((end, Reply::Accepted { .. })) => {
                    window.reached(end, self.now());
                    progress(window.done);
                }
                Some((_, Reply::Refused { reason: Refusal::UploadOrder, detail: [expected, _], .. }))
                    if usize::try_from(expected).is_ok_and(|expected| expected >= window.done) =>
                {
                    // A part got lost, or an answer: what the device has, it has.
                    window.go_back(usize::try_from(expected).unwrap_or(usize::MAX), self.now());
                    self.round_trips.repeated += 1;
                    progress(window.done);
                }
                Some((_, Reply::Refused { reason, detail, .. })) => {
                    return Err(HostError::Refused { request: WORD, reason, detail });
                }
                Some(_) => return Err(HostError::WrongAnswer { request: WORD }),
            }
        }
        self.transfer = Transfer { bytes: image.len(), sent_in: self.now().saturating_sub(started), ..self.transfer };
        Ok(())
    }

    /// Reads a stored image; `progress` hears the bytes done.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn read_image(&mut self, name: &Name, mut progress: impl FnMut(usize)) -> Result<Vec<u8>, HostError> {
        const WORD: &str = "read";
        let mut image = Vec::new();
        let started = self.now();
        let mut window = Window::new(started);
        loop {
            while window.has_room() {
                let offset = u32::try_from(window.next).unwrap_or(u32::MAX);
                let end = window.next + CHUNK_BYTES;
                let number = self.post(&Request::Read { name: name.clone(), offset })?;
                window.sent(number, end);
            }
            match self.answer_within(&mut window, WORD)? {
                None => {}
                Some((_, Reply::Chunk { offset, data, .. })) if usize::try_from(offset) == Ok(image.len()) => {
                    if data.is_empty() {
                        self.transfer.read_in = self.now().saturating_sub(started);
                        return Ok(image);
                    }
                    image.extend_from_slice(&data);
                    progress(image.len());
                    if data.len() == CHUNK_BYTES {
                        window.reached(image.len(), self.now());
                    } else {
                        // Parts behind a short one begin elsewhere than was asked for.
                        window.go_back(image.len(), self.now());
                    }
                }
                // The one before it got lost.
                Some((_, Reply::Chunk { offset, .. })) if usize::try_from(offset).is_ok_and(|at| at > image.len()) => {
                    window.go_back(image.len(), window.since);
                    self.round_trips.repeated += 1;
                }
                Some((_, Reply::Refused { reason, detail, .. })) => {
                    return Err(HostError::Refused { request: WORD, reason, detail });
                }
                Some(_) => return Err(HostError::WrongAnswer { request: WORD }),
            }
        }
    }

    /// Sends a request under a new number and does not wait.
    fn post(&mut self, request: &Request) -> Result<u16, HostError> {
        self.sequence = self.sequence.wrapping_add(1);
        let envelope = Envelope { session: self.session, sequence: self.sequence, time_ms: self.device_ms };
        self.send(envelope, request)?;
        Ok(self.sequence)
    }

    /// The next answer to one of the requests of the window, and where that ended. `None`: none came for a while, and
    /// the window has gone back to what is sure.
    fn answer_within(&mut self, window: &mut Window, word: &'static str) -> Result<Option<(usize, Reply)>, HostError> {
        let quiet_from = self.now();
        loop {
            while let Some(reply) = self.answers.pop_front() {
                if let Some(end) = reply.answers().and_then(|of| window.answered(of)) {
                    return Ok(Some((end, reply)));
                }
            }
            let now = self.now();
            if now.saturating_sub(window.since) >= self.timeout {
                return Err(HostError::NoAnswer { request: word, after: self.timeout });
            }
            let repeat_at = quiet_from + REPEAT_AFTER;
            if now >= repeat_at {
                window.go_back(window.done, window.since);
                self.round_trips.repeated += 1;
                return Ok(None);
            }
            self.pump(repeat_at.saturating_sub(now))?;
        }
    }
}

/// Bytes on their way, and bytes acknowledged.
struct Window {
    on_their_way: VecDeque<Sent>,
    /// Bytes that have arrived for sure.
    done: usize,
    /// Where the next request begins.
    next: usize,
    /// When something last arrived.
    since: Duration,
}

impl Window {
    fn new(now: Duration) -> Self {
        Self { on_their_way: VecDeque::new(), done: 0, next: 0, since: now }
    }

    fn has_room(&self) -> bool {
        self.on_their_way.len() < WINDOW
    }

    fn sent(&mut self, number: u16, end: usize) {
        self.on_their_way.push_back((number, end));
        self.next = end;
    }

    /// Where the request with this number ended; those before it, whose answers were lost, are given up.
    fn answered(&mut self, number: u16) -> Option<usize> {
        let place = self.on_their_way.iter().position(|(sent, _)| *sent == number)?;
        let (_, end) = *self.on_their_way.get(place)?;
        self.on_their_way.drain(..=place);
        Some(end)
    }

    /// All bytes up to `end` have arrived.
    fn reached(&mut self, end: usize, now: Duration) {
        self.done = end;
        self.since = now;
    }

    /// Forgets what is on its way and goes on at `from`, up to which everything has arrived.
    fn go_back(&mut self, from: usize, now: Duration) {
        self.on_their_way.clear();
        self.reached(from, now);
        self.next = from;
    }
}
