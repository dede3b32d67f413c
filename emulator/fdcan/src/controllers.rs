//! Both controllers and the memory they share: the model's public face.

use crate::Nanoseconds;
use crate::controller::wire::{Fault, Handler, WireEvent};
use crate::controller::{Bus, Controller};
use crate::errors::BusError;
use crate::frame::Frame;
use crate::memory::{Memory, WORDS};
use crate::random::Random;
use crate::remark::{Remark, RemarkKind};
use crate::timing::BitTiming;
use crate::transmit::Cancellation;
use crate::unit::Unit;

/// With the erratum, one read of the message memory in this many is wrong. The errata sheet gives no rate.
const WRONG_READ_IN: u32 = 64;

/// One of a controller's two interrupt lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Line {
    /// `FDCANx_IT0`.
    Zero,
    /// `FDCANx_IT1`.
    One,
}

/// Properties of the chip that is modelled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// Decides the memory's content after power-up and the reads that the erratum spoils.
    pub seed: u64,
    /// Effect of a cancelled place in the transmit FIFO on the get index.
    pub cancellation: Cancellation,
    /// ES0392 2.24.2, revisions Y and W: with both controllers at work, reads of the message memory may be wrong.
    pub erratum: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { seed: 1, cancellation: Cancellation::default(), erratum: false }
    }
}

/// The state of a controller at one glance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status {
    /// Takes part in bus traffic.
    pub on_bus: bool,
    /// Off the bus after too many errors, or still recovering from that.
    pub bus_off: bool,
    /// At least one error counter has reached 128.
    pub error_passive: bool,
    /// Transmit error counter; it keeps its last value in bus-off.
    pub transmit_errors: u16,
    /// Receive error counter; while the controller recovers from bus-off, the recessive sequences seen.
    pub receive_errors: u16,
    /// Bit timing as configured; `None` while the kernel clock stands.
    pub timing: Option<BitTiming>,
}

/// FDCAN1, FDCAN2 and the message memory.
///
/// Every call that takes a time first lets everything happen that is due until then. A time before one already reached
/// counts as the time reached.
#[derive(Clone, Debug)]
pub struct Controllers {
    options: Options,
    random: Random,
    memory: Memory,
    units: [Controller; 2],
    now: Nanoseconds,
    remarks: Vec<Remark>,
}

impl Controllers {
    /// The block after power-up: registers at their reset values, memory random, kernel clock not running.
    #[must_use]
    pub fn new(options: Options) -> Self {
        let mut random = Random::new(options.seed);
        let memory = Memory::new(&mut random);
        let units = Unit::BOTH.map(|unit| Controller::new(unit, options.cancellation, 0, 0));
        Self { options, random, memory, units, now: 0, remarks: Vec::new() }
    }

    /// The reset line of both controllers: registers at their reset values; memory and faults stay as they are.
    pub fn reset(&mut self, now: Nanoseconds) {
        self.advance(now);
        for unit in &mut self.units {
            unit.stop();
            unit.link.forget();
            let mut fresh = Controller::new(unit.unit, self.options.cancellation, unit.kernel_hz, unit.now);
            std::mem::swap(&mut fresh.link, &mut unit.link);
            fresh.remarks.append(&mut unit.remarks);
            *unit = fresh;
        }
    }

    /// Sets the kernel clock, Hz; 0 stops it.
    pub fn set_kernel_clock(&mut self, hz: u32, now: Nanoseconds) {
        self.advance(now);
        for unit in &mut self.units {
            unit.set_kernel_clock(hz);
        }
    }

    /// A program reads the register at a byte offset. PSR and ECR change by being read.
    pub fn read(&mut self, unit: Unit, offset: u32, now: Nanoseconds) -> u32 {
        self.advance(now);
        self.unit(unit).read(offset)
    }

    /// A program writes the register at a byte offset. A write that the silicon ignores leaves a remark.
    pub fn write(&mut self, unit: Unit, offset: u32, value: u32, now: Nanoseconds) {
        self.advance(now);
        self.units[unit as usize].write(offset, value, &self.memory);
    }

    /// Returns the value of a read at the time last reached, without its effects.
    #[must_use]
    pub fn peek(&self, unit: Unit, offset: u32) -> u32 {
        self.units[unit as usize].peek(offset)
    }

    /// A program reads the word of the message memory at a byte offset.
    pub fn read_memory(&mut self, offset: u32, now: Nanoseconds) -> u32 {
        self.advance(now);
        let word = offset / 4;
        if word >= WORDS {
            self.remark(RemarkKind::Suspicious, offset, 0, "a read behind the message memory");
            return 0;
        }
        let right = self.memory.get(word);
        if !self.memory.is_written(word) {
            self.remark(
                RemarkKind::Unwritten,
                offset,
                right,
                "a read of a word that nobody has written since power-up",
            );
        }
        let is_shared = self.units.iter().all(|unit| unit.bus != Bus::Stopped);
        if !(self.options.erratum && is_shared && self.random.below(WRONG_READ_IN) == 0) {
            return right;
        }
        let other = self.memory.get(self.random.below(WORDS));
        let wrong = if other == right { !right } else { other };
        self.remark(RemarkKind::Erratum, offset, wrong, "a read returned a wrong word: both controllers are at work");
        wrong
    }

    /// A program writes the word of the message memory at a byte offset.
    pub fn write_memory(&mut self, offset: u32, value: u32, now: Nanoseconds) {
        self.advance(now);
        for unit in &mut self.units {
            unit.memory_written(offset / 4, value);
        }
        if !self.memory.set(offset / 4, value) {
            self.remark(RemarkKind::Suspicious, offset, value, "a write behind the message memory");
        }
    }

