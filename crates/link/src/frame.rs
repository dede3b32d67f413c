//! One message to bytes and back, over any stream of bytes.
//!
//! ```text
//! payload = session u16 | sequence u16 | time u32 | message (postcard) | CRC-32 u32      little endian
//! frame   = COBS(payload) | 0x00
//! ```
//! COBS leaves no zero byte inside a frame, so after any garbage the next zero byte is a boundary again.
//! The CRC is CRC-32/ISCSI (polynomial 0x1EDC6F41, reflected) over everything before it: among messages of
//! this length it finds every error of up to five bits and every burst of up to 32.
//!
//! A hello that cannot be read wholly, because another version has fewer fields or other ones, still tells its link
//! version and its schema hash: both sides must be able to say that they do not fit, and a dropped hello looks like a
//! dead line.
//!
//! The two time limits of the link are here as well: [`REQUEST_AGE_LIMIT_MS`] and [`LINK_TIMEOUT_MS`].
//!
//! Invariants: [`Decoder`] takes any bytes in any portions, never panics, needs constant memory, and counts
//! every non-empty run between zero bytes exactly once, as accepted or under its reason.

use core::fmt;

use crc::{CRC_32_ISCSI, Crc};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::message::{DeviceHello, HostHello, Reply, Request};
use crate::name::Text;
use crate::report::LinkCounters;
use crate::schema::{LINK_VERSION, SCHEMA_HASH};

/// Bytes of the envelope in front of the message.
pub const ENVELOPE_BYTES: usize = 8;

/// Most bytes of one message in postcard. The largest is telemetry, 207 bytes; a chunk of an image has 203.
pub const MESSAGE_BYTES: usize = 216;

const CRC_BYTES: usize = 4;

/// Most bytes of a payload: envelope, message, check sum.
pub const PAYLOAD_BYTES: usize = ENVELOPE_BYTES + MESSAGE_BYTES + CRC_BYTES;

/// Most bytes of a frame on the wire, its zero byte included.
pub const FRAME_BYTES: usize = cobs::max_encoding_length(PAYLOAD_BYTES) + 1;

/// A request that can move the arm is refused when it comes more than so many ms (device time) after the
/// moment its envelope names. Shorter would refuse honest requests over slow lines.
pub const REQUEST_AGE_LIMIT_MS: u32 = 500;

/// After so many ms without a request the device stops a motion, and another host may take the session over.
pub const LINK_TIMEOUT_MS: u32 = 500;

/// The check sum of frames and images, CRC-32/ISCSI.
pub const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISCSI);

/// Header of every message. Its layout is frozen, as is that of `Hello`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Envelope {
    /// Number the host chose for its session with `Hello`; the device's messages repeat it. 0 is no session.
    pub session: u16,
    /// Host: number of the request, the same again when it is repeated. Device: one up for every message.
    pub sequence: u16,
    /// Device: ms since start-up. Host: the latest such time it had seen when the request was decided on.
    pub time_ms: u32,
}

impl Envelope {
    fn to_bytes(self) -> [u8; ENVELOPE_BYTES] {
        let session = self.session.to_le_bytes();
        let sequence = self.sequence.to_le_bytes();
        let time = self.time_ms.to_le_bytes();
        [session[0], session[1], sequence[0], sequence[1], time[0], time[1], time[2], time[3]]
    }

    fn from_bytes(bytes: [u8; ENVELOPE_BYTES]) -> Self {
        let [s0, s1, n0, n1, t0, t1, t2, t3] = bytes;
        Self {
            session: u16::from_le_bytes([s0, s1]),
            sequence: u16::from_le_bytes([n0, n1]),
            time_ms: u32::from_le_bytes([t0, t1, t2, t3]),
        }
    }
}

/// A message that came in a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame<M> {
    /// Its header.
    pub envelope: Envelope,
    /// The message.
    pub message: M,
}

