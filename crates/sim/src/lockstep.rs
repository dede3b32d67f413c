//! The simulator's end of the lock step with the firmware under QEMU.
//!
//! The firmware writes one request and waits for one reply on two byte streams (QEMU's stdout and stdin). Its virtual clock
//! stands still meanwhile, so neither side can overtake the other, however slow the computer is. Layout, timing rule and
//! the reasons: `docs/lockstep.md`.

use crate::link_wire::CHUNK;
use crate::plant::{Event, Plant};
use crate::time::Ticks;
use puck::{CanFrame, CanId};
use std::io::{self, Read, Write};

/// Bytes of a request without link bytes.
pub const REQUEST_LENGTH: usize = 24;

/// Bytes of a reply without link bytes.
pub const REPLY_LENGTH: usize = 32;

/// What a reply says instead of a tick if no event will come by itself.
pub const NEVER: Ticks = Ticks::MAX;

/// Why the lock step ended other than by a good-bye. The stream is out of step after any of these: kill the firmware.
#[derive(Debug, thiserror::Error)]
pub enum LockstepError {
    /// Reading or writing failed.
    #[error("lock step with the firmware: {0}")]
    Stream(#[from] io::Error),
    /// The stream ended in the middle of a request: the firmware has died.
    #[error("the firmware's stream ended after {received} of {expected} bytes of a request")]
    Truncated {
        /// Bytes that came.
        received: usize,
        /// Bytes the request has.
        expected: usize,
    },
    /// The first byte names no request. Usually something else has written to the firmware's standard output.
    #[error("unknown kind of request {kind:#04x}: does anything but the lock step write to the firmware's stdout?")]
    Kind {
        /// The byte.
        kind: u8,
    },
    /// A frame that no CAN controller could send.
    #[error("malformed CAN frame: identifier {id:#x}, {length} bytes")]
    Frame {
        /// Identifier field.
        id: u16,
        /// Length field.
        length: u8,
    },
    /// Bytes 4..8 of the header must be zero.
    #[error("reserved bytes of a request are not zero")]
    Reserved,
}

/// What one call of [`Lockstep::serve_one`] did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Served {
    /// The firmware handed over a frame for the bus.
    Frame,
    /// The firmware asked for what has happened.
    Event,
    /// The firmware sent bytes to the host.
    Link,
    /// The firmware said good-bye; it will not ask again.
    Bye,
    /// The stream ended between two requests, without a good-bye.
    EndOfStream,
}

impl Served {
    /// Whether there will be no further request.
    #[must_use]
    pub fn is_last(self) -> bool {
        matches!(self, Self::Bye | Self::EndOfStream)
    }
}

/// One request, read and checked.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Request {
    Send(CanFrame),
    Event,
    Bye,
    Link(Vec<u8>),
}

/// The two streams and an account of what went through them.
#[derive(Debug)]
pub struct Lockstep<R, W> {
    from_firmware: R,
    to_firmware: W,
    exchanges: u64,
}

impl<R: Read, W: Write> Lockstep<R, W> {
    /// A lock step over the firmware's standard output and input.
    pub fn new(from_firmware: R, to_firmware: W) -> Self {
        Self { from_firmware, to_firmware, exchanges: 0 }
    }

    /// Waits for one request, lets the plant follow to its time, and answers.
    ///
    /// Virtual time stands still between two calls: the moment to look at the world or to feed the host link.
    ///
    /// # Errors
    /// [`LockstepError`]; the streams are then out of step and the firmware must be killed (it ignores SIGTERM while it waits).
    pub fn serve_one(&mut self, plant: &mut Plant) -> Result<Served, LockstepError> {
        let Some((t, request)) = self.read()? else {
            return Ok(Served::EndOfStream);
        };
        let (served, event) = match request {
            Request::Send(frame) => {
                plant.submit(t, frame);
                (Served::Frame, Event::default())
            }
            Request::Event => (Served::Event, plant.event(t)),
            Request::Bye => {
                plant.advance(t);
                (Served::Bye, Event::default())
            }
            Request::Link(bytes) => {
                plant.link_from_device(t, &bytes);
                (Served::Link, Event::default())
            }
        };
        self.exchanges += 1;
        self.to_firmware.write_all(&encode_reply(&event, plant.next_event()))?;
        self.to_firmware.flush()?;
        Ok(served)
    }

    /// Requests answered so far.
    #[must_use]
    pub fn exchanges(&self) -> u64 {
        self.exchanges
    }

    /// The next request and its time; `None` at the end of the stream.
    fn read(&mut self) -> Result<Option<(Ticks, Request)>, LockstepError> {
        let mut header = [0; REQUEST_LENGTH];
        match fill(&mut self.from_firmware, &mut header)? {
            0 => return Ok(None),
            REQUEST_LENGTH => {}
            received => {
                return Err(LockstepError::Truncated { received, expected: REQUEST_LENGTH });
            }
        }
        let [kind, length, id0, id1, r0, r1, r2, r3, t0, t1, t2, t3, t4, t5, t6, t7, data @ ..] = header;
        if [r0, r1, r2, r3] != [0; 4] {
            return Err(LockstepError::Reserved);
        }
        let t = Ticks::from_le_bytes([t0, t1, t2, t3, t4, t5, t6, t7]);
        let request = match kind {
            1 => {
                let id = u16::from_le_bytes([id0, id1]);
                let payload = data.get(..usize::from(length));
                let frame = payload.and_then(|payload| CanFrame::from_slice(CanId::new(id)?, payload));
                Request::Send(frame.ok_or(LockstepError::Frame { id, length })?)
            }
            2 => Request::Event,
            3 => Request::Bye,
            4 => {
                let mut bytes = vec![0; length.into()];
                let received = fill(&mut self.from_firmware, &mut bytes)?;
                if received < bytes.len() {
                    let expected = REQUEST_LENGTH + bytes.len();
                    return Err(LockstepError::Truncated { received: REQUEST_LENGTH + received, expected });
                }
                Request::Link(bytes)
            }
            kind => return Err(LockstepError::Kind { kind }),
        };
        Ok(Some((t, request)))
    }
}

/// Header and link bytes of a reply.
fn encode_reply(event: &Event, next: Option<Ticks>) -> Vec<u8> {
    let link = &event.link[..event.link.len().min(CHUNK)];
    let mut reply = vec![0; REPLY_LENGTH];
    reply[0] = u8::from(event.received.is_some()) | u8::from(event.transmitted) << 1 | u8::from(!link.is_empty()) << 2;
    if let Some(frame) = event.received {
        let payload = frame.payload();
        reply[1] = payload.len() as u8;
        reply[2..4].copy_from_slice(&frame.can_id().raw().to_le_bytes());
        reply[16..16 + payload.len()].copy_from_slice(payload);
    }
    reply[4] = link.len() as u8;
    reply[8..16].copy_from_slice(&next.unwrap_or(NEVER).to_le_bytes());
    reply.extend_from_slice(link);
    reply
}

/// Reads until the buffer is full or the stream ends; the number of bytes read.
fn fill(stream: &mut impl Read, buffer: &mut [u8]) -> io::Result<usize> {
    let mut filled = 0;
    while filled < buffer.len() {
        match stream.read(&mut buffer[filled..]) {
            Ok(0) => break,
            Ok(count) => filled += count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(filled)
}
