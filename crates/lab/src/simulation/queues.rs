//! The queues between the control part and the session of the device's application in one thread, and the session's
//! view of the rest.

use std::collections::VecDeque;

use control::{CycleRecord, LoadRefusal};
use device::time::{CYCLE_SLOTS, SLOT_HZ};
use device::{
    CheckedPrimitive, Command, Controller, ControllerIo, DeviceController, Event, FaultMemory, Health, QueueFull,
    SessionPort, StoredWeight, TimedRecord, Timing,
};
use puck::CanFrame;
use sim::Ticks;
use sim::fault::FrameKind;

/// Capacity of the queue of commands, as in the firmware.
const COMMANDS: usize = 8;
/// Records that may wait for the session, as in the firmware.
const RECORDS: usize = 16;
/// Frames that may wait for the bus: 16 in the firmware's queue, 8 in the controller's.
const OUTGOING: usize = 16 + 8;
/// Bytes that may wait for the line before telemetry is left out; the firmware's port has the same capacity.
pub(crate) const LINE_ROOM: usize = 2048;

/// Ticks of one slot of the device.
pub const SLOT_TICKS: Ticks = sim::period_ticks(SLOT_HZ);

/// Ticks of one control cycle.
pub const CYCLE_TICKS: Ticks = CYCLE_SLOTS as Ticks * SLOT_TICKS;

/// The first slot of a device, in slots since its power-up, as on the board (`docs/lockstep.md`).
pub(crate) const FIRST_SLOT: Ticks = 10;

/// The connection of both parts to each other and to the board.
#[derive(Default)]
pub(crate) struct Queues {
    /// Frames from the bus that the core has not taken yet.
    pub(crate) received: VecDeque<CanFrame>,
    /// Frames for the bus.
    pub(crate) transmitted: Vec<CanFrame>,
    /// Frames that the CAN controller does not take now.
    pub(crate) refused: Vec<FrameKind>,
    /// Frames that wait for the bus since earlier slots.
    pub(crate) waiting: usize,
    commands: VecDeque<Command>,
    records: VecDeque<TimedRecord>,
    events: VecDeque<Event>,
}

impl ControllerIo<DeviceController> for Queues {
    fn receive(&mut self) -> Option<CanFrame> {
        self.received.pop_front()
    }

    fn transmit(&mut self, frame: CanFrame) -> bool {
        let has_room = self.waiting + self.transmitted.len() < OUTGOING;
        let is_taken = has_room && !self.refused.iter().any(|kind| kind.fits(&frame));
        self.transmitted.extend(is_taken.then_some(frame));
        is_taken
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

/// A memory that has never held a fault.
pub(crate) fn fault_memory() -> Box<FaultMemory> {
    let mut memory = Box::new(FaultMemory::BLANK);
    memory.resume();
    memory
}

/// The low-priority half's view while it is polled.
pub(crate) struct Port<'a> {
    pub(crate) queues: &'a mut Queues,
    pub(crate) core: &'a mut DeviceController,
    /// Where its bytes go.
    pub(crate) line: &'a mut Vec<u8>,
    /// Bytes the line still takes.
    pub(crate) room: usize,
    /// The last second before a fault.
    pub(crate) faults: &'a mut FaultMemory,
}

impl SessionPort<DeviceController> for Port<'_> {
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

    fn load(&mut self, fit: &CheckedPrimitive<'_>) -> Result<(), LoadRefusal> {
        self.core.load(fit)
    }

    fn weigh(&mut self, weight: &StoredWeight) -> bool {
        self.core.weigh(weight)
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

    fn fault_memory(&mut self) -> Option<&mut FaultMemory> {
        Some(self.faults)
    }
}
