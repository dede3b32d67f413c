//! A slot begins: one third of a control cycle of the hand.

use device::Slot;
use embedded_hal::digital::{OutputPin, PinState};
use hand::{Command, Core, CoreIo, Event, Record, TimedRecord};
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
    /// Ticks of the slots of this cycle so far.
    spent: u32,
}

/// The world of the core during one slot.
struct SlotIo<'a> {
    ends: &'a mut Ends,
    meters: &'a Meters,
    record: Option<Record>,
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

    fn record(&mut self, record: Record) {
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
        Self { clock, timer, light, ends, slot: Slot::Request, lost_frames: 0, spent: 0 }
    }

    /// Computes one slot. Afterwards the transmitter and the session are due.
    ///
    /// What is measured as the cost of a cycle is that of its three slots together, replies and their decoding included.
    pub fn run(
        &mut self,
        mut core: impl Mutex<T = &'static mut Core>,
        mut can: impl Mutex<T = E::Can>,
        meters: &Meters,
    ) {
        meters.slot(self.timer.acknowledge());
        let begin = self.clock.short_ticks();
        let now = self.clock.now_us();
        let (mut late, mut lost) = (false, false);
        if self.slot == Slot::Slow {
            // The torques of the control slot must have left before another frame is queued behind them.
            let (waiting, overruns) = can.lock(|can| (can.waiting(), can.overruns()));
            late = waiting > 0 || !self.ends.to_bus.is_empty();
            lost = overruns != self.lost_frames;
            self.lost_frames = overruns;
        }
        let slot = self.slot;
        let mut io = SlotIo { ends: &mut self.ends, meters, record: None };
        core.lock(|core| {
            if late {
                core.note_overrun();
            }
            if lost {
                core.note_bus_error();
            }
            core.slot(slot, now, &mut io);
        });
        if let Some(record) = io.record {
            // A light that cannot be switched must not stop the hand.
            let _ = self.light.set_state(PinState::from(record.state.has_torque()));
            // A session that lags 27 ms behind loses telemetry, which its host sees by the cycle numbers.
            let _ = self.ends.records.enqueue(TimedRecord { record, cost_ticks: self.spent });
        }
        self.spent += self.clock.short_ticks().wrapping_sub(begin);
        if slot == Slot::Slow {
            meters.control(core::mem::take(&mut self.spent));
        }
        self.slot = slot.next();
        if self.timer.is_due() {
            core.lock(|core| core.note_overrun());
        }
    }
}
