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
    fn send(&mut self, bytes: &[u8]) -> Result<(), TransportError> {
        // The device hears all hosts of a bus in one sequence. Without a zero byte in front, what follows on a message
        // of another is lost, and two who speak in turn silence each other, for ever if neither repeats anything.
        let ended = [&[0], bytes].concat();
        let mut rest = ended.as_slice();
        while let Some(segment) = self.sender.cut(&mut rest) {
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
            let Some(frame) = self.port.receive(patience)? else { return Ok(()) };
            let piece = self.receiver.take(frame.can_id().raw(), frame.payload());
            out.extend_from_slice(&piece);
            // Not until the bus is quiet. Under telemetry of every cycle it never is for as long as the system waits
            // at least, some milliseconds on Linux: a host that goes on listening is taken for silent.
            if piece.contains(&0) || self.port.now() >= deadline {
                return Ok(());
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

#[cfg(test)]
mod tests {
    use link::frame::{Decoder, Envelope, FRAME_BYTES, encode};
    use link::{Reply, Telemetry};

    use super::*;

    /// Time of a full frame on the wire, with its stuff bits.
    const FRAME: Duration = Duration::from_micros(120);

    /// Time of a control cycle.
    const CYCLE: Duration = Duration::from_micros(3333);

    /// A socket of Linux while a device sends telemetry of every cycle: a shorter wait for a frame than this takes so
    /// long all the same, because it counts ticks of the kernel (6 to 8 ms were measured at 250 Hz).
    const SHORTEST_WAIT: Duration = Duration::from_millis(6);

    /// No conversation looks on for so long.
    const END: Duration = Duration::from_secs(2);

    struct Socket {
        now: Duration,
        frames: std::collections::VecDeque<(Duration, CanFrame)>,
    }

    impl Socket {
        fn with_telemetry() -> Self {
            let mut sender = Segmenter::new(Direction::ToHost, DeviceNumber::FIRST);
            let mut frames = std::collections::VecDeque::new();
            for cycle in 0..(END.as_micros() / CYCLE.as_micros()) as u32 {
                let mut bytes = [0; FRAME_BYTES];
                let message = Reply::Telemetry(Telemetry { cycle, q: [1.5; 7], tau: [2.5; 7], ..Telemetry::default() });
                let length = encode(Envelope::default(), &message, &mut bytes).expect("it fits");
                let mut rest = &bytes[..length];
                let mut due = CYCLE * cycle;
                while let Some(segment) = sender.cut(&mut rest) {
                    due += FRAME;
                    let id = CanId::new(segment.id()).expect("eleven bits");
                    frames.push_back((due, CanFrame::new(id, segment.data()).expect("eight bytes")));
                }
            }
            Self { now: Duration::ZERO, frames }
        }
    }

    impl CanPort for Socket {
        fn send(&mut self, _frame: CanFrame) -> Result<(), TransportError> {
            Ok(())
        }

        fn receive(&mut self, timeout: Duration) -> Result<Option<CanFrame>, TransportError> {
            let end = self.now + timeout.max(SHORTEST_WAIT);
            let frame = self.frames.pop_front_if(|(due, _)| *due <= end);
            self.now = frame.map_or(end, |(due, _)| self.now.max(due));
            Ok(frame.map(|(_, frame)| frame))
        }

        fn now(&self) -> Duration {
            self.now
        }

        fn is_virtual(&self) -> bool {
            false
        }
    }

    #[test]
    fn a_bus_that_is_never_quiet_leaves_its_host_the_time_to_speak() {
        let mut transport = CanTransport::new(Socket::with_telemetry(), DeviceNumber::FIRST);
        let (mut decoder, mut cycles) = (Decoder::<FRAME_BYTES>::new(), Vec::new());
        for _ in 0..20 {
            let (before, mut bytes) = (transport.now(), Vec::new());
            transport.receive(Duration::from_millis(100), &mut bytes).expect("it works");
            let took = transport.now() - before;
            assert!(took <= 2 * CYCLE, "{took:?}: the device takes a host for silent that says nothing for 500 ms");
            let mut rest = bytes.as_slice();
            while let Some(frame) = decoder.next::<Reply>(&mut rest) {
                let Reply::Telemetry(telemetry) = frame.message else { panic!("{:?}", frame.message) };
                cycles.push(telemetry.cycle);
            }
        }
        assert!(cycles.iter().copied().eq(0..20), "{cycles:?}");
    }

    #[test]
    fn what_comes_on_for_ever_and_brings_nothing_is_waited_for_no_longer_than_was_said() {
        let mut socket = Socket::with_telemetry();
        // The first segment is missing, and no message ends.
        socket.frames.pop_front();
        let (bytes, own) = ([0xA5; 8], |sequence: usize| link::can::Heading {
            direction: Direction::ToHost,
            device: DeviceNumber::FIRST,
            sequence: (sequence * 2) as u8 & 0xF,
        });
        for (place, (_, frame)) in socket.frames.iter_mut().enumerate() {
            let id = CanId::new(own(place).id()).expect("eleven bits");
            *frame = CanFrame::new(id, &bytes).expect("eight bytes");
        }
        let mut transport = CanTransport::new(socket, DeviceNumber::FIRST);
        transport.receive(Duration::from_millis(100), &mut Vec::new()).expect("it works");
        assert!(transport.now() <= Duration::from_millis(100) + SHORTEST_WAIT, "{:?}", transport.now());
    }
}
