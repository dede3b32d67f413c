//! `can:`: the link's bytes as frames on a CAN bus, real or simulated.
//!
//! [`CanTransport`] cuts and joins the stream as `link::can` says; a [`CanPort`] sends and receives frames. Three ports
//! exist: [`SocketCan`], Linux' own CAN interfaces, and two of `simulation`: a bus in virtual time with a simulated
//! device on it, and the bus inside the emulated board.

mod problem;
mod socket;

use std::time::Duration;

use embedded_can::Frame;
use link::can::{DeviceNumber, Direction, Reassembler, SegmentCounters, Segmenter};
use puck::{CanFrame, CanId};

use super::{Transport, TransportError};

pub use problem::CanProblem;
pub use socket::SocketCan;

/// Sends and receives frames on a bus.
pub trait CanPort {
    /// Hands a frame over; frames leave in the order in which they are handed over.
    ///
    /// # Errors
    /// [`TransportError`] if the bus cannot be used.
    fn send(&mut self, frame: CanFrame) -> Result<(), TransportError>;

    /// The next data frame with an eleven-bit identifier; `None` if none comes within `timeout` of the port's own time.
    ///
    /// # Errors
    /// [`TransportError`] if the bus cannot be used.
    fn receive(&mut self, timeout: Duration) -> Result<Option<CanFrame>, TransportError>;

    /// Time of the clock that `timeout` counts on.
    fn now(&self) -> Duration;

    /// True if that clock is virtual.
    fn is_virtual(&self) -> bool;
}

/// The host's end of the link over a bus.
pub struct CanTransport<P> {
    port: P,
    sender: Segmenter,
    receiver: Reassembler,
}

impl<P: CanPort> CanTransport<P> {
    /// Talks with device number `device` over `port`.
    pub fn new(port: P, device: DeviceNumber) -> Self {
        Self {
            port,
            sender: Segmenter::new(Direction::ToDevice, device),
            receiver: Reassembler::new(Direction::ToHost, device),
        }
    }

    /// The port.
    pub fn port(&mut self) -> &mut P {
        &mut self.port
    }

    /// Counters of the segments that came.
    pub fn segments(&self) -> SegmentCounters {
        self.receiver.counters()
    }
}

impl<P: CanPort> Transport for CanTransport<P> {
    fn send(&mut self, mut bytes: &[u8]) -> Result<(), TransportError> {
        while let Some(segment) = self.sender.cut(&mut bytes) {
            // A segment always has an identifier of eleven bits and at most eight bytes.
            let frame = CanId::new(segment.id()).and_then(|id| CanFrame::new(id, segment.data()));
            self.port.send(frame.ok_or_else(|| TransportError::other("a segment is no CAN frame"))?)?;
        }
        Ok(())
    }

    fn receive(&mut self, timeout: Duration, out: &mut Vec<u8>) -> Result<(), TransportError> {
        let deadline = self.port.now() + timeout;
        let before = out.len();
        loop {
            // What has arrived already is taken together; only the first frame is worth waiting for.
            let patience = if out.len() > before { Duration::ZERO } else { deadline.saturating_sub(self.port.now()) };
            match self.port.receive(patience)? {
                Some(frame) => out.extend_from_slice(&self.receiver.take(frame.can_id().raw(), frame.payload())),
                None => return Ok(()),
            }
        }
    }

    fn now(&self) -> Duration {
        self.port.now()
    }

    fn is_virtual(&self) -> bool {
        self.port.is_virtual()
    }
}
