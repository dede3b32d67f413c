//! A slot begins: one third of a control cycle.

use control::State;
use device::{Controller, ControllerIo, CycleReport, Slot, TimedRecord};
use embedded_hal::digital::{OutputPin, PinState};
use heapless::spsc::{Consumer, Producer};
use puck::CanFrame;
use rtic_core::Mutex;

use crate::board::{Board, CanStatus, Clock, SlotTimer};
use crate::meters::Meters;

/// The slot task's ends of the queues between the halves.
pub(crate) struct SlotQueues<C: Controller> {
    pub(crate) from_bus: Consumer<'static, CanFrame>,
    pub(crate) to_bus: Producer<'static, CanFrame>,
    pub(crate) commands: Consumer<'static, C::Command>,
    pub(crate) records: Producer<'static, TimedRecord<C::Record>>,
    pub(crate) events: Producer<'static, C::Event>,
}

/// Control cycles whose records nobody has taken, from which on the session does not come back: 0.5 s beyond what the
/// queue holds. Stops of a person and the silence of a host come through it, and the watchdog hears the slots alone.
const UNHEARD: u8 = 150;

/// Parts of a slot that count as the cost of a control cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Cost {
    /// Its control slot alone, which the torques wait for.
    ControlSlot,
    /// Its three slots together, replies and their decoding included: what a small processor has to bear.
    AllSlots,
}

/// The task of the highest priority.
pub struct SlotTask<B: Board, C: Controller> {
    clock: B::Clock,
    timer: B::SlotTimer,
    light: B::StatusLight,
    queues: SlotQueues<C>,
    measured: Cost,
    slot: Slot,
    lost_frames: u32,
    bus_offs: u32,
    /// Control cycles in a row whose records found no room.
    unheard: u8,
    /// Ticks of the slots of this cycle so far.
    spent: u32,
    /// The clock at the begin of the slot before.
    begin: u32,
}

/// The world of the core during one slot.
struct SlotIo<'a, C: Controller> {
    queues: &'a mut SlotQueues<C>,
    meters: &'a Meters,
    /// Place of the record of this slot; its cost is known only when the slot is over.
    record: &'a mut Option<TimedRecord<C::Record>>,
}

impl<C: Controller> ControllerIo<C> for SlotIo<'_, C> {
    fn receive(&mut self) -> Option<CanFrame> {
        self.queues.from_bus.dequeue()
    }

    fn transmit(&mut self, frame: CanFrame) -> bool {
        self.queues.to_bus.enqueue(frame).is_ok()
    }

    fn command(&mut self) -> Option<C::Command> {
        self.queues.commands.dequeue()
    }

    fn record(&mut self, record: C::Record) {
        *self.record = Some(TimedRecord { record, cost_ticks: 0 });
    }

    fn event(&mut self, event: C::Event) {
        if self.queues.events.enqueue(event).is_err() {
            self.meters.event_dropped();
        }
    }
}

impl<B: Board, C: Controller> SlotTask<B, C> {
    pub(crate) fn new(
        clock: B::Clock,
        timer: B::SlotTimer,
        light: B::StatusLight,
        queues: SlotQueues<C>,
        measured: Cost,
    ) -> Self {
        Self {
            clock,
            timer,
            light,
            queues,
            measured,
            slot: Slot::Request,
            lost_frames: 0,
            bus_offs: 0,
            unheard: 0,
            spent: 0,
            // Not the time of the first slot, which may be 0.
            begin: u32::MAX,
        }
    }

    /// Computes one slot. Afterwards the transmitter and the session are due.
    pub fn run(&mut self, mut core: impl Mutex<T = &'static mut C>, mut can: impl Mutex<T = B::Can>, meters: &Meters) {
        meters.slot(self.timer.acknowledge());
        let begin = self.clock.short_ticks();
        // Slots have a timer of their own. By a clock that stands still no host is ever silent.
        if begin == self.begin {
            core.lock(|core| core.note_overrun());
        }
        self.begin = begin;
        let now = self.clock.now_us();
        let (mut late, mut lost, mut off) = (false, false, false);
        if self.slot == Slot::Slow {
            // Torques that wait while nothing is on its way were not sent in time. Those that wait behind others on a
            // full bus are no fault of the board: the replies that stay away tell of that (A11).
            let (waiting, overruns, offs) = can.lock(|can| {
                can.tend();
                (can.waiting(), can.overruns(), can.bus_offs())
            });
            late = waiting == 0 && !self.queues.to_bus.is_empty();
            (lost, off) = (overruns != self.lost_frames, offs != self.bus_offs);
            (self.lost_frames, self.bus_offs) = (overruns, offs);
        }
        let slot = self.slot;
        let mut record = None;
        let mut io = SlotIo { queues: &mut self.queues, meters, record: &mut record };
        core.lock(|core| {
            if late {
                core.note_overrun();
            }
            if lost || off {
                core.note_bus_error(off);
            }
            core.slot(slot, now, &mut io);
        });
        self.spent += self.clock.short_ticks().wrapping_sub(begin);
        let cost_ticks = self.spent;
        let measured = match self.measured {
            Cost::ControlSlot => {
                self.spent = 0;
                record.is_some()
            }
            Cost::AllSlots => {
                let last = slot.next() == Slot::Request;
                self.spent = if last { 0 } else { cost_ticks };
                last
            }
        };
        if measured {
            meters.control(cost_ticks);
        }
        if let Some(timed) = &mut record {
            timed.cost_ticks = cost_ticks;
            // A light that cannot be switched must not stop the arm.
            let _ = self.light.set_state(PinState::from(timed.record.state().has_torque()));
            // A session that lags some 50 ms behind loses telemetry, which its host sees by the cycle numbers.
            let is_heard = self.queues.records.enqueue(*timed).is_ok();
            self.unheard = if is_heard { 0 } else { self.unheard.saturating_add(1) };
            let moves = matches!(timed.record.state(), State::Gravity | State::Approach | State::Run);
            if self.unheard >= UNHEARD && moves {
                core.lock(|core| core.note_overrun());
            }
        }
        self.slot = slot.next();
        if self.timer.is_due() {
            core.lock(|core| core.note_overrun());
        }
    }
}
