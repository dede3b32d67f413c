//! The far end of the chip's two wires in virtual time: a plant in this process or the lock step with another.

use std::fmt;
use std::io::{self, Read, Write};

use puck::{CanFrame, CanId};
use sim::lockstep::{NEVER, REPLY_LENGTH, REQUEST_LENGTH};
use sim::{Event, PlainLine, Plant, Ticks};

/// Nanoseconds of a tick of the lock step.
pub const TICK_NS: u64 = 40;

/// The other side of the chip's first CAN controller and of its host line.
///
/// Times are ticks since power-up. Every call names the time the chip has reached.
pub trait World: Send + fmt::Debug {
    /// The controller offers a frame to the bus.
    fn send(&mut self, now: Ticks, frame: CanFrame);

    /// Frames that the controller has offered and that have not begun on the wire are taken back. Whether a frame of
    /// its own has begun, whose end [`World::event`] has still to tell.
    fn withdraw(&mut self, now: Ticks) -> bool;

    /// Returns the event that has happened by `at`: one frame at most.
    fn event(&mut self, at: Ticks) -> Event;

    /// The chip's host line has carried these bytes.
    fn link(&mut self, now: Ticks, bytes: &[u8]);

    /// When [`World::event`] must be called next.
    fn next(&self) -> Option<Ticks>;

    /// True if the other side has ended: power is off.
    fn is_gone(&self) -> bool;
}

/// A plant in this process, with something that speaks for the host.
pub struct InProcess {
    plant: Plant,
    host: Box<dyn Host>,
}

/// The host's end of the serial line in this process.
pub trait Host: Send {
    /// Takes what the device has sent and answers.
    fn talk(&mut self, now: Ticks, bytes: &[u8]) -> Vec<u8>;

    /// The arm's bus has carried this frame, sent by the device or by another node.
    fn see(&mut self, passage: &sim::Passage);
}

impl InProcess {
    /// Joins both. The plant's own serial line is replaced: the chip times its bytes itself.
    #[must_use]
    pub fn new(mut plant: Plant, host: Box<dyn Host>) -> Self {
        plant.set_link_line(Box::new(PlainLine::default()));
        plant.record_bus();
        Self { plant, host }
    }
}

impl fmt::Debug for InProcess {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("InProcess").field("now", &self.plant.now()).finish_non_exhaustive()
    }
}

impl World for InProcess {
    fn send(&mut self, now: Ticks, frame: CanFrame) {
        self.plant.submit(now, frame);
    }

    fn withdraw(&mut self, now: Ticks) -> bool {
        self.plant.withdraw(now)
    }

    fn event(&mut self, at: Ticks) -> Event {
        let event = self.plant.event(at);
        for passage in self.plant.take_recorded() {
            self.host.see(&passage);
        }
        let answer = self.host.talk(self.plant.now(), &[]);
        self.plant.link_to_device(&answer);
        event
    }

    fn link(&mut self, now: Ticks, bytes: &[u8]) {
        self.plant.link_from_device(now, bytes);
        let bytes = self.plant.take_from_device();
        let answer = self.host.talk(now, &bytes);
        self.plant.link_to_device(&answer);
    }

    fn next(&self) -> Option<Ticks> {
        self.plant.next_event()
    }

    fn is_gone(&self) -> bool {
        false
    }
}

/// The lock step of `docs/lockstep.md` over two byte streams.
pub struct Lockstep<R, W> {
    from_host: R,
    to_host: W,
    next: Option<Ticks>,
    gone: bool,
}

impl<R: Read + Send, W: Write + Send> Lockstep<R, W> {
    /// Nothing asked yet.
    pub fn new(from_host: R, to_host: W) -> Self {
        Self { from_host, to_host, next: None, gone: false }
    }

    /// One exchange. A stream that ends is power that goes off, wherever it ends.
    fn ask(&mut self, kind: u8, identifier: u16, now: Ticks, data: &[u8], tail: &[u8]) -> (u8, Event) {
        if self.gone {
            return (0, Event::default());
        }
        match self.exchange(kind, identifier, now, data, tail) {
            Ok(answer) => answer,
            Err(_) => {
                self.gone = true;
                self.next = None;
                (0, Event::default())
            }
        }
    }

    fn exchange(&mut self, kind: u8, identifier: u16, now: Ticks, data: &[u8], tail: &[u8]) -> io::Result<(u8, Event)> {
        let mut request = Vec::with_capacity(REQUEST_LENGTH + tail.len());
        request.push(kind);
        request.push((data.len() + tail.len()) as u8);
        request.extend(identifier.to_le_bytes());
        request.extend([0; 4]);
        request.extend(now.to_le_bytes());
        request.extend(data);
        request.resize(REQUEST_LENGTH, 0);
        request.extend(tail);
        self.to_host.write_all(&request)?;
        self.to_host.flush()?;
        let mut reply = [0; REPLY_LENGTH];
        self.from_host.read_exact(&mut reply)?;
        let [flags, length, id0, id1, link_length, _, _, _, n0, n1, n2, n3, n4, n5, n6, n7, payload @ ..] = reply;
        let next = Ticks::from_le_bytes([n0, n1, n2, n3, n4, n5, n6, n7]);
        self.next = (next != NEVER).then_some(next);
        let mut link = vec![0; usize::from(link_length)];
        self.from_host.read_exact(&mut link)?;
        let received = (flags & 1 != 0)
            .then(|| {
                let id = CanId::new(u16::from_le_bytes([id0, id1]))?;
                CanFrame::from_slice(id, payload.get(..usize::from(length))?)
            })
            .flatten();
        Ok((flags, Event { received, transmitted: flags & 2 != 0, link }))
    }
}

impl<R, W> fmt::Debug for Lockstep<R, W> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Lockstep").field("next", &self.next).field("gone", &self.gone).finish_non_exhaustive()
    }
}

/// Most link bytes in one request: whole records of the host's CAN line too.
const LINK_LIMIT: usize = 253;

impl<R: Read + Send, W: Write + Send> World for Lockstep<R, W> {
    fn send(&mut self, now: Ticks, frame: CanFrame) {
        self.ask(1, frame.can_id().raw(), now, frame.payload(), &[]);
    }

    fn withdraw(&mut self, now: Ticks) -> bool {
        self.ask(6, 0, now, &[], &[]).0 & 8 != 0
    }

    fn event(&mut self, at: Ticks) -> Event {
        self.ask(2, 0, at, &[], &[]).1
    }

    fn link(&mut self, now: Ticks, bytes: &[u8]) {
        for part in bytes.chunks(LINK_LIMIT) {
            self.ask(4, 0, now, &[], part);
        }
    }

    fn next(&self) -> Option<Ticks> {
        self.next
    }

    fn is_gone(&self) -> bool {
        self.gone
    }
}
