//! The two CAN controllers on the chip's bus, their message memory, and the wire of the arm's bus.
//!
//! The register model is `fdcan-model`. Here it meets the chip (accesses, clock, interrupt lines, events) and the
//! [`World`]. The serial line's bytes travel in the same conversation, so they pass through here as well.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use fdcan_model::{Controllers, Fault, Frame, Handler, Id, Line, Options, Remark, Status, Unit, WireEvent};
use puck::{CanFrame, CanId};
use rigless::chip::parallel::Peer;
use rigless::device::{Device, DeviceContext, Level, RegisterFile};
use rigless::snapshot::Store;
use rigless::soc::stm32h743::generated::fdcan1::Register;
use rigless::soc::{Layout, Width};
use rigless::time::{EventId, VirtualNanos};
use sim::Ticks;

use crate::host_bus::HostBus;
use crate::serial::SharedLine;
use crate::world::{TICK_NS, World};

/// The world is asked at least this often, ticks: 1 ms.
const HEARTBEAT: Ticks = 25_000;

/// Exchanges with the world at one instant before this is taken for an endless loop.
const MOST_EXCHANGES: u32 = 10_000;

/// Which of the chip's lines the host is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HostLine {
    /// The serial controller.
    Serial,
    /// The second CAN controller.
    Can,
}

/// Controllers, wires and world.
#[derive(Debug)]
pub struct Can {
    controllers: Controllers,
    world: Box<dyn World>,
    serial: SharedLine,
    host: HostLine,
    host_bus: HostBus,
    /// When the world was last asked.
    asked: Ticks,
    /// A frame of the time before a reset or a stop of the controller is still on the wire.
    orphan: bool,
    /// The first frame the chip has sent, ns.
    first_frame: Option<u64>,
    remarks: Vec<Remark>,
    /// Frames offered to the arm's bus, and those whose end it has told.
    frames_offered: u64,
    frames_sent: u64,
    /// The first line of the arm's controller is up for good.
    line_held: bool,
}

/// Where the registers of the controllers begin.
const REGISTERS: [u64; 2] = [0x4000_A000, 0x4000_A400];

/// Offset of SIDFC.
const STANDARD_FILTERS: u32 = 0x84;

/// True if a filter element stores a standard identifier in the first queue.
fn passes(element: u32, id: u16) -> bool {
    let (first, second) = ((element >> 16 & 0x7FF) as u16, (element & 0x7FF) as u16);
    element >> 27 & 7 == 1
        && match element >> 30 {
            0 => (first..=second).contains(&id),
            1 => id == first || id == second,
            2 => id & second == first & second,
            _ => false,
        }
}

/// [`Can`], as its devices and the rest of the board hold it.
#[derive(Clone, Debug)]
pub struct SharedCan(Arc<Mutex<Can>>);

impl SharedCan {
    /// Controllers as after power-up, joined to this world.
    #[must_use]
    pub fn new(options: Options, world: Box<dyn World>, serial: SharedLine, host: HostLine) -> Self {
        let mut controllers = Controllers::new(options);
        if host == HostLine::Serial {
            // Nobody sits on the host's CAN bus.
            controllers.set_fault(Unit::Two, Some(Fault::NoAcknowledge), 0);
        }
        Self(Arc::new(Mutex::new(Can {
            controllers,
            world,
            serial,
            host,
            host_bus: HostBus::default(),
            asked: 0,
            orphan: false,
            first_frame: None,
            remarks: Vec::new(),
            frames_offered: 0,
            frames_sent: 0,
            line_held: false,
        })))
    }

    /// The controllers and their wires.
    pub fn lock(&self) -> MutexGuard<'_, Can> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn ticks(nanoseconds: u64) -> Ticks {
    nanoseconds / TICK_NS
}

impl Can {
    /// True if the other side has ended.
    #[must_use]
    pub fn is_gone(&self) -> bool {
        self.world.is_gone()
    }

    /// When the first frame of the arm's bus was handed to the wire, ns.
    #[must_use]
    pub fn first_frame(&self) -> Option<u64> {
        self.first_frame
    }

    /// Frames the arm's bus has carried for the chip.
    #[must_use]
    pub fn frames_sent(&self) -> u64 {
        self.frames_sent
    }

    /// Frames that were offered to the arm's bus.
    #[must_use]
    pub fn frames_offered(&self) -> u64 {
        self.frames_offered
    }

    /// Where one controller stands.
    #[must_use]
    pub fn status(&self, unit: Unit) -> Status {
        self.controllers.status(unit)
    }

    /// The identifiers of standard frames that the filters of each controller let into its first queue, by the elements
    /// in the message memory (RM0433 56.3.20).
    #[must_use]
    pub fn accepted(&self) -> [Vec<u16>; 2] {
        Unit::BOTH.map(|unit| {
            let place = self.controllers.peek(unit, STANDARD_FILTERS);
            let (first, count) = (place & 0xFFFC, place >> 16 & 0xFF);
            let elements: Vec<u32> = (0..count).map(|index| self.controllers.peek_memory(first + 4 * index)).collect();
            (0..0x800).filter(|id| elements.iter().any(|element| passes(*element, *id))).collect()
        })
    }

