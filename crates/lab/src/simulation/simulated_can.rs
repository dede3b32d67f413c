//! A host's bus in virtual time with one simulated device on it: 1 Mbit/s, arbitration, exact frame times.
//!
//! Two ends share the bus. [`SimulatedCan`] is the host's: frames in, frames out, like an interface of the system.
//! The device's end takes the place of the serial line in the plant and cuts and joins the bytes as a board with a
//! second CAN controller does: one frame on the wire, one in the controller, the rest as bytes.
//!
//! Frames begin on whole microseconds, so that a log of this bus with its six decimals is exact.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use embedded_can::Frame;
use link::can::{DeviceNumber, Direction, Reassembler, SegmentCounters, Segmenter};
use puck::{CanFrame, CanId, Node};
use sim::{Bus, CHUNK, LinkLine, Passage, TICKS_PER_MICROSECOND, Ticks};

use super::Simulation;
use crate::transport::TransportError;
use crate::transport::can::CanPort;

/// The participants, as the bus numbers them.
const HOST: Node = Node::HOST;
const DEVICE: Node = Node::ARM[0];

/// Frames of the device that its controller holds, the one on the wire included. The rest waits as bytes, so that
/// frames are full while the line is busy.
const CONTROLLER: usize = 2;

/// The bus and what its ends have not taken yet.
pub struct HostBus {
    bus: Bus,
    sender: Segmenter,
    receiver: Reassembler,
    /// Bytes of the device that are not in a frame yet.
    from_device: VecDeque<u8>,
    /// Frames of the device in its controller.
    queued: usize,
    /// Bytes for the device that have arrived.
    to_device: VecDeque<u8>,
    /// Frames for the host that have arrived.
    to_host: VecDeque<CanFrame>,
}

/// The bus as both of its ends hold it.
type Shared = Arc<Mutex<HostBus>>;

impl HostBus {
    fn shared(device: DeviceNumber) -> Shared {
        Arc::new(Mutex::new(Self {
            bus: Bus::default(),
            sender: Segmenter::new(Direction::ToHost, device),
            receiver: Reassembler::new(Direction::ToDevice, device),
            from_device: VecDeque::new(),
            queued: 0,
            to_device: VecDeque::new(),
            to_host: VecDeque::new(),
        }))
    }

    /// Lets everything happen that is due by `now`.
    fn advance(&mut self, now: Ticks) {
        while let Some(at) = self.bus.next_time().filter(|at| *at <= now) {
            if let Some(passage) = self.bus.finish(at) {
                self.arrived(&passage);
            }
            self.fill(at);
            self.bus.arbitrate(at);
        }
        self.fill(now);
    }

    fn arrived(&mut self, passage: &Passage) {
        let frame = &passage.frame;
        if passage.sender == HOST {
            self.to_device.extend(self.receiver.take(frame.can_id().raw(), frame.payload()).iter());
        } else {
            self.queued -= 1;
            self.to_host.push_back(*frame);
        }
    }

    /// Cuts frames while the device's controller has room for them.
    fn fill(&mut self, now: Ticks) {
        while self.queued < CONTROLLER {
            let waiting = self.from_device.make_contiguous();
            let mut rest = &*waiting;
            let Some(segment) = self.sender.cut(&mut rest) else {
                return;
            };
            let taken = waiting.len() - rest.len();
            self.from_device.drain(..taken);
            // A segment always is a frame.
            if let Some(frame) = CanId::new(segment.id()).and_then(|id| CanFrame::new(id, segment.data())) {
                self.bus.queue(whole_microseconds(now), DEVICE, frame);
                self.queued += 1;
            }
        }
    }

    /// Counters of the device's end for the segments that came.
    #[must_use]
    pub fn device_segments(&self) -> SegmentCounters {
        self.receiver.counters()
    }
}

/// The next whole microsecond.
fn whole_microseconds(now: Ticks) -> Ticks {
    now.next_multiple_of(TICKS_PER_MICROSECOND)
}

/// Nobody panics while holding the lock; if somebody did, its own message is the one to see.
fn lock(bus: &Shared) -> MutexGuard<'_, HostBus> {
    bus.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The device's end, in the place of the serial line.
struct DeviceEnd(Shared);

impl LinkLine for DeviceEnd {
    /// The host sends frames, not bytes; nobody calls this while the host is on the bus.
    fn send_to_device(&mut self, _now: Ticks, _bytes: &[u8]) {}

    fn send_from_device(&mut self, now: Ticks, bytes: &[u8]) {
        let mut bus = lock(&self.0);
        bus.advance(now);
        bus.from_device.extend(bytes);
        bus.fill(now);
        bus.bus.arbitrate(now);
    }

    fn next_time(&self) -> Option<Ticks> {
        let bus = lock(&self.0);
        if bus.to_device.is_empty() { bus.bus.next_time() } else { Some(0) }
    }

    fn take_to_device(&mut self, now: Ticks) -> Vec<u8> {
        let mut bus = lock(&self.0);
        bus.advance(now);
        let count = bus.to_device.len().min(CHUNK);
        bus.to_device.drain(..count).collect()
    }

    fn take_from_device(&mut self, _now: Ticks) -> Vec<u8> {
        Vec::new()
    }

    fn backlog_from_device(&self, now: Ticks) -> usize {
        let mut bus = lock(&self.0);
        bus.advance(now);
        bus.from_device.len() + bus.queued * link::can::SEGMENT_BYTES
    }
}

/// A simulated device behind a bus.
pub struct SimulatedCan {
    simulation: Simulation,
    bus: Shared,
}

impl SimulatedCan {
    /// Puts a bus in the place of the serial line of a simulation that has not been talked with yet.
    #[must_use]
    pub fn attach(mut simulation: Simulation, device: DeviceNumber) -> Self {
        let bus = HostBus::shared(device);
        simulation.plant().set_link_line(Box::new(DeviceEnd(Arc::clone(&bus))));
        if simulation.keeps_bus_log() {
            lock(&bus).bus.record();
        }
        Self { simulation, bus }
    }

    /// The simulation.
    pub fn simulation(&mut self) -> &mut Simulation {
        &mut self.simulation
    }

    /// The bus, to look at.
    pub fn inspect<R>(&self, look: impl FnOnce(&HostBus) -> R) -> R {
        look(&lock(&self.bus))
    }

    /// Writes what both buses carried since the last time.
    fn log(&mut self) -> Result<(), TransportError> {
        if self.simulation.keeps_bus_log() {
            let passages = lock(&self.bus).bus.take_recorded();
            self.simulation.log_buses(&passages)?;
        }
        Ok(())
    }
}

impl CanPort for SimulatedCan {
    fn send(&mut self, frame: CanFrame) -> Result<(), TransportError> {
        let now = self.simulation.ticks();
        let mut bus = lock(&self.bus);
        bus.advance(now);
        bus.bus.queue(whole_microseconds(now), HOST, frame);
        bus.bus.arbitrate(now);
        Ok(())
    }

    fn receive(&mut self, timeout: Duration) -> Result<Option<CanFrame>, TransportError> {
        let bus = Arc::clone(&self.bus);
        let mut frame = None;
        self.simulation.advance_until(timeout, |now| {
            let mut bus = lock(&bus);
            bus.advance(now);
            frame = bus.to_host.pop_front();
            frame.is_some()
        })?;
        self.log()?;
        Ok(frame)
    }

    fn now(&self) -> Duration {
        self.simulation.elapsed()
    }

    fn is_virtual(&self) -> bool {
        true
    }
}
