//! One controller: its state, and what happens in it as time goes on.

pub(crate) mod wire;

use crate::Nanoseconds;
use crate::errors::{BusError, Errors};
use crate::receive::{self, ReceiveFifo};
use crate::registers::{self, NBTP, RXESC, RXF0C, RXF1C, TXBC, TXESC, WORDS, cccr};
use crate::remark::{Remark, RemarkKind};
use crate::timing::BitTiming;
use crate::transmit::{self, Cancellation, Transmit};
use crate::unit::Unit;
use wire::{Fault, Link};

/// Ticks of the kernel clock until a written INIT can be read back. The manual says "a delay". [M]
const SYNCHRONISATION_TICKS: u64 = 8;
/// Recessive bits after which the bus counts as idle.
pub(crate) const IDLE_BITS: u32 = 11;
/// Idle sequences of bus-off recovery.
pub(crate) const RECOVERY_SEQUENCES: u32 = 129;
/// Dominant bits after which a node sees that the bus is stuck.
const STUCK_BITS: u32 = 6;
/// Further dominant bits that count as one more error each.
const STUCK_STEP_BITS: u32 = 8;

/// CCCR.INIT in the two clock domains.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Init {
    /// As last written.
    pub(crate) written: bool,
    /// As read back, and in effect.
    pub(crate) seen: bool,
    /// When the two will be equal again.
    pub(crate) settles: Option<Nanoseconds>,
}

/// The controller's part in the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Bus {
    /// INIT is set.
    Stopped,
    /// Waits for recessive bits: `left` sequences, the present one ends at `next`; `None` on a dominant bus.
    Joining {
        /// Sequences still missing.
        left: u32,
        /// End of the present one.
        next: Option<Nanoseconds>,
    },
    /// Takes part.
    Active {
        /// From when on.
        since: Nanoseconds,
    },
}

/// One controller.
#[derive(Clone, Debug)]
pub(crate) struct Controller {
    pub(crate) unit: Unit,
    pub(crate) now: Nanoseconds,
    pub(crate) kernel_hz: u32,
    /// Registers without a state of their own, by offset.
    values: [u32; WORDS],
    pub(crate) init: Init,
    pub(crate) cce: bool,
    pub(crate) flags: u32,
    pub(crate) errors: Errors,
    pub(crate) fifos: [ReceiveFifo; 2],
    pub(crate) transmit: Transmit,
    pub(crate) bus: Bus,
    pub(crate) link: Link,
    /// Next step of a stuck bus, and whether this controller was sending when it got stuck.
    pub(crate) stuck: Option<(Nanoseconds, bool)>,
    pub(crate) stuck_steps: u32,
    pub(crate) remarks: Vec<Remark>,
}

impl Controller {
    /// After reset.
    pub(crate) fn new(unit: Unit, policy: Cancellation, kernel_hz: u32, now: Nanoseconds) -> Self {
        Self {
            unit,
            now,
            kernel_hz,
            values: registers::after_reset(),
            init: Init { written: true, seen: true, settles: None },
            cce: false,
            flags: 0,
            errors: Errors::default(),
            fifos: [ReceiveFifo::default(); 2],
            transmit: Transmit::new(policy),
            bus: Bus::Stopped,
            link: Link::default(),
            stuck: None,
            stuck_steps: 0,
            remarks: Vec::new(),
        }
    }

    /// The value of a register without a state of its own.
    pub(crate) fn value(&self, offset: u32) -> u32 {
        self.values.get(offset as usize / 4).copied().unwrap_or(0)
    }

    /// Sets the value of such a register.
    pub(crate) fn set_value(&mut self, offset: u32, value: u32) {
        if let Some(place) = self.values.get_mut(offset as usize / 4) {
            *place = value;
        }
    }

    /// The bit timing; `None` while the kernel clock stands.
    pub(crate) fn timing(&self) -> Option<BitTiming> {
        BitTiming::new(self.value(NBTP), self.kernel_hz)
    }