    /// Remarks of the controllers since the last call.
    pub fn take_remarks(&mut self) -> Vec<Remark> {
        std::mem::take(&mut self.remarks)
    }

    /// A fault of one bus, or its end.
    pub fn set_fault(&mut self, unit: Unit, fault: Option<Fault>, now: u64) {
        self.controllers.set_fault(unit, fault, now);
        self.settle(now);
    }

    /// The message memory answers one handler of a controller too late, at its next access.
    pub fn starve(&mut self, unit: Unit, handler: Handler, now: u64) {
        self.controllers.starve(unit, handler, now);
        self.settle(now);
    }

    /// The first interrupt line of the arm's controller stays up whatever its flags are, until a reset.
    pub fn hold_line(&mut self) {
        self.line_held = true;
    }

    /// The receive queue of a controller lets nothing go any more.
    pub fn stick_receive(&mut self, unit: Unit, now: u64) {
        self.controllers.stick_receive(unit, now);
        self.settle(now);
    }

    /// A bit of a controller's register or of the message memory falls over. `false`: nothing of them is there.
    pub fn flip(&mut self, address: u32, bit: u32, now: u64) -> bool {
        let address = u64::from(address);
        let memory = MESSAGE_MEMORY..MESSAGE_MEMORY + MESSAGE_MEMORY_BYTES;
        if memory.contains(&address) {
            self.controllers.flip_memory((address - MESSAGE_MEMORY) as u32, bit, now);
        } else if let Some(unit) = Unit::BOTH.into_iter().find(|unit| address & !0xFF == REGISTERS[*unit as usize]) {
            self.controllers.flip(unit, address as u32 & 0xFF, bit, now);
        } else {
            return false;
        }
        self.settle(now);
        true
    }

    /// Where bus-off sets INIT of a controller, it is read so many nanoseconds later.
    pub fn set_init_lag(&mut self, unit: Unit, lag: u64) {
        self.controllers.set_init_lag(unit, lag);
    }

    /// The chip is reset: both controllers are, and what had not begun on the wire never leaves.
    pub fn reset(&mut self, now: u64) {
        self.line_held = false;
        self.controllers.reset(now);
        self.settle(now);
        self.orphan |= self.world.withdraw(ticks(now));
    }

    /// Tells both wires what the controllers offer and take back.
    fn tell_wire(&mut self, now: u64) {
        for _ in 0..MOST_EXCHANGES {
            let arm = self.controllers.take_wire(Unit::One);
            let host = self.controllers.take_wire(Unit::Two);
            if arm.is_empty() && host.is_empty() {
                break;
            }
            for event in arm {
                match event {
                    WireEvent::Offer { frame, .. } => self.offer(now, &frame),
                    WireEvent::Withdraw { .. } => {
                        if self.world.withdraw(ticks(now)) && !self.orphan {
                            self.controllers.still_on_wire(Unit::One, now);
                            // The end of what a stopped controller has left on the wire is not that of its next frame.
                            self.orphan = !self.controllers.status(Unit::One).on_bus;
                        }
                    }
                }
            }
            for event in host {
                self.host_bus.take(now, event);
            }
        }
        self.remarks.extend(self.controllers.take_remarks());
    }

    fn offer(&mut self, now: u64, frame: &Frame) {
        let Id::Standard(id) = frame.id else { return };
        let frame = CanId::new(id).and_then(|id| CanFrame::from_slice(id, frame.payload()));
        if let Some(frame) = frame {
            self.first_frame.get_or_insert(now);
            self.frames_offered += 1;
            self.world.send(ticks(now), frame);
        }
    }

    /// Everything that is due by `now`, on both buses and between the host and the chip.
    fn settle(&mut self, now: u64) {
        self.controllers.advance(now);
        self.tell_wire(now);
        for _ in 0..MOST_EXCHANGES {
            let at = self.world.next().unwrap_or(Ticks::MAX).min(self.asked + HEARTBEAT);
            if at > ticks(now) || self.world.is_gone() {
                break;
            }
            self.ask(at, now);
        }
        self.host_bus.advance(now, &mut self.controllers);
        self.tell_wire(now);
    }

    /// One exchange with the world.
    fn ask(&mut self, at: Ticks, now: u64) {
        self.flush(now);
        let event = self.world.event(at);
        self.asked = self.asked.max(at).max(ticks(now));
        if event.transmitted {
            if self.orphan {
                self.orphan = false;
            } else {
                self.frames_sent += 1;
                self.controllers.transmitted(Unit::One, now);
            }
        }
        if let Some(frame) = event.received {
            self.controllers.received(Unit::One, &Frame::standard(frame.can_id().raw(), frame.payload()), now);
        }
        match self.host {
            HostLine::Serial => self.serial.offer(&event.link),
            HostLine::Can => self.host_bus.offer(now, &event.link),
        }
        self.tell_wire(now);
    }

