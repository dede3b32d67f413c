//! The engine of `sil:`: core and session called directly, at the same slot times as on a board.
//!
//! Two things differ from a board. Computing takes no virtual time: torque frames are handed over at the very start of the control
//! slot, about 0.2 ms earlier than under QEMU. And the session is polled once a slot instead of whenever the processor is free.

use std::collections::VecDeque;

use control::arm::ArmModel;
use control::{CycleRecord, LoadRefusal, Payload};
use device::{
    Command, Core, CoreIo, Event, Health, Identity, QueueFull, RamStore, Session, SessionPort, Slot, StoredPrimitive,
    TimedRecord, Timing,
};
use link::image::IMAGE_BYTES_LIMIT;
use puck::CanFrame;
use sim::{Plant, SLOT_TICKS, Ticks};

use super::{Execute, SimulationError};

/// Room of the queues between the halves, as in the firmware.
const COMMANDS: usize = 8;
/// Records that may wait for the session.
const RECORDS: usize = 8;
/// Bytes that may wait for the line before telemetry is left out; the firmware's port has the same room.
const LINE_ROOM: usize = 2048;

/// Primitives the store holds, as in the firmware.
const STORE_SLOTS: usize = 8;

/// Ticks of the simulated clock in one microsecond.
const TICKS_PER_MICROSECOND: u64 = 25;

/// What both halves see of each other and of the board.
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

/// The low-priority half's view while it is polled.
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

/// The application and the time of its next slot.
pub(super) struct InProcess {
    core: Core,
    session: Session<RamStore<STORE_SLOTS, IMAGE_BYTES_LIMIT>>,
    queues: Queues,
    slot: Slot,
    next_slot: Ticks,
    line: Vec<u8>,
}

impl InProcess {
    /// The device at power-up.
    pub(super) fn new() -> Self {
        let identity = Identity {
            firmware: env!("CARGO_PKG_VERSION"),
            board: "in-process",
            serial: "simulated",
            simulated: true,
            ticks_per_second: sim::TICKS_PER_SECOND as u32,
        };
        Self {
            core: Core::new(),
            session: Session::new(identity, ArmModel::new(Payload::SensorAndHand), RamStore::new()),
            queues: Queues::default(),
            slot: Slot::Request,
            next_slot: SLOT_TICKS,
            line: Vec::new(),
        }
    }

    fn slot(&mut self, plant: &mut Plant) {
        let now = self.next_slot;
        plant.advance(now);
        let now_us = now / TICKS_PER_MICROSECOND;
        self.core.slot(self.slot, now_us, &mut self.queues);
        for frame in self.queues.transmitted.drain(..) {
            plant.submit(now, frame);
        }
        let room = LINE_ROOM.saturating_sub(plant.link_backlog());
        let mut port = Port { queues: &mut self.queues, core: &mut self.core, line: &mut self.line, room };
        self.session.poll(now_us, &mut port);
        if !self.line.is_empty() {
            plant.link_from_device(now, &self.line);
            self.line.clear();
        }
        self.slot = self.slot.next();
        self.next_slot += SLOT_TICKS;
    }
}

impl Execute for InProcess {
    fn advance(&mut self, plant: &mut Plant, limit: Ticks) -> Result<Ticks, SimulationError> {
        let horizon = self.next_slot.min(limit);
        match plant.next_event() {
            Some(at) if at < horizon => {
                let event = plant.event(at);
                self.queues.received.extend(event.received);
                if !event.link.is_empty() {
                    self.session.receive(&event.link);
                }
            }
            _ if self.next_slot <= limit => self.slot(plant),
            _ => plant.advance(limit),
        }
        Ok(plant.now())
    }
}
