//! The device's application without a bus: what comes is put in, what it sends is taken out, slot by slot.

use device::{Controller, DeviceController, FaultMemory, Identity, RamStore, STORE_SLOTS, Session, Slot};
use link::image::IMAGE_BYTES_LIMIT;
use puck::CanFrame;
use sim::{TICKS_PER_MICROSECOND, Ticks};

use crate::boxed::boxed;
use crate::simulation::queues::{FIRST_SLOT, LINE_ROOM, Port, Queues, SLOT_TICKS, fault_memory};

/// The application of a device at power-up, and the time of its next slot.
pub(super) struct Engine {
    core: Box<DeviceController>,
    session: Box<Session<RamStore<STORE_SLOTS, IMAGE_BYTES_LIMIT>>>,
    queues: Queues,
    slot: Slot,
    next: Ticks,
    slots: u64,
    faults: Box<FaultMemory>,
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
            instructions_per_tick: 0,
        };
        Self {
            core: boxed(DeviceController::init()),
            session: boxed(Session::init(identity, RamStore::new())),
            queues: Queues::default(),
            slot: Slot::Request,
            next: FIRST_SLOT * SLOT_TICKS,
            slots: 0,
            faults: fault_memory(),
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

    /// The next slot. Returns the frames and the bytes that the device sends; `backlog`: bytes of its own that are
    /// still waiting.
    pub(super) fn run_slot(&mut self, backlog: usize) -> (Vec<CanFrame>, Vec<u8>) {
        let now_us = self.next / TICKS_PER_MICROSECOND;
        self.core.slot(self.slot, now_us, &mut self.queues);
        let frames = std::mem::take(&mut self.queues.transmitted);
        let mut line = Vec::new();
        let room = LINE_ROOM.saturating_sub(backlog);
        let mut port =
            Port { queues: &mut self.queues, core: &mut self.core, line: &mut line, room, faults: &mut self.faults };
        self.session.poll(now_us, &mut port);
        self.slot = self.slot.next();
        self.next += SLOT_TICKS;
        self.slots += 1;
        (frames, line)
    }
}