    /// The first receive FIFO lets nothing go any more.
    pub(crate) fn stick_receive(&mut self) {
        self.fifos[0].get_stuck();
        self.raise(registers::ir::NEW);
    }

    /// A bit of a register falls over.
    pub(crate) fn flip(&mut self, offset: u32, bit: u32) {
        self.set_value(offset, self.value(offset) ^ 1 << (bit & 31));
        self.refresh_wire();
    }

    /// The time `bits` after `from`; `None` while the kernel clock stands.
    pub(crate) fn after(&self, from: Nanoseconds, bits: u32) -> Option<Nanoseconds> {
        Some(from + self.timing()?.bits(bits))
    }

    pub(crate) fn transmit_layout(&self) -> transmit::Layout {
        transmit::Layout::new(self.value(TXBC), self.value(TXESC))
    }

    pub(crate) fn receive_layout(&self, fifo: usize) -> receive::Layout {
        let sizes = self.value(RXESC);
        if fifo == 0 {
            receive::Layout::new(self.value(RXF0C), sizes)
        } else {
            receive::Layout::new(self.value(RXF1C), sizes >> 4)
        }
    }

    /// Notes a remark on a register.
    pub(crate) fn remark(&mut self, kind: RemarkKind, offset: u32, value: u32, text: &'static str) {
        let register = registers::find(offset).map_or("reserved", |register| register.name);
        self.remarks.push(Remark { at: self.now, kind, unit: Some(self.unit), register, offset, value, text });
    }

    /// Notes a remark on a word of the message memory that this controller used.
    pub(crate) fn memory_remark(&mut self, kind: RemarkKind, offset: u32, value: u32, text: &'static str) {
        let unit = Some(self.unit);
        self.remarks.push(Remark { at: self.now, kind, unit, register: "RAM", offset, value, text });
    }

    /// Sets flags of IR.
    pub(crate) fn raise(&mut self, flags: u32) {
        self.flags |= flags;
    }

    /// Changes the transmit buffers and sets the flags that follow.
    pub(crate) fn change_transmit<R>(&mut self, work: impl FnOnce(&mut Transmit, &transmit::Layout) -> R) -> R {
        let before = self.transmit;
        let layout = self.transmit_layout();
        let outcome = work(&mut self.transmit, &layout);
        let (sent, cancelled) = (self.value(registers::TXBTIE), self.value(registers::TXBCIE));
        self.raise(transmit::flags(&before, &self.transmit, sent, cancelled));
        outcome
    }

    /// Sets the kernel clock. What is under way starts again at the new rate.
    pub(crate) fn set_kernel_clock(&mut self, hz: u32) {
        self.kernel_hz = hz;
        if self.init.written != self.init.seen {
            self.init.settles = self.settling_time();
        }
        if let Bus::Joining { left, .. } = self.bus {
            self.join(left);
        }
    }

    /// When a value of INIT written now can be read back; `None` while the kernel clock stands.
    fn settling_time(&self) -> Option<Nanoseconds> {
        let delay = (SYNCHRONISATION_TICKS * 1_000_000_000).checked_div(u64::from(self.kernel_hz))?;
        Some(self.now + delay)
    }

    /// A value of INIT was written.
    pub(crate) fn write_init(&mut self, value: bool) {
        if value == self.init.written {
            return;
        }
        if self.init.settles.is_some() {
            self.remark(
                RemarkKind::Suspicious,
                registers::CCCR,
                u32::from(value) * cccr::INIT,
                "INIT was written again before the value written last could be read back",
            );
        }
        self.init.written = value;
        if !value {
            self.cce = false;
        }
        self.init.settles = self.settling_time();
    }

    /// When something happens here by itself.
    pub(crate) fn next_time(&self) -> Option<Nanoseconds> {
        let joining = if let Bus::Joining { next, .. } = self.bus { next } else { None };
        let stuck = self.stuck.map(|(next, _)| next);
        [self.init.settles, joining, stuck, self.link.attempt_ends()].into_iter().flatten().min()
    }

