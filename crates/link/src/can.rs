//! The link's bytes over classic CAN frames: eight of them a frame, their order in the identifier.
//!
//! The stream that a serial line carries ([`crate::frame`]) is cut into segments of one to eight bytes. All eight bytes
//! of a frame are the stream's; what the receiver needs besides stands in the identifier:
//!
//! ```text
//! bit    10   9          8..5            4   3..0
//!        0    direction  device number   1   sequence number
//!             0 to the device, 1 to the host
//! ```
//! Device 0 is sent to with identifiers 0x010 to 0x01F and answers with 0x210 to 0x21F. To the device comes first in
//! arbitration, so a stop overtakes telemetry on the wire. Bit 10 clear and bit 4 set is what Barrett's pucks read as
//! "to node 16 to 31": on the arm's bus, where such frames never belong, no puck of a WAM would take one for an order
//! (nodes 1 to 14).
//!
//! The sequence number goes up by one with every segment of a sender and a direction. So a receiver sees a lost, a
//! doubled and an overtaken segment; see [`Reassembler`] for what it then does. A sender must let its frames leave in
//! the order in which they were cut: a controller that sends its mailboxes by priority of identifiers must be set to
//! send first in, first out.

use core::fmt;
use core::ops::Deref;

/// Most bytes of the stream in one frame: all that a classic frame holds.
pub const SEGMENT_BYTES: usize = 8;

/// Bit rate of the host's bus, bit/s, the same as that of the arm's.
pub const BITS_PER_SECOND: u32 = 1_000_000;

/// Bits of a frame of eight bytes with its interframe space and without stuff bits: the shortest there is.
pub const FULL_FRAME_BITS: u32 = 47 + 8 * SEGMENT_BYTES as u32;

/// Payload of back-to-back full frames, byte/s: the rate of the line, which throughputs are shares of. 72 kB/s, 57.7 %
/// of the bits.
pub const LINE_BYTES_PER_SECOND: f64 = BITS_PER_SECOND as f64 * SEGMENT_BYTES as f64 / FULL_FRAME_BITS as f64;

const DIRECTION_BIT: u16 = 0x200;
const SEGMENT_BIT: u16 = 0x010;
const DEVICE_SHIFT: u16 = 5;
const FOUR_BITS: u16 = 0xF;

/// Number of a device on a host's bus, 0 to 15.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct DeviceNumber(u8);

impl DeviceNumber {
    /// The device of a bus that has one.
    pub const FIRST: Self = Self(0);

    /// A device by number; `None` above 15.
    #[must_use]
    pub const fn new(number: u8) -> Option<Self> {
        if number as u16 <= FOUR_BITS { Some(Self(number)) } else { None }
    }

    /// The number, 0 to 15.
    #[must_use]
    pub const fn number(self) -> u8 {
        self.0
    }
}

impl fmt::Display for DeviceNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0)
    }
}

/// Direction of a segment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Direction {
    /// From the host.
    ToDevice,
    /// From the device.
    ToHost,
}

/// Content of a segment's identifier.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Heading {
    /// Its direction.
    pub direction: Direction,
    /// The device that sends it or is meant.
    pub device: DeviceNumber,
    /// Its place among the segments of its sender, 0 to 15.
    pub sequence: u8,
}

impl Heading {
    /// The eleven-bit identifier.
    #[must_use]
    pub const fn id(self) -> u16 {
        let direction = match self.direction {
            Direction::ToDevice => 0,
            Direction::ToHost => DIRECTION_BIT,
        };
        direction | (self.device.0 as u16) << DEVICE_SHIFT | SEGMENT_BIT | (self.sequence as u16 & FOUR_BITS)
    }

    /// Decodes an identifier; `None` if it is not that of a segment.
    #[must_use]
    pub const fn parse(id: u16) -> Option<Self> {
        let direction = if id & DIRECTION_BIT == 0 { Direction::ToDevice } else { Direction::ToHost };
        let device = DeviceNumber((id >> DEVICE_SHIFT & FOUR_BITS) as u8);
        let heading = Self { direction, device, sequence: (id & FOUR_BITS) as u8 };
        // Every other bit is as it is in the identifier of a segment.
        if heading.id() == id { Some(heading) } else { None }
    }
}

/// Identifier and mask of a hardware filter that passes exactly the segments of one direction and device.
#[must_use]
pub const fn filter(direction: Direction, device: DeviceNumber) -> (u16, u16) {
    (Heading { direction, device, sequence: 0 }.id(), 0x7FF & !FOUR_BITS)
}

/// One frame's worth of the stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Segment {
    id: u16,
    length: u8,
    data: [u8; SEGMENT_BYTES],
}

impl Segment {
    /// `None` unless there are one to eight bytes.
    fn new(heading: Heading, bytes: &[u8]) -> Option<Self> {
        let mut data = [0; SEGMENT_BYTES];
        data.get_mut(..bytes.len())?.copy_from_slice(bytes);
        (!bytes.is_empty()).then_some(Self { id: heading.id(), length: bytes.len() as u8, data })
    }

    /// Its place among the segments of its sender, 0 to 15.
    const fn sequence(&self) -> u8 {
        (self.id & FOUR_BITS) as u8
    }