    /// The word of the message memory at a byte offset, untouched by the erratum; 0 behind the end.
    #[must_use]
    pub fn peek_memory(&self, offset: u32) -> u32 {
        self.memory.get(offset / 4)
    }

    /// When something will happen by itself, as far as is known now.
    #[must_use]
    pub fn next_time(&self) -> Option<Nanoseconds> {
        self.units.iter().filter_map(Controller::next_time).min()
    }

    /// Lets everything happen that is due until `now`.
    pub fn advance(&mut self, now: Nanoseconds) {
        self.now = self.now.max(now);
        for unit in &mut self.units {
            unit.advance(self.now);
        }
    }

    /// The level of an interrupt line.
    #[must_use]
    pub fn line(&self, unit: Unit, line: Line) -> bool {
        self.units[unit as usize].line(line as u32)
    }

    /// Takes the remarks made so far, those of the memory first.
    pub fn take_remarks(&mut self) -> Vec<Remark> {
        let mut remarks = std::mem::take(&mut self.remarks);
        for unit in &mut self.units {
            remarks.append(&mut unit.remarks);
        }
        remarks
    }

    /// Takes what the wire of this controller must be told, oldest first.
    pub fn take_wire(&mut self, unit: Unit) -> Vec<WireEvent> {
        std::mem::take(&mut self.unit(unit).link.events)
    }

    /// The wire has begun to send the oldest offered frame. Without this call a cancellation takes the frame back.
    pub fn begun(&mut self, unit: Unit, now: Nanoseconds) {
        self.advance(now);
        self.unit(unit).begun();
    }

    /// Answer to a [`WireEvent::Withdraw`], at once: the oldest frame could not be taken back, it is on the wire.
    ///
    /// The model takes it for begun, as if [`Controllers::begun`] had been called before: a cancellation of it waits
    /// for its end. Once the controller has stopped (INIT, bus-off, reset) the answer changes nothing.
    pub fn still_on_wire(&mut self, unit: Unit, now: Nanoseconds) {
        self.advance(now);
        self.unit(unit).still_on_wire();
    }

    /// The oldest offered frame has been sent and acknowledged.
    pub fn transmitted(&mut self, unit: Unit, now: Nanoseconds) {
        self.advance(now);
        self.unit(unit).transmitted();
    }

    /// The oldest offered frame lost arbitration. The wire keeps it at the head unless a `Withdraw` follows.
    pub fn lost_arbitration(&mut self, unit: Unit, now: Nanoseconds) {
        self.advance(now);
        self.unit(unit).lost_arbitration();
    }

    /// The attempt to send the oldest offered frame failed. The wire keeps it at the head unless a `Withdraw` follows.
    pub fn failed(&mut self, unit: Unit, error: BusError, now: Nanoseconds) {
        self.advance(now);
        self.unit(unit).failed(error);
    }

    /// A frame of somebody else has ended; `now` is its last bit or the end of the interframe space.
    pub fn received(&mut self, unit: Unit, frame: &Frame, now: Nanoseconds) {
        self.advance(now);
        self.units[unit as usize].received(&mut self.memory, frame);
    }

    /// A frame of somebody else was disturbed.
    pub fn receive_failed(&mut self, unit: Unit, error: BusError, now: Nanoseconds) {
        self.advance(now);
        self.unit(unit).receive_failed(error);
    }

    /// Sets or ends a fault of one controller's bus.
    pub fn set_fault(&mut self, unit: Unit, fault: Option<Fault>, now: Nanoseconds) {
        self.advance(now);
        self.unit(unit).set_fault(fault);
    }

    /// The message memory answers one handler of a controller too late, at its next access.
    pub fn starve(&mut self, unit: Unit, handler: Handler, now: Nanoseconds) {
        self.advance(now);
        self.unit(unit).starve(handler);
    }

    /// The first receive FIFO of a controller lets nothing go any more, whatever is acknowledged, until its
    /// configuration is opened.
    pub fn stick_receive(&mut self, unit: Unit, now: Nanoseconds) {
        self.advance(now);
        self.unit(unit).stick_receive();
    }

    /// A bit of a register falls over, whoever may write it: of one that keeps what is written.
    pub fn flip(&mut self, unit: Unit, offset: u32, bit: u32, now: Nanoseconds) {
        self.advance(now);
        self.unit(unit).flip(offset, bit);
    }

    /// A bit of the message memory falls over.
    pub fn flip_memory(&mut self, offset: u32, bit: u32, now: Nanoseconds) {
        self.advance(now);
        self.memory.flip(offset / 4, bit);
    }

    /// From now on, where bus-off sets CCCR.INIT, it can be read so much later than a written one would be.
    pub fn set_init_lag(&mut self, unit: Unit, lag: Nanoseconds) {
        self.unit(unit).link.init_lag = lag;
    }

    /// The state of a controller.
    #[must_use]
    pub fn status(&self, unit: Unit) -> Status {
        let controller = &self.units[unit as usize];
        Status {
            on_bus: matches!(controller.bus, Bus::Active { .. }),
            bus_off: controller.errors.is_bus_off(),
            error_passive: controller.errors.is_passive(),
            transmit_errors: controller.errors.transmit(),
            receive_errors: controller.errors.receive(),
            timing: controller.timing(),
        }
    }

    fn unit(&mut self, unit: Unit) -> &mut Controller {
        &mut self.units[unit as usize]
    }

    /// Notes a remark on the message memory.
    fn remark(&mut self, kind: RemarkKind, offset: u32, value: u32, text: &'static str) {
        self.remarks.push(Remark { at: self.now, kind, unit: None, register: "RAM", offset, value, text });
    }
}
