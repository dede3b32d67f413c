//! The engine of `sil:`: core and session called directly, at the same slot times as on a board.
//!
//! Two things differ from a board. Computing takes the same virtual time in every cycle, where the board's differs by
//! some microseconds from cycle to cycle. And the session, whose computing takes none, is polled once a slot instead
//! of whenever the processor is free.

use std::collections::VecDeque;
use std::convert::Infallible;
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, Waker};
use std::time::Duration;

use device::storage::{Library, LibraryAccess, Opening, Scratch, Work, keep, value_bytes};
use device::{Controller, DeviceController, FaultMemory, Identity, Session, Slot, StoreError};
use flash::{FlashChip, FlashPort, VirtualClock};
use link::image::IMAGE_BYTES_LIMIT;
use puck::CanFrame;
use sim::{Plant, TICKS_PER_MICROSECOND, Ticks};

use super::queues::{FIRST_SLOT, LINE_ROOM, Port, Queues, SLOT_TICKS, fault_memory};
use super::{Execute, SimulationError};
use crate::boxed::boxed;

/// Primitives the store holds, twice as many as in the firmware.
const STORE_SLOTS: usize = 8;

/// From the beginning of a slot to its frames in the bus controller: what the image takes under QEMU, in the middle
/// of its range.
const fn computing(slot: Slot) -> Ticks {
    match slot {
        Slot::Control => 200 * TICKS_PER_MICROSECOND,
        Slot::Request | Slot::Slow => 10 * TICKS_PER_MICROSECOND,
    }
}

/// Time from one slot to the next by a clock that is slow by this share.
fn slot_length(slow: f64) -> Ticks {
    if slow == 0.0 { SLOT_TICKS } else { (SLOT_TICKS as f64 * (1.0 + slow)).round() as Ticks }
}

type ArmSession = Session<Library<STORE_SLOTS, IMAGE_BYTES_LIMIT>>;

/// The session, shared with whoever keeps its library on the flash; never by two at a time.
#[derive(Clone)]
struct SharedSession(Arc<Mutex<Box<ArmSession>>>);

impl SharedSession {
    fn lock(&self) -> MutexGuard<'_, Box<ArmSession>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl LibraryAccess for SharedSession {
    fn restore(&mut self, slot: u8, image: &[u8]) {
        self.lock().store_mut().restore(slot, image);
    }

    fn forget(&mut self, slot: u8) {
        self.lock().store_mut().forget(slot);
    }

    fn holds(&mut self, key: u8, bytes: &[u8]) -> bool {
        self.lock().store_mut().holds(key, bytes)
    }

    fn lose(&mut self, slot: u8, head: &[u8]) {
        self.lock().store_mut().lose(slot, head);
    }

    fn open(&mut self, opening: Opening) {
        self.lock().store_mut().open(opening);
    }

    fn fail(&mut self, error: StoreError) {
        self.lock().store_mut().fail(error);
    }

    fn take(&mut self, image: &mut [u8]) -> Option<Work> {
        self.lock().store_mut().take(image)
    }

    fn settle(&mut self, outcome: Result<(), StoreError>) {
        self.lock().store_mut().settle(outcome);
    }
}

/// The task of the lowest priority, with the time in which it lives and the flash it keeps the library on.
struct Keeper {
    task: Pin<Box<dyn Future<Output = Infallible> + Send>>,
    clock: VirtualClock,
    chip: FlashChip,
}

impl Keeper {
    fn new(chip: FlashChip, mut library: SharedSession) -> Self {
        let clock = VirtualClock::default();
        let port = FlashPort::new(chip.clone(), clock.clone());
        let task = Box::pin(async move {
            let mut room = Box::new(Scratch::<IMAGE_BYTES_LIMIT, { value_bytes(IMAGE_BYTES_LIMIT) }>::new());
            keep(port, &mut room, &mut library).await
        });
        Self { task, clock, chip }
    }