    /// Everything up to `now` happens, in order.
    pub(crate) fn advance(&mut self, now: Nanoseconds) {
        while let Some(next) = self.next_time().filter(|next| *next <= now) {
            self.now = self.now.max(next);
            if self.init.settles == Some(next) {
                self.settle();
            } else if self.stuck.is_some_and(|(time, _)| time == next) {
                self.stuck_step(next);
            } else if self.link.attempt_ends() == Some(next) {
                self.end_attempt();
            } else {
                self.joining_step(next);
            }
        }
        self.now = self.now.max(now);
    }

    /// INIT has reached the other clock domain.
    fn settle(&mut self) {
        self.init.settles = None;
        self.init.seen = self.init.written;
        if self.init.seen {
            self.stop();
        } else {
            let left = if self.errors.is_bus_off() { RECOVERY_SEQUENCES } else { 1 };
            if self.errors.is_bus_off() {
                self.errors.recovery_begins();
            }
            self.join(left);
        }
    }

    /// All bus activity ends.
    pub(crate) fn stop(&mut self) {
        self.bus = Bus::Stopped;
        self.stuck = None;
        self.link.break_off();
        self.refresh_wire();
    }

    /// Waits for recessive bits from now on.
    pub(crate) fn join(&mut self, left: u32) {
        let is_dominant = self.link.fault == Some(Fault::StuckDominant);
        let next = if is_dominant { None } else { self.after(self.now, IDLE_BITS) };
        self.bus = Bus::Joining { left, next };
    }

    /// Eleven recessive bits have gone by.
    fn joining_step(&mut self, time: Nanoseconds) {
        let Bus::Joining { left, .. } = self.bus else { return };
        if self.errors.is_bus_off() {
            self.errors.recovery_step();
        }
        if left > 1 {
            self.bus = Bus::Joining { left: left - 1, next: self.after(time, IDLE_BITS) };
            return;
        }
        if self.errors.is_bus_off() {
            let flags = self.errors.recovered();
            self.raise(flags);
        }
        self.bus = Bus::Active { since: time };
        self.refresh_wire();
    }

    /// The bus is dominant for ever: from now on the error counters climb.
    pub(crate) fn get_stuck(&mut self, was_sending: bool) {
        self.stuck_steps = 0;
        self.stuck = self.after(self.now, STUCK_BITS).map(|time| (time, was_sending));
    }

    /// The bus has been dominant for another while.
    fn stuck_step(&mut self, time: Nanoseconds) {
        let Some((_, was_sending)) = self.stuck else { return };
        let flags = if self.is_restricted() {
            0
        } else if was_sending {
            self.errors.send_failed(BusError::Bit1)
        } else {
            let step = if self.stuck_steps == 0 { 1 } else { 8 };
            self.errors.receive_failed(BusError::Stuff, step)
        };
        self.stuck_steps += 1;
        self.raise(flags);
        // A receiver's counter ends where it is error passive; the bus is silent for it from there on.
        let goes_on = was_sending || !self.errors.is_passive();
        self.stuck = self.after(time, STUCK_STEP_BITS).filter(|_| goes_on).map(|next| (next, was_sending));
        self.leave_if_bus_off();
    }

    /// Bus-off sets INIT by itself and ends all activity at once. INIT is read later than that and than the flag:
    /// it goes from one clock domain to the other as a written value does; how long that takes nobody says. [M] Tells
    /// whether that happened.
    pub(crate) fn leave_if_bus_off(&mut self) -> bool {
        if !self.errors.is_bus_off() || self.init.written {
            return false;
        }
        let settles = self.settling_time().map(|time| time + self.link.init_lag);
        self.init = Init { written: true, seen: false, settles };
        self.stop();
        true
    }
}
