//! Talks with the host.

use control::LoadRefusal;
use device::{Command, Core, Event, FitPrimitive, Health, QueueFull, SessionPort, TimedRecord, Timing};
use heapless::spsc::{Consumer, Producer};
use rtic_core::Mutex;

use super::Dialogue;
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
    pub(super) to_log: Producer<'static, Event>,
}

/// How much of its stack the image has used.
#[derive(Debug, Clone, Copy, Default)]
pub struct StackUse {
    /// Bytes never used so far.
    pub free: u32,
    /// Bytes of the stack; 0 where it is not measured.
    pub size: u32,
}

/// The task that runs once a slot.
pub struct SessionTask<E: Edge> {
    clock: E::Clock,
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

    fn load(&mut self, fit: &FitPrimitive<'_>) -> Result<(), LoadRefusal> {
        self.core.lock(|core| core.load(fit))
    }

    fn record(&mut self) -> Option<TimedRecord> {
        self.ends.from_core.dequeue()
    }

    fn event(&mut self) -> Option<Event> {
        let event = self.ends.news.dequeue()?;
        // The log is for people; if it lags, the link still has every event.
        let _ = self.ends.to_log.enqueue(event);
        Some(event)
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
    pub(super) fn new(clock: E::Clock, ends: Ends<E::LinkPort>) -> Self {
        Self { clock, ends }
    }

    /// Takes what came over the line and does everything that is due. Whether there is something to tell people afterwards.
    /// `stack` measures the stack, asked only when the host wants to know.
    pub fn run(
        &mut self,
        session: &mut Dialogue,
        core: impl Mutex<T = &'static mut Core>,
        meters: &Meters,
        stack: fn() -> StackUse,
    ) -> bool {
        let mut bytes = [0; LINK_CHUNK];
        loop {
            let count = self.ends.port.read(&mut bytes);
            session.receive(bytes.get(..count).unwrap_or(&[]));
            if count < LINK_CHUNK {
                break;
            }
        }
        session.poll(self.clock.now_us(), &mut Port { ends: &mut self.ends, core, meters, stack });
        !self.ends.to_log.is_empty()
    }
}
