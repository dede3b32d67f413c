//! The hand alone, in fixed point: the halves of the crate `hand` in the tasks of [`crate::application`], without a log
//! and without storage. The library lives in memory.

use core::mem::MaybeUninit;

use device::{HostSession, Identity, Message, PENDING_COMMANDS, TimedRecord};
use hand::{Command, DeviceController, HandApplication, Library, Record, Session};
use heapless::spsc::Queue;
use puck::CanFrame;

use crate::application::{Cost, ReceiveTask, SessionQueues, SessionTask, SlotQueues, SlotTask, TransmitTask};
use crate::board::{Board, Clock, Parts, SlotTimer};
use crate::in_place;

/// Frames on their way to the controller: a cycle sends four.
const OUTGOING: usize = 8 + 1;
/// Frames on their way to the core: eight replies a cycle, and what a start-up brings.
const INCOMING: usize = 24 + 1;
/// Commands on their way to the core, which takes one per control cycle: as many as the session keeps track of.
const COMMANDS: usize = PENDING_COMMANDS + 1;
/// Records on their way to the session: 27 ms.
const RECORDS: usize = 8 + 1;
/// Events on their way to the session.
const EVENTS: usize = 12 + 1;

/// The queues between the tasks.
struct Queues {
    outgoing: Queue<CanFrame, OUTGOING>,
    incoming: Queue<CanFrame, INCOMING>,
    commands: Queue<Command, COMMANDS>,
    records: Queue<TimedRecord<Record>, RECORDS>,
    events: Queue<Message, EVENTS>,
}

/// Everything that lives as long as the image: put it into a static. [`start`] fills it where it is, because no task
/// should run above a stack on which the halves were made.
pub struct Memory {
    queues: Queues,
    library: Library,
    core: MaybeUninit<DeviceController>,
    session: MaybeUninit<Session<'static>>,
}

impl Memory {
    /// Not filled yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            queues: Queues {
                outgoing: Queue::new(),
                incoming: Queue::new(),
                commands: Queue::new(),
                records: Queue::new(),
                events: Queue::new(),
            },
            library: Library::EMPTY,
            core: MaybeUninit::uninit(),
            session: MaybeUninit::uninit(),
        }
    }
}

impl Default for Memory {
    fn default() -> Self {
        Self::new()
    }
}

/// Everything the image consists of, for the tasks that own or share it.
pub struct Application<B: Board> {
    /// Shared by slot and session.
    pub core: &'static mut DeviceController,
    /// Of the session task alone.
    pub session: &'static mut Session<'static>,
    /// Shared by slot, receiver and transmitter.
    pub can: B::Can,
    /// On `SLOT_TIMER`.
    pub slot_task: SlotTask<B, DeviceController>,
    /// On `CAN_RECEIVE`.
    pub receive_task: ReceiveTask,
    /// On `CAN_TRANSMIT`.
    pub transmit_task: TransmitTask,
    /// After every slot.
    pub session_task: SessionTask<B, DeviceController>,
}

/// Joins the application to the pieces of a board called `name`, and starts the timer of the slots.
pub fn start<B: Board>(
    firmware: &'static str,
    name: &'static str,
    serial: &'static str,
    parts: Parts<B>,
    memory: &'static mut Memory,
) -> Application<B> {
    let identity = Identity {
        firmware,
        board: name,
        serial,
        simulated: B::SIMULATED,
        ticks_per_second: <B::Clock as Clock>::HZ,
        instructions_per_tick: <B::Clock as Clock>::INSTRUCTIONS_PER_TICK,
    };
    let Parts { clock, mut slot_timer, can, link, light, .. } = parts;
    let Memory { queues, library, core, session } = memory;
    let (to_bus, outgoing) = queues.outgoing.split();
    let (incoming, from_bus) = queues.incoming.split();
    let (to_core, commands) = queues.commands.split();
    let (records, from_core) = queues.records.split();
    let (events, news) = queues.events.split();
    let core = in_place::keep(core, DeviceController::new);
    let session = in_place::build(session, HostSession::over(identity, HandApplication::new(library)));
    let slot_queues = SlotQueues { from_bus, to_bus, commands, records, events };
    let session_queues = SessionQueues { port: link, to_core, from_core, news, to_log: None, faults: None };
    // When everything is built, which takes a while: the first slot must find its task ready.
    slot_timer.start();
    Application {
        core,
        session,
        can,
        slot_task: SlotTask::new(clock, slot_timer, light, slot_queues, Cost::AllSlots),
        receive_task: ReceiveTask::new(incoming),
        transmit_task: TransmitTask::new(outgoing),
        session_task: SessionTask::new(clock, session_queues),
    }
}
