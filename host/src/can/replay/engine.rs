//! The device's application without a bus: what comes is put in, what it sends is taken out, slot by slot.

use std::collections::VecDeque;

use control::arm::ArmModel;
use control::{CycleRecord, LoadRefusal, Payload};
use device::{
    Command, Core, CoreIo, Event, Health, Identity, QueueFull, RamStore, STORE_SLOTS, Session, SessionPort, Slot,
    StoredPrimitive, TimedRecord, Timing,
};
use link::image::IMAGE_BYTES_LIMIT;
use puck::CanFrame;
use sim::{SLOT_TICKS, TICKS_PER_MICROSECOND, Ticks};

/// Room of the queue of commands, as in the firmware.
const COMMANDS: usize = 8;
/// Records that may wait for the session, as in the firmware.
const RECORDS: usize = 8;
/// Bytes that may wait for the line, as in the firmware.
const LINE_ROOM: usize = 2048;

/// The first slot of a device, in slots since its power-up (`docs/lockstep.md`).
pub(super) const FIRST_SLOT: Ticks = 10;

/// What both halves of the application see of each other and of the log.
#[derive(Default)]
struct Queues {
    received: VecDeque<CanFrame>,
    transmitted: Vec<CanFrame>,
    commands: VecDeque<Command>,
    records: VecDeque<TimedRecord>,
    events: VecDeque<Event>,
}

impl CoreIo for Queues {
    fn receive(&mut self) -> Option<CanFrame> {
        self.received.pop_front()
    }

    fn transmit(&mut self, frame: CanFrame) -> bool {
        self.transmitted.push(frame);
        true
    }

    fn command(&mut self) -> Option<Command> {
        self.commands.pop_front()
    }

    fn record(&mut self, record: CycleRecord) {
        if self.records.len() == RECORDS {
            self.records.pop_front();
        }
        self.records.push_back(TimedRecord { record, cost_ticks: 0 });
    }

    fn event(&mut self, event: Event) {
        self.events.push_back(event);
    }
}

/// The session's view while it is polled.
struct Port<'a> {
    queues: &'a mut Queues,
    core: &'a mut Core,
    line: &'a mut Vec<u8>,
    room: usize,
}

impl SessionPort for Port<'_> {
    fn send(&mut self, bytes: &[u8]) {
        self.line.extend_from_slice(bytes);
        self.room = self.room.saturating_sub(bytes.len());
    }

    fn room(&self) -> usize {
        self.room
    }

    fn command(&mut self, command: Command) -> Result<(), QueueFull> {
        if self.queues.commands.len() == COMMANDS {
            return Err(QueueFull);
        }
        self.queues.commands.push_back(command);
        Ok(())
    }

    fn load(&mut self, primitive: &StoredPrimitive) -> Result<(), LoadRefusal> {
        self.core.load(primitive)
    }

    fn record(&mut self) -> Option<TimedRecord> {
        self.queues.records.pop_front()
    }

    fn event(&mut self) -> Option<Event> {
        self.queues.events.pop_front()
    }

    fn health(&mut self) -> Health {
        self.core.health()
    }

    fn timing(&mut self) -> Timing {
        Timing::default()
    }
}

/// The application of a device at power-up, and the time of its next slot.
pub(super) struct Engine {
    core: Core,
    session: Session<RamStore<STORE_SLOTS, IMAGE_BYTES_LIMIT>>,
    queues: Queues,
    slot: Slot,
    next: Ticks,
    slots: u64,
}

impl Engine {
    /// A device that has just got power.
    pub(super) fn new() -> Self {
        let identity = Identity {
            firmware: env!("CARGO_PKG_VERSION"),
            board: "replay",
            serial: "replay",
            simulated: true,
            ticks_per_second: sim::TICKS_PER_SECOND as u32,
        };
        Self {
            core: Core::new(),
            session: Session::new(identity, ArmModel::new(Payload::SensorAndHand), RamStore::new()),
            queues: Queues::default(),
            slot: Slot::Request,
            next: FIRST_SLOT * SLOT_TICKS,
            slots: 0,
        }
    }

    /// A frame of the arm's bus has come in.
    pub(super) fn receive(&mut self, frame: CanFrame) {
        self.queues.received.push_back(frame);
    }

    /// Bytes of the host have come in.
    pub(super) fn hear(&mut self, bytes: &[u8]) {
        self.session.receive(bytes);
    }

    /// Device time of the next slot.
    pub(super) fn next_slot(&self) -> Ticks {
        self.next
    }

    /// Slots so far.
    pub(super) fn slots(&self) -> u64 {
        self.slots
    }

    /// Control cycles so far.
    pub(super) fn cycles(&self) -> u64 {
        self.core.health().cycle
    }

    /// The next slot. Returns the frames and the bytes that the device sends; `backlog`: bytes of its own that are still waiting.
    pub(super) fn run_slot(&mut self, backlog: usize) -> (Vec<CanFrame>, Vec<u8>) {
        let now_us = self.next / TICKS_PER_MICROSECOND;
        self.core.slot(self.slot, now_us, &mut self.queues);
        let frames = std::mem::take(&mut self.queues.transmitted);
        let mut line = Vec::new();
        let room = LINE_ROOM.saturating_sub(backlog);
        let mut port = Port { queues: &mut self.queues, core: &mut self.core, line: &mut line, room };
        self.session.poll(now_us, &mut port);
        self.slot = self.slot.next();
        self.next += SLOT_TICKS;
        self.slots += 1;
        (frames, line)
    }
}
