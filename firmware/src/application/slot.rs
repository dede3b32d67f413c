//! A slot begins: one third of a control cycle.

use control::CycleRecord;
use device::{Command, Core, CoreIo, Event, Slot, TimedRecord};
use embedded_hal::digital::{OutputPin, PinState};
use heapless::spsc::{Consumer, Producer};
use puck::CanFrame;
use rtic_core::Mutex;

use crate::board::{CanStatus, Clock, Edge, SlotTimer};
use crate::meters::Meters;

/// The slot task's ends of the queues.
pub(super) struct Ends {
    pub(super) from_bus: Consumer<'static, CanFrame>,
    pub(super) to_bus: Producer<'static, CanFrame>,
    pub(super) commands: Consumer<'static, Command>,
    pub(super) records: Producer<'static, TimedRecord>,
    pub(super) events: Producer<'static, Event>,
}

/// The task of the highest priority.
pub struct SlotTask<E: Edge> {
    clock: E::Clock,
    timer: E::SlotTimer,
    light: E::StatusLight,
    ends: Ends,
    slot: Slot,
    lost_frames: u32,
    bus_offs: u32,
}

/// The world of the core during one slot.
struct SlotIo<'a> {
    ends: &'a mut Ends,
    meters: &'a Meters,
    /// The record of this slot; its cost is known only when the slot is over.
    record: Option<CycleRecord>,
}

impl CoreIo for SlotIo<'_> {
    fn receive(&mut self) -> Option<CanFrame> {
        self.ends.from_bus.dequeue()
    }

    fn transmit(&mut self, frame: CanFrame) -> bool {
        self.ends.to_bus.enqueue(frame).is_ok()
    }

    fn command(&mut self) -> Option<Command> {
        self.ends.commands.dequeue()
    }

    fn record(&mut self, record: CycleRecord) {
        self.record = Some(record);
    }

    fn event(&mut self, event: Event) {
        if self.ends.events.enqueue(event).is_err() {
            self.meters.event_dropped();
        }
    }
}

impl<E: Edge> SlotTask<E> {
    pub(super) fn new(clock: E::Clock, timer: E::SlotTimer, light: E::StatusLight, ends: Ends) -> Self {
        Self { clock, timer, light, ends, slot: Slot::Request, lost_frames: 0, bus_offs: 0 }
    }

    /// Computes one slot. Afterwards the transmitter and the session are due.
    pub fn run(
        &mut self,
        mut core: impl Mutex<T = &'static mut Core>,
        mut can: impl Mutex<T = E::Can>,
        meters: &Meters,
    ) {
        meters.slot(self.timer.acknowledge());
        let begin = self.clock.short_ticks();
        let now = self.clock.now_us();
        let (mut late, mut lost, mut off) = (false, false, false);
        if self.slot == Slot::Slow {
            // The torques of the control slot must have left before another frame is queued behind them.
            let (waiting, overruns, offs) = can.lock(|can| (can.waiting(), can.overruns(), can.bus_offs()));
            late = waiting > 0 || !self.ends.to_bus.is_empty();
            (lost, off) = (overruns != self.lost_frames, offs != self.bus_offs);
            (self.lost_frames, self.bus_offs) = (overruns, offs);
        }
        let slot = self.slot;
        let mut io = SlotIo { ends: &mut self.ends, meters, record: None };
        core.lock(|core| {
            if late {
                core.note_overrun();
            }
            if lost || off {
                core.note_bus_error(off);
            }
            core.slot(slot, now, &mut io);
        });
        let record = io.record;
        let cost_ticks = self.clock.short_ticks().wrapping_sub(begin);
        if let Some(record) = record {
            meters.control(cost_ticks);
            // A light that cannot be switched must not stop the arm.
            let _ = self.light.set_state(PinState::from(record.state.has_torque()));
            // A session that lags 50 ms behind loses telemetry, which its host sees by the cycle numbers.
            let _ = self.ends.records.enqueue(TimedRecord { record, cost_ticks });
        }
        self.slot = slot.next();
        if self.timer.is_due() {
            core.lock(|core| core.note_overrun());
        }
    }
}
