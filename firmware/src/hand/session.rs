//! Talks with the host, for the hand image.

use device::{QueueFull, Timing};
use hand::{Command, Core, Event, FingerPrimitive, Health, Session, SessionPort, TimedRecord};
use heapless::spsc::{Consumer, Producer};
use rtic_core::Mutex;

use crate::application::StackUse;
use crate::board::{Clock, Edge, LinkPort};
use crate::meters::Meters;

/// Bytes taken from the line at a time; the rest waits in the port.
const LINK_CHUNK: usize = 128;

/// The session's ends of the queues, and its line.
pub(super) struct Ends<P> {
    pub(super) port: P,
    pub(super) to_core: Producer<'static, Command>,
    pub(super) from_core: Consumer<'static, TimedRecord>,
    pub(super) news: Consumer<'static, Event>,
}

/// The task that runs once a slot.
pub struct SessionTask<E: Edge> {
    clock: E::Clock,
    session: &'static mut Session<'static>,
    ends: Ends<E::LinkPort>,
}

/// The world of the session during one poll.
struct Port<'a, P, C> {
    ends: &'a mut Ends<P>,
    core: C,
    meters: &'a Meters,
    stack: fn() -> StackUse,
}

impl<P: LinkPort, C: Mutex<T = &'static mut Core>> SessionPort for Port<'_, P, C> {
    fn send(&mut self, bytes: &[u8]) {
        self.ends.port.write(bytes);
    }

    fn room(&self) -> usize {
        self.ends.port.room()
    }

    fn command(&mut self, command: Command) -> Result<(), QueueFull> {
        self.ends.to_core.enqueue(command).map_err(|_| QueueFull)
    }

    fn load(&mut self, primitive: &FingerPrimitive) -> bool {
        self.core.lock(|core| core.load(primitive))
    }

    fn record(&mut self) -> Option<TimedRecord> {
        self.ends.from_core.dequeue()
    }

    fn event(&mut self) -> Option<Event> {
        self.ends.news.dequeue()
    }

    fn health(&mut self) -> Health {
        self.core.lock(|core| core.health())
    }

    fn timing(&mut self) -> Timing {
        let StackUse { free, size } = (self.stack)();
        Timing {
            cost_worst_ticks: self.meters.cost_worst(),
            cost_mean_ticks: self.meters.cost_mean(),
            latency_worst_ticks: self.meters.latency_worst(),
            stack_free: free,
            stack_size: size,
        }
    }
}

impl<E: Edge> SessionTask<E> {
    pub(super) fn new(clock: E::Clock, session: &'static mut Session<'static>, ends: Ends<E::LinkPort>) -> Self {
        Self { clock, session, ends }
    }

    /// Takes what came over the line and does everything that is due.
    pub fn run(&mut self, core: impl Mutex<T = &'static mut Core>, meters: &Meters, stack: fn() -> StackUse) {
        let mut bytes = [0; LINK_CHUNK];
        loop {
            let count = self.ends.port.read(&mut bytes);
            self.session.receive(bytes.get(..count).unwrap_or(&[]));
            if count < LINK_CHUNK {
                break;
            }
        }
        self.session.poll(self.clock.now_us(), &mut Port { ends: &mut self.ends, core, meters, stack });
    }
}
