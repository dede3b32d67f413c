//! The simulator's end of the lock step with the firmware under QEMU.
//!
//! The firmware writes one request and waits for one reply on two byte streams (QEMU's stdout and stdin). Its virtual
//! clock stands still meanwhile, so neither side can overtake the other, however slow the computer is. Layout, timing
//! rule and the reasons: `docs/lockstep.md`.

use crate::link_wire::CHUNK;
use crate::plant::{Event, Plant};
use crate::time::{TICKS_PER_SECOND, Ticks};
use flash::{FlashChip, FlashError, WORD_BYTES};
use puck::{CanFrame, CanId};
use std::io::{self, Read, Write};

/// Flash and bus share one virtual clock.
const _: () = assert!(flash::TICKS_PER_SECOND == TICKS_PER_SECOND);

/// Bytes of a request without link bytes.
pub const REQUEST_LENGTH: usize = 24;

/// Bytes of a reply without link bytes.
pub const REPLY_LENGTH: usize = 32;

/// Most bytes of the flash in one reply.
pub const FLASH_READ_LIMIT: u32 = 4096;

/// Stands in a reply instead of a tick if no event will come by itself.
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
    /// An operation that no flash has, or more bytes than it handles in one go.
    #[error("malformed request for the flash: operation {operation}, {count} bytes, {length} of them with the request")]
    Flash {
        /// Operation field.
        operation: u16,
        /// Bytes asked for.
        count: u32,
        /// Bytes that came with the request.
        length: u8,
    },
    /// The flash was told to lose power in this operation, and with it the device did.
    #[error("power failed while the flash was being written")]
    PowerFailed,
}

/// Result of one call of [`Lockstep::serve_one`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Served {
    /// The firmware handed over a frame for the bus.
    Frame,
    /// The firmware asked for what has happened.
    Event,
    /// The firmware sent bytes to the host.
    Link,
    /// The firmware used its flash.
    Flash,
    /// The firmware took back every frame that had not begun on the wire.
    Withdraw,
    /// The firmware said good-bye; it will not ask again.
    Bye,
    /// The stream ended between two requests, without a good-bye.
    EndOfStream,
}

impl Served {
    /// True if there will be no further request.
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
    Flash(FlashRequest),
    Withdraw,
}

/// A request of the firmware to its flash.
#[derive(Clone, Debug, PartialEq, Eq)]
enum FlashRequest {
    Read { address: u32, count: u32 },
    Write { address: u32, word: Vec<u8> },
    Erase { address: u32 },
}

/// The answer of the flash.
#[derive(Clone, Debug, Default)]
struct FlashReply {
    ready: Ticks,
    status: u8,
    bytes: Vec<u8>,
}

/// The two streams and an account of what went through them.
#[derive(Debug)]
pub struct Lockstep<R, W> {
    from_firmware: R,
    to_firmware: W,
    exchanges: u64,
    flash: FlashChip,
}

impl<R: Read, W: Write> Lockstep<R, W> {
    /// A lock step over the firmware's standard output and input. The device's flash is a new one.
    pub fn new(from_firmware: R, to_firmware: W) -> Self {
        Self { from_firmware, to_firmware, exchanges: 0, flash: FlashChip::default() }
    }

    /// Puts this flash into the device.
    #[must_use]
    pub fn with_flash(self, flash: FlashChip) -> Self {
        Self { flash, ..self }
    }

    /// Waits for one request, lets the plant follow to its time, and answers.
    ///
    /// Virtual time stands still between two calls: the moment to look at the world or to feed the host link.
    ///
    /// # Errors
    /// [`LockstepError`]; the streams are then out of step and the firmware must be killed (it ignores SIGTERM while it
    /// waits).
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
            Request::Flash(request) => {
                plant.advance(t);
                let reply = self.flash(t, &request)?;
                self.exchanges += 1;
                self.to_firmware.write_all(&encode_flash_reply(&reply, plant.next_event()))?;
                self.to_firmware.flush()?;
                return Ok(Served::Flash);
            }
            Request::Withdraw => {
                let unfinished = plant.withdraw(t);
                self.exchanges += 1;
                let mut reply = encode_reply(&Event::default(), plant.next_event());
                reply[0] |= u8::from(unfinished) << 3;
                self.to_firmware.write_all(&reply)?;
                self.to_firmware.flush()?;
                return Ok(Served::Withdraw);
            }
        };
        self.exchanges += 1;
        self.to_firmware.write_all(&encode_reply(&event, plant.next_event()))?;
        self.to_firmware.flush()?;
        Ok(served)
    }

    /// The streams again, to close one before the other.
    pub fn into_streams(self) -> (R, W) {
        (self.from_firmware, self.to_firmware)
    }

    /// Requests answered so far.
    #[must_use]
    pub fn exchanges(&self) -> u64 {
        self.exchanges
    }

    /// Does what is asked of the flash.
    fn flash(&mut self, t: Ticks, request: &FlashRequest) -> Result<FlashReply, LockstepError> {
        let mut flash = self.flash.lock();
        let mut bytes = Vec::new();
        let outcome = match request {
            FlashRequest::Read { address, count } => {
                bytes.resize(usize::try_from(*count).unwrap_or(0), 0);
                flash.read(*address, &mut bytes).map(|()| t)
            }
            FlashRequest::Write { address, word } => flash.write_word(t, *address, word),
            FlashRequest::Erase { address } => flash.erase_sector(t, *address),
        };
        match outcome {
            Ok(ready) => Ok(FlashReply { ready, status: 0, bytes }),
            Err(FlashError::NoPower) => Err(LockstepError::PowerFailed),
            Err(error) => Ok(FlashReply { ready: t, status: error.code(), bytes: Vec::new() }),
        }
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
            5 => {
                let [a0, a1, a2, a3, c0, c1, c2, c3] = data;
                let (address, count) = (u32::from_le_bytes([a0, a1, a2, a3]), u32::from_le_bytes([c0, c1, c2, c3]));
                let operation = u16::from_le_bytes([id0, id1]);
                let mut word = vec![0; length.into()];
                let received = fill(&mut self.from_firmware, &mut word)?;
                if received < word.len() {
                    let expected = REQUEST_LENGTH + word.len();
                    return Err(LockstepError::Truncated { received: REQUEST_LENGTH + received, expected });
                }
                Request::Flash(match operation {
                    0 if length == 0 && count <= FLASH_READ_LIMIT => FlashRequest::Read { address, count },
                    1 if word.len() == WORD_BYTES => FlashRequest::Write { address, word },
                    2 if length == 0 => FlashRequest::Erase { address },
                    _ => return Err(LockstepError::Flash { operation, count, length }),
                })
            }
            6 => Request::Withdraw,
            kind => return Err(LockstepError::Kind { kind }),
        };
        Ok(Some((t, request)))
    }
}

/// Header and flash bytes of the reply to a request for the flash.
fn encode_flash_reply(flash: &FlashReply, next: Option<Ticks>) -> Vec<u8> {
    let mut reply = vec![0; REPLY_LENGTH];
    reply[8..16].copy_from_slice(&next.unwrap_or(NEVER).to_le_bytes());
    reply[16..24].copy_from_slice(&flash.ready.to_le_bytes());
    reply[24..28].copy_from_slice(&(flash.bytes.len() as u32).to_le_bytes());
    reply[28] = flash.status;
    reply.extend_from_slice(&flash.bytes);
    reply
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
