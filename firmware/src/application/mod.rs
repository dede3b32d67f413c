//! The bodies of the tasks, for any board.
//!
//! ```text
//! SLOT_TIMER 900 Hz ─> slot (12): controller ─commands<─┐      ┌─ session (2): Session <─> link port
//!                        │  ^           ─records>──┼──────┤        │ library
//!              frames out│  │frames in  ─events>───┘      └─ log (1) │
//!                        v  │                                 idle (0): flash
//! CAN_TRANSMIT ─> can_transmit (10)   can_receive (10) <─ CAN_RECEIVE
//! ```
//!
//! Numbers are priorities. The halves share nothing but queues, except where the session reads the core's health or
//! loads a primitive, and where the idle task takes an image from the library: each time for at most one copy.
//!
//! The binaries bind these bodies to interrupts and lend them what is shared; no word here names a board, and the
//! tests of this package run them on a board made of memory.

mod bus;
mod log;
mod session;
mod slot;
mod storage;

use core::mem::MaybeUninit;

use device::storage::{Library, Scratch, value_bytes};
use device::{Command, DeviceController, Event, FaultMemory, Identity, PENDING_COMMANDS, Session, TimedRecord};
use heapless::spsc::Queue;
use link::image::IMAGE_BYTES_LIMIT;
use puck::CanFrame;

use crate::board::{Board, Clock, Parts, SlotTimer};
use crate::in_place;

pub use bus::{ReceiveTask, TransmitTask};
pub use log::{Log, LogTask};
pub(crate) use session::SessionQueues;
pub use session::{SessionTask, StackUse};
pub use slot::SlotTask;
pub(crate) use slot::{Cost, SlotQueues};
pub use storage::{keep_library, rest};

/// Frames on their way to the controller. A cycle sends at most 8, of these 5 in its control slot (torques of arm,
/// wrist and hand, two questions to the hand); 16 hold two cycles of a dead bus.
const OUTGOING: usize = 16 + 1;
/// Frames on their way to the core. The bus carries at most 24 of the shortest in a slot, and each slot drains them.
const INCOMING: usize = 32 + 1;
/// Commands on their way to the core, which takes one per control cycle: as many as the session keeps track of.
const COMMANDS: usize = PENDING_COMMANDS + 1;
/// Cycle records on their way to the session: 50 ms, longer than it ever works in one go (checking an image).
const RECORDS: usize = 16 + 1;
/// Events on their way to the session: a start-up tells about 10 of them, each in a slot of its own.
const EVENTS: usize = 16 + 1;

/// Primitives kept, beside the one being uploaded.
pub const PRIMITIVES: usize = 4;

/// The library in memory.
pub type PrimitiveLibrary = Library<PRIMITIVES, IMAGE_BYTES_LIMIT>;

/// The session of this application.
pub type ArmSession = Session<&'static mut PrimitiveLibrary>;

/// Memory of the task that keeps the library on the flash.
pub type StorageScratch = Scratch<IMAGE_BYTES_LIMIT, { value_bytes(IMAGE_BYTES_LIMIT) }>;

/// The queues between the tasks.
struct Queues {
    outgoing: Queue<CanFrame, OUTGOING>,
    incoming: Queue<CanFrame, INCOMING>,
    commands: Queue<Command, COMMANDS>,
    records: Queue<TimedRecord, RECORDS>,
    events: Queue<Event, EVENTS>,
    log: Queue<Event, EVENTS>,
}

/// Everything that lives as long as the image but the control half: put it into a static. It is all zeros, so that an
/// image need not keep its content in flash; [`start`] fills it where it is, because the halves are too large for the
/// stack of a small processor.
pub struct Memory {
    queues: Queues,
    shelf: PrimitiveLibrary,
    session: MaybeUninit<ArmSession>,
}

/// The place of the control half. Put it into a static too, in the memory that is never waited for; nobody need clear
/// it.
pub type CorePlace = MaybeUninit<DeviceController>;

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
                log: Queue::new(),
            },
            shelf: PrimitiveLibrary::new(),
            session: MaybeUninit::uninit(),
        }
    }
}

impl Default for Memory {
    fn default() -> Self {
        Self::new()
    }
}

/// Everything an image consists of, for the tasks that own or share it.
pub struct Application<B: Board> {
    /// Shared by slot and session.
    pub core: &'static mut DeviceController,
    /// Shared by slot, receiver and transmitter.
    pub can: B::Can,
    /// Shared by session and storage.
    pub session: &'static mut ArmSession,
    /// On `SLOT_TIMER`.
    pub slot_task: SlotTask<B, DeviceController>,
    /// On `CAN_RECEIVE`.
    pub receive_task: ReceiveTask,
    /// On `CAN_TRANSMIT`.
    pub transmit_task: TransmitTask,
    /// After every slot.
    pub session_task: SessionTask<B, DeviceController>,
    /// When there is something to tell.
    pub log_task: LogTask,
    /// For [`keep_library`], when nothing else is to be done.
    pub flash: B::Flash,
}

/// Joins the application to the pieces of a board, and starts the timer of the slots: the first comes a slot later at
/// the earliest. `firmware` is the version of the image, for people; `serial` tells this board from others of its kind;
/// `faults` holds what it held before the restart, or anything.
pub fn start<B: Board>(
    firmware: &'static str,
    serial: &'static str,
    parts: Parts<B>,
    memory: &'static mut Memory,
    core: &'static mut CorePlace,
    faults: &'static mut FaultMemory,
) -> Application<B> {
    faults.resume();
    let identity = Identity {
        firmware,
        board: B::NAME,
        serial,
        simulated: B::SIMULATED,
        ticks_per_second: <B::Clock as Clock>::HZ,
        instructions_per_tick: <B::Clock as Clock>::INSTRUCTIONS_PER_TICK,
    };
    let Memory { queues, shelf, session } = memory;
    let Parts { clock, mut slot_timer, can, link, light, flash } = parts;
    let (to_bus, outgoing) = queues.outgoing.split();
    let (incoming, from_bus) = queues.incoming.split();
    let (to_core, commands) = queues.commands.split();
    let (records, from_core) = queues.records.split();
    let (events, news) = queues.events.split();
    let (to_log, to_tell) = queues.log.split();
    let core = in_place::build(core, DeviceController::init());
    let session = in_place::build(session, Session::init(identity, shelf));
    let slot_queues = SlotQueues { from_bus, to_bus, commands, records, events };
    let session_queues =
        SessionQueues { port: link, to_core, from_core, news, to_log: Some(to_log), faults: Some(faults) };
    // When everything is built, which takes a while: the first slot must find its task ready.
    slot_timer.start();
    Application {
        core,
        can,
        session,
        slot_task: SlotTask::new(clock, slot_timer, light, slot_queues, Cost::ControlSlot),
        receive_task: ReceiveTask::new(incoming),
        transmit_task: TransmitTask::new(outgoing),
        session_task: SessionTask::new(clock, session_queues),
        log_task: LogTask::new(to_tell),
        flash,
    }
}