/// Content of a frame: [`Request`] and [`Reply`].
pub trait Message: Serialize + DeserializeOwned {
    /// True if bytes after the message are to be ignored instead of refused. True for the hellos alone:
    /// a later version may have more to say there, and must still be told that it is a later version.
    fn tolerates_more(&self) -> bool;

    /// The hello of another version out of the bytes of a message that cannot be read: link version and schema hash,
    /// all other fields empty. `None` for what is no hello, and for the hello of this version, which is damaged then.
    fn foreign_hello(body: &[u8]) -> Option<Self>;
}

/// Number of the hello among the requests and among the replies. Frozen.
const HELLO: u32 = 0;

/// Link version and schema hash from the front of `fields`, if they are of another version than this one.
fn foreign_version(fields: &[u8]) -> Option<(u16, u32)> {
    let (link_version, rest) = postcard::take_from_bytes::<u16>(fields).ok()?;
    let (schema_hash, _) = postcard::take_from_bytes::<u32>(rest).ok()?;
    (link_version != LINK_VERSION || schema_hash != SCHEMA_HASH).then_some((link_version, schema_hash))
}

impl Message for Request {
    fn tolerates_more(&self) -> bool {
        matches!(self, Self::Hello(_))
    }

    fn foreign_hello(body: &[u8]) -> Option<Self> {
        let (HELLO, fields) = postcard::take_from_bytes::<u32>(body).ok()? else {
            return None;
        };
        let (link_version, schema_hash) = foreign_version(fields)?;
        Some(Self::Hello(HostHello { link_version, schema_hash, model_hash: 0, owner: Text::new("") }))
    }
}

impl Message for Reply {
    fn tolerates_more(&self) -> bool {
        matches!(self, Self::Hello { .. })
    }

    fn foreign_hello(body: &[u8]) -> Option<Self> {
        let (HELLO, fields) = postcard::take_from_bytes::<u32>(body).ok()? else {
            return None;
        };
        let (of, fields) = postcard::take_from_bytes::<u16>(fields).ok()?;
        let (link_version, schema_hash) = foreign_version(fields)?;
        let hello = DeviceHello { link_version, schema_hash, ..DeviceHello::default() };
        Some(Self::Hello { of, hello })
    }
}

/// Why a message could not be put into a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EncodeError {
    /// The message is larger than [`MESSAGE_BYTES`].
    MessageTooLong,
    /// The buffer given is too small; [`FRAME_BYTES`] always suffice.
    BufferTooSmall,
}

impl fmt::Display for EncodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::MessageTooLong => "the message is longer than a frame can carry",
            Self::BufferTooSmall => "the buffer is smaller than the frame",
        })
    }
}

impl core::error::Error for EncodeError {}

/// Writes one frame, its zero byte included, to the front of `out` and returns its length.
///
/// # Errors
/// [`EncodeError::BufferTooSmall`] if `out` is too short; never with [`FRAME_BYTES`] of room.
pub fn encode<M: Message>(envelope: Envelope, message: &M, out: &mut [u8]) -> Result<usize, EncodeError> {
    let mut payload = [0_u8; PAYLOAD_BYTES];
    let (head, body) = payload.split_at_mut(ENVELOPE_BYTES);
    head.copy_from_slice(&envelope.to_bytes());
    let room = body.get_mut(..MESSAGE_BYTES).ok_or(EncodeError::MessageTooLong)?;
    let length = postcard::to_slice(message, room).map_err(|_| EncodeError::MessageTooLong)?.len();
    let covered = ENVELOPE_BYTES + length;
    let crc = CRC.checksum(payload.get(..covered).ok_or(EncodeError::MessageTooLong)?);
    payload
        .get_mut(covered..covered + CRC_BYTES)
        .ok_or(EncodeError::MessageTooLong)?
        .copy_from_slice(&crc.to_le_bytes());
    let payload = payload.get(..covered + CRC_BYTES).ok_or(EncodeError::MessageTooLong)?;
    let stuffed = cobs::try_encode(payload, out).map_err(|_| EncodeError::BufferTooSmall)?;
    *out.get_mut(stuffed).ok_or(EncodeError::BufferTooSmall)? = 0;
    Ok(stuffed + 1)
}

