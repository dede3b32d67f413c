//! Talks with the host.

use control::LoadRefusal;
use device::{
    Application, Controller, FaultMemory, Health, HostSession, QueueFull, SessionPort, StoredWeight, TimedRecord,
    Timing,
};
use heapless::spsc::{Consumer, Producer};
use rtic_core::Mutex;

use crate::board::{Board, Clock, LinkPort};
use crate::meters::Meters;

/// Bytes taken from the line at a time; the rest waits in the port.
const LINK_CHUNK: usize = 128;

/// The session's ends of the queues, and its line.
pub(crate) struct SessionQueues<P, C: Controller> {
    pub(crate) port: P,
    pub(crate) to_core: Producer<'static, C::Command>,
    pub(crate) from_core: Consumer<'static, TimedRecord<C::Record>>,
    pub(crate) news: Consumer<'static, C::Event>,
    /// Events for people, where there is a log.
    pub(crate) to_log: Option<Producer<'static, C::Event>>,
    /// The last second before a fault, where there is room for it.
    pub(crate) faults: Option<&'static mut FaultMemory>,
}

/// Use of the stack by the image.
#[derive(Debug, Clone, Copy, Default)]
pub struct StackUse {
    /// Bytes never used so far.
    pub free: u32,
    /// Bytes of the stack; 0 where it is not measured.
    pub size: u32,
}

/// The task that runs once a slot.
pub struct SessionTask<B: Board, C: Controller> {
    clock: B::Clock,
    queues: SessionQueues<B::LinkPort, C>,
}

/// The world of the session during one poll.
struct Port<'a, P, C: Controller, M> {
    queues: &'a mut SessionQueues<P, C>,
    core: M,
    meters: &'a Meters,
    stack: fn() -> StackUse,
}

impl<P: LinkPort, C: Controller, M: Mutex<T = &'static mut C>> SessionPort<C> for Port<'_, P, C, M> {
    fn send(&mut self, bytes: &[u8]) {
        self.queues.port.write(bytes);
    }

    fn room(&self) -> usize {
        self.queues.port.room()
    }

    fn command(&mut self, command: C::Command) -> Result<(), QueueFull> {
        self.queues.to_core.enqueue(command).map_err(|_| QueueFull)
    }

    fn load(&mut self, primitive: C::Primitive<'_>) -> Result<(), LoadRefusal> {
        self.core.lock(|core| core.load(primitive))
    }

    fn weigh(&mut self, weight: &StoredWeight) -> bool {
        self.core.lock(|core| core.weigh(weight))
    }

    fn record(&mut self) -> Option<TimedRecord<C::Record>> {
        self.queues.from_core.dequeue()
    }

    fn event(&mut self) -> Option<C::Event> {
        let event = self.queues.news.dequeue()?;
        if let Some(log) = &mut self.queues.to_log {
            // The log is for people; if it lags, the link still has every event.
            let _ = log.enqueue(event);
        }
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

    fn fault_memory(&mut self) -> Option<&mut FaultMemory> {
        self.queues.faults.as_deref_mut()
    }
}

impl<B: Board, C: Controller> SessionTask<B, C> {
    pub(crate) fn new(clock: B::Clock, queues: SessionQueues<B::LinkPort, C>) -> Self {
        Self { clock, queues }
    }

    /// Takes what came over the line and does everything that is due. Returns true if there is something to tell people
    /// afterwards. `stack` measures the stack, asked only when the host wants to know.
    pub fn run<A: Application<Controller = C>>(
        &mut self,
        session: &mut HostSession<A>,
        core: impl Mutex<T = &'static mut C>,
        meters: &Meters,
        stack: fn() -> StackUse,
    ) -> bool {
        let mut bytes = [0; LINK_CHUNK];
        loop {
            let count = self.queues.port.read(&mut bytes);
            session.receive(bytes.get(..count).unwrap_or(&[]));
            if count < LINK_CHUNK {
                break;
            }
        }
        session.poll(self.clock.now_us(), &mut Port { queues: &mut self.queues, core, meters, stack });
        self.queues.to_log.as_ref().is_some_and(|log| !log.is_empty())
    }
}