    /// The eleven-bit identifier.
    #[must_use]
    pub const fn id(&self) -> u16 {
        self.id
    }

    /// One to eight bytes.
    #[must_use]
    pub fn data(&self) -> &[u8] {
        // `length` never exceeds eight; `get` spares the panic path.
        self.data.get(..usize::from(self.length)).unwrap_or(&[])
    }
}

/// Cuts a stream into segments.
#[derive(Debug, Clone)]
pub struct Segmenter {
    next: Heading,
}

impl Segmenter {
    /// The sender at the beginning of a stream.
    #[must_use]
    pub const fn new(direction: Direction, device: DeviceNumber) -> Self {
        Self { next: Heading { direction, device, sequence: 0 } }
    }

    /// Takes up to eight bytes off the front of `bytes`; `None` if there are none.
    ///
    /// Segments know nothing of messages: one may hold the end of one and the beginning of the next. Cutting as late as
    /// possible, when the controller has room for a frame, fills the frames while the line is busy.
    pub fn cut(&mut self, bytes: &mut &[u8]) -> Option<Segment> {
        let (head, rest) = bytes.split_at_checked(bytes.len().min(SEGMENT_BYTES))?;
        let segment = Segment::new(self.next, head)?;
        *bytes = rest;
        self.next.sequence = following(self.next.sequence);
        Some(segment)
    }
}

/// Counters of a reassembler.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SegmentCounters {
    /// Segments that came in their turn.
    pub accepted: u32,
    /// Segments that came twice and were taken once.
    pub duplicates: u32,
    /// Times at which the next segment was another than expected: some were lost, or overtook each other.
    pub gaps: u32,
    /// Frames with the identifier of a segment and no byte, or more than eight.
    pub malformed: u32,
}

/// Bytes of the stream that one segment brought: at most its own, and a zero byte before them.
#[derive(Debug, Clone, Copy)]
pub struct Piece {
    length: usize,
    bytes: [u8; SEGMENT_BYTES + 1],
}

impl Piece {
    const EMPTY: Self = Self { length: 0, bytes: [0; SEGMENT_BYTES + 1] };

    fn push(&mut self, byte: u8) {
        // A segment has at most eight bytes, and at most one zero is put before them.
        if let Some(place) = self.bytes.get_mut(self.length) {
            *place = byte;
            self.length += 1;
        }
    }
}

impl Deref for Piece {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or(&[])
    }
}

/// Puts a stream together again.
///
/// As long as every segment comes in its turn, the bytes are those that were cut. A segment that comes a second time
/// right after the first (a sender repeats a frame whose acknowledgement it missed) is dropped. At a gap the message
/// under way is lost: the reassembler ends it with a zero byte, so that what comes later cannot be taken for its
/// continuation, and drops the rest up to the next zero byte of the stream, so that a tail without its head cannot be
/// taken for a message. A message of the link is thus delivered whole, or its check sum sees that it is not; the host
/// repeats what was not answered.
///
/// Sixteen segments lost in a row go unnoticed here. The check sum of the message then sees it, as it does on a serial
/// line.
#[derive(Debug, Clone)]
pub struct Reassembler {
    direction: Direction,
    device: DeviceNumber,
    /// The segment that came last; `None` before the first: whatever comes then begins the stream.
    last: Option<Segment>,
    /// Bytes have been delivered since the last zero byte.
    inside: bool,
    /// A gap: nothing is delivered before the next zero byte has passed.
    skipping: bool,
    counters: SegmentCounters,
}

impl Reassembler {
    /// The receiver at the beginning of a stream.
    #[must_use]
    pub const fn new(direction: Direction, device: DeviceNumber) -> Self {
        let counters = SegmentCounters { accepted: 0, duplicates: 0, gaps: 0, malformed: 0 };
        Self { direction, device, last: None, inside: false, skipping: false, counters }
    }

    /// Counters so far.
    #[must_use]
    pub const fn counters(&self) -> SegmentCounters {
        self.counters
    }

    /// Takes a frame off the bus and gives the bytes it brings; none for frames of others.
    pub fn take(&mut self, id: u16, data: &[u8]) -> Piece {
        let mut piece = Piece::EMPTY;
        let Some(heading) = Heading::parse(id) else {
            return piece;
        };
        if (heading.direction, heading.device) != (self.direction, self.device) {
            return piece;
        }
        let Some(segment) = Segment::new(heading, data) else {
            count(&mut self.counters.malformed);
            return piece;
        };
        if self.last == Some(segment) {
            count(&mut self.counters.duplicates);
            return piece;
        }
        if self.last.is_none_or(|last| heading.sequence == following(last.sequence())) {
            count(&mut self.counters.accepted);
        } else {
            count(&mut self.counters.gaps);
            if self.inside {
                piece.push(0);
                self.inside = false;
            }
            self.skipping = true;
        }
        self.last = Some(segment);
        for &byte in data {
            if self.skipping {
                self.skipping = byte != 0;
            } else {
                piece.push(byte);
                self.inside = byte != 0;
            }
        }
        piece
    }
}

/// The sequence number after this one.
const fn following(sequence: u8) -> u8 {
    (sequence + 1) & FOUR_BITS as u8
}

fn count(counter: &mut u32) {
    *counter = counter.wrapping_add(1);
}