    /// Lets it work from `now` to `end`, as often as its flash gets something done.
    fn run(&mut self, now: Ticks, end: Ticks) -> Result<(), SimulationError> {
        let mut context = Context::from_waker(Waker::noop());
        self.clock.set(now);
        loop {
            let Poll::Pending = self.task.as_mut().poll(&mut context);
            match self.clock.take_alarm() {
                Some(alarm) if alarm < end => self.clock.set(alarm),
                _ => break,
            }
        }
        if self.chip.lock().is_powered() { Ok(()) } else { Err(SimulationError::PowerFailed) }
    }
}

/// The application and the time of its next slot.
pub(super) struct InProcess {
    core: Box<DeviceController>,
    session: SharedSession,
    keeper: Keeper,
    queues: Queues,
    slot: Slot,
    next_slot: Ticks,
    /// Time of the next slot on the device's own clock.
    next_slot_told: Ticks,
    /// Frames that are still being computed, with the time at which they leave.
    leaving: VecDeque<(Ticks, CanFrame)>,
    is_bus_off: bool,
    line: Vec<u8>,
    faults: Box<FaultMemory>,
}

impl InProcess {
    /// The device at power-up, with this flash and a clock that has run for `uptime`.
    pub(super) fn new(flash: FlashChip, uptime: Duration) -> Self {
        let identity = Identity {
            firmware: env!("CARGO_PKG_VERSION"),
            board: "in-process",
            serial: "simulated",
            simulated: true,
            ticks_per_second: sim::TICKS_PER_SECOND as u32,
            instructions_per_tick: 0,
        };
        let session = boxed(Session::init(identity, Library::new()));
        let session = SharedSession(Arc::new(Mutex::new(session)));
        Self {
            core: boxed(DeviceController::init()),
            keeper: Keeper::new(flash, session.clone()),
            session,
            queues: Queues::default(),
            slot: Slot::Request,
            next_slot: FIRST_SLOT * SLOT_TICKS,
            next_slot_told: FIRST_SLOT * SLOT_TICKS + sim::ticks(uptime.as_secs_f64()),
            leaving: VecDeque::new(),
            is_bus_off: false,
            line: Vec::new(),
            faults: fault_memory(),
        }
    }

    fn slot(&mut self, plant: &mut Plant) -> Result<(), SimulationError> {
        let now = self.next_slot;
        plant.advance(now);
        let now_us = self.next_slot_told / TICKS_PER_MICROSECOND;
        self.queues.refused = plant.refused();
        self.queues.waiting = plant.waiting() + self.leaving.len();
        if plant.is_bus_off() && !self.is_bus_off {
            self.leaving.clear();
            self.core.note_bus_error(true);
        }
        self.is_bus_off = plant.is_bus_off();
        self.core.slot(self.slot, now_us, &mut self.queues);
        let leave = now + computing(self.slot);
        self.leaving.extend(self.queues.transmitted.drain(..).map(|frame| (leave, frame)));
        let room = LINE_ROOM.saturating_sub(plant.link_backlog());
        let mut port = Port {
            queues: &mut self.queues,
            core: &mut self.core,
            line: &mut self.line,
            room,
            faults: &mut self.faults,
        };
        self.session.lock().poll(now_us, &mut port);
        if !self.line.is_empty() {
            plant.link_from_device(now, &self.line);
            self.line.clear();
        }
        self.slot = self.slot.next();
        self.next_slot += slot_length(plant.clock_error());
        self.next_slot_told += SLOT_TICKS;
        self.keeper.run(now, self.next_slot)
    }
}

impl Execute for InProcess {
    fn advance(&mut self, plant: &mut Plant, limit: Ticks) -> Result<Ticks, SimulationError> {
        let leaving = self.leaving.front().map_or(Ticks::MAX, |(at, _)| *at);
        let horizon = self.next_slot.min(leaving).min(limit);
        match plant.next_event() {
            Some(at) if at < horizon => {
                let event = plant.event(at);
                self.queues.received.extend(event.received);
                if !event.link.is_empty() {
                    self.session.lock().receive(&event.link);
                }
            }
            _ if leaving <= horizon => {
                if let Some((at, frame)) = self.leaving.pop_front() {
                    plant.submit(at, frame);
                }
            }
            _ if self.next_slot <= limit => self.slot(plant)?,
            _ => plant.advance(limit),
        }
        Ok(plant.now())
    }
}