    /// Hands the host what its line has carried.
    fn flush(&mut self, now: u64) {
        let bytes = match self.host {
            HostLine::Serial => self.serial.take(),
            HostLine::Can => self.host_bus.take_records(),
        };
        if !bytes.is_empty() {
            self.world.link(ticks(now), &bytes);
        }
    }

    /// When [`Can::settle`] must be called next, ns.
    fn next(&self) -> u64 {
        let world = self.world.next().unwrap_or(Ticks::MAX).min(self.asked + HEARTBEAT);
        let model = self.controllers.next_time().unwrap_or(u64::MAX);
        let host = self.host_bus.next_time().unwrap_or(u64::MAX);
        world.saturating_mul(TICK_NS).min(model).min(host)
    }
}

/// One controller's registers on the chip's bus.
#[derive(Debug)]
pub struct Controller {
    can: SharedCan,
    unit: Unit,
    /// The levels last driven.
    lines: [bool; 2],
}

impl Controller {
    /// One of the two.
    #[must_use]
    pub fn new(can: SharedCan, unit: Unit) -> Self {
        Self { can, unit, lines: [false; 2] }
    }

    /// After anything: interrupt lines, and the next time to look.
    fn after(&mut self, context: &mut DeviceContext<'_>) {
        let can = self.can.lock();
        let mut levels = [Line::Zero, Line::One].map(|line| can.controllers.line(self.unit, line));
        levels[0] |= self.unit == Unit::One && can.line_held;
        let next = can.next();
        drop(can);
        for (position, (level, last)) in levels.into_iter().zip(&mut self.lines).enumerate() {
            if level != *last {
                *last = level;
                context.interrupt(position, Level::from(level));
            }
        }
        context.schedule(VirtualNanos(next.max(context.now().0 + 1)));
    }

    /// Begins to look at the time, after power-up and after a reset.
    pub fn begin(&mut self, context: &mut DeviceContext<'_>) {
        self.after(context);
    }
}

impl Device for Controller {
    type Register = Register;

    fn read(
        &mut self,
        register: Register,
        _registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) -> Option<u64> {
        let now = context.now().0;
        let mut can = self.can.lock();
        can.settle(now);
        let value = can.controllers.read(self.unit, register.spec().offset, now);
        can.settle(now);
        drop(can);
        self.after(context);
        Some(value.into())
    }

    fn peek(&self, register: Register, _registers: &RegisterFile, _now: VirtualNanos) -> Option<u64> {
        Some(self.can.lock().controllers.peek(self.unit, register.spec().offset).into())
    }

    fn write(
        &mut self,
        register: Register,
        value: u64,
        _registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        let now = context.now().0;
        let mut can = self.can.lock();
        can.settle(now);
        can.controllers.write(self.unit, register.spec().offset, value as u32, now);
        can.settle(now);
        drop(can);
        self.after(context);
    }

    fn on_event(&mut self, _event: EventId, _registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.can.lock().settle(context.now().0);
        self.after(context);
    }

    fn on_clock(&mut self, hz: u64, _registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        if self.unit == Unit::One {
            self.can.lock().controllers.set_kernel_clock(hz as u32, context.now().0);
        }
        self.after(context);
    }

    fn reset(&mut self) {
        self.lines = [false; 2];
    }

    fn reset_line(&mut self, _registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        if self.unit == Unit::One {
            self.can.lock().reset(context.now().0);
        }
        self.after(context);
    }
}

/// The message memory in its window.
#[derive(Debug)]
pub struct MessageMemory(pub SharedCan);

/// Where the message memory begins.
pub const MESSAGE_MEMORY: u64 = 0x4000_AC00;

/// Its bytes.
pub const MESSAGE_MEMORY_BYTES: u64 = 4 * fdcan_model::MEMORY_WORDS as u64;

impl Store for MessageMemory {}

impl Peer for MessageMemory {
    fn read(&mut self, offset: u64, _width: Width, context: &mut DeviceContext<'_>) -> u64 {
        let now = context.now().0;
        let shift = 8 * (offset & 3);
        u64::from(self.0.lock().controllers.read_memory(offset as u32 & !3, now)) >> shift
    }

    fn write(&mut self, offset: u64, width: Width, value: u64, context: &mut DeviceContext<'_>) {
        let mut can = self.0.lock();
        let (word, shift) = (offset as u32 & !3, 8 * (offset & 3));
        let before = u64::from(can.controllers.peek_memory(word));
        let merged = before & !(width.mask() << shift) | (value & width.mask()) << shift;
        can.controllers.write_memory(word, merged as u32, context.now().0);
    }

    fn peek(&self, offset: u64, _width: Width, _now: VirtualNanos) -> Option<u64> {
        Some(u64::from(self.0.lock().controllers.peek_memory(offset as u32 & !3)) >> (8 * (offset & 3)))
    }
}