/// Why a run of bytes between two zero bytes was dropped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Drop {
    Cobs,
    Crc,
    Undecodable,
}

/// Takes bytes as they come and gives messages. `N` = most bytes of a frame without its zero byte.
#[derive(Debug, Clone)]
pub struct Decoder<const N: usize = FRAME_BYTES> {
    buffer: [u8; N],
    length: usize,
    overflow: bool,
    counters: LinkCounters,
}

impl<const N: usize> Default for Decoder<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Decoder<N> {
    /// A decoder at the start of a stream.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            buffer: [0; N],
            length: 0,
            overflow: false,
            counters: LinkCounters { accepted: 0, bad_cobs: 0, bad_crc: 0, too_long: 0, undecodable: 0, overrun: 0 },
        }
    }

    /// Counters so far.
    #[must_use]
    pub const fn counters(&self) -> LinkCounters {
        self.counters
    }

    /// Forgets a frame that has begun, for a connection that was opened anew. Counters stay.
    pub fn reset(&mut self) {
        self.length = 0;
        self.overflow = false;
    }

    /// Takes bytes off the front of `input` up to and including the next good frame.
    ///
    /// Returns `None` when `input` is used up; what it left of a frame is kept for the next call. Bad frames
    /// are counted and skipped. Call it until it returns `None`.
    pub fn next<M: Message>(&mut self, input: &mut &[u8]) -> Option<Frame<M>> {
        while let Some((&byte, rest)) = input.split_first() {
            *input = rest;
            if byte != 0 {
                match self.buffer.get_mut(self.length) {
                    Some(place) => {
                        *place = byte;
                        self.length += 1;
                    }
                    None => self.overflow = true,
                }
                continue;
            }
            let length = core::mem::take(&mut self.length);
            if core::mem::take(&mut self.overflow) {
                count(&mut self.counters.too_long);
            } else if length > 0 {
                match self.take(length) {
                    Ok(frame) => {
                        count(&mut self.counters.accepted);
                        return Some(frame);
                    }
                    Err(Drop::Cobs) => count(&mut self.counters.bad_cobs),
                    Err(Drop::Crc) => count(&mut self.counters.bad_crc),
                    Err(Drop::Undecodable) => count(&mut self.counters.undecodable),
                }
            }
        }
        None
    }

    /// Decodes the `length` bytes in the buffer.
    fn take<M: Message>(&mut self, length: usize) -> Result<Frame<M>, Drop> {
        let stuffed = self.buffer.get_mut(..length).ok_or(Drop::Cobs)?;
        let length = cobs::decode_in_place(stuffed).map_err(|_| Drop::Cobs)?;
        let payload = self.buffer.get(..length).ok_or(Drop::Cobs)?;
        let (covered, crc) = payload.split_last_chunk::<CRC_BYTES>().ok_or(Drop::Crc)?;
        if CRC.checksum(covered) != u32::from_le_bytes(*crc) {
            return Err(Drop::Crc);
        }
        let (envelope, body) = covered.split_first_chunk::<ENVELOPE_BYTES>().ok_or(Drop::Undecodable)?;
        let message = match postcard::take_from_bytes::<M>(body) {
            Ok((message, rest)) if rest.is_empty() || message.tolerates_more() => message,
            Ok(_) => return Err(Drop::Undecodable),
            Err(_) => M::foreign_hello(body).ok_or(Drop::Undecodable)?,
        };
        Ok(Frame { envelope: Envelope::from_bytes(*envelope), message })
    }
}

fn count(counter: &mut u32) {
    *counter = counter.wrapping_add(1);
}
