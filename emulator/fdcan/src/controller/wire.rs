//! A controller and its wire: what is offered, what came of it, and faults.
//!
//! The wire keeps a queue for each controller. [`WireEvent::Offer`] appends to it; [`WireEvent::Withdraw`] empties it
//! but for a frame that has begun. Frames leave in the order in which they were offered.

use super::{Bus, Controller, IDLE_BITS, RECOVERY_SEQUENCES};
use crate::Nanoseconds;
use crate::errors::BusError;
use crate::filter::{Verdict, verdict};
use crate::frame::{Frame, INTERMISSION_BITS, Id};
use crate::memory::Memory;
use crate::registers::{self, HPMS, SIDFC, TXBCR, XIDFC, cccr, ir};
use crate::remark::RemarkKind;
use crate::transmit::Transmit;

/// Error flag 6 and error delimiter 8.
const ERROR_FRAME_BITS: u32 = 14;
/// An error-passive transmitter waits this much longer before it tries again.
const SUSPENSION_BITS: u32 = 8;
/// Delimiter of the checksum and acknowledge slot: after these a missing acknowledge is known.
const TO_ACKNOWLEDGE_BITS: u32 = 2;
/// A burst of disturbance hits the first dominant bit behind the identifier: start of frame 1, identifier 11, that bit.
const TO_DISTURBED_BIT: u32 = 13;

/// Rate of the bus, bits a second, and how far a controller may be off it: nobody understands one that is further off.
const BUS_HZ: u32 = 1_000_000;
const OFF_HZ: u32 = BUS_HZ / 100;

/// Event that the wire must be told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WireEvent {
    /// A frame waits to be sent, behind those offered before.
    Offer {
        /// When.
        at: Nanoseconds,
        /// Number of its transmit buffer.
        buffer: u8,
        /// The frame.
        frame: Frame,
    },
    /// Every offered frame that has not begun on the wire is taken back.
    Withdraw {
        /// When.
        at: Nanoseconds,
    },
}

/// A fault of the bus as one controller meets it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Nobody acknowledges.
    NoAcknowledge,
    /// The next `attempts` attempts to send are disturbed.
    BitErrors {
        /// Attempts that are left; 32 from a clean state end in bus-off.
        attempts: u32,
    },
    /// The bus is dominant and stays so.
    StuckDominant,
}

/// Who reads and writes the message memory within a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Handler {
    /// Reads the frames to be sent.
    Transmit,
    /// Reads the filters, writes received frames.
    Receive,
}

/// An attempt that will fail.
#[derive(Clone, Copy, Debug)]
struct Attempt {
    buffer: u8,
    error: BusError,
    ends: Nanoseconds,
}

/// The wire's knowledge of this controller.
#[derive(Clone, Debug, Default)]
pub(crate) struct Link {
    /// Buffers offered, oldest first.
    offered: Vec<u8>,
    /// The oldest offered frame is on the wire.
    begun: bool,
    /// The oldest frame that was taken back; the wire may have begun it.
    taken_back: Option<u8>,
    /// The state before a cancellation, if the wire turns out to have begun a frame: buffers, flags, mask.
    undo: Option<(Transmit, u32, u32)>,
    attempt: Option<Attempt>,
    pub(crate) fault: Option<Fault>,
    /// The next access of each handler to the message memory comes too late: transmit, receive.
    pub(crate) starved: [bool; 2],
    /// Time by which INIT can be read later than by synchronisation alone, where bus-off has set it.
    pub(crate) init_lag: Nanoseconds,
    pub(crate) events: Vec<WireEvent>,
}

impl Link {
    /// When the failing attempt ends.
    pub(crate) fn attempt_ends(&self) -> Option<Nanoseconds> {
        self.attempt.map(|attempt| attempt.ends)
    }

    /// Nothing of this controller is on the wire any more.
    pub(crate) fn break_off(&mut self) {
        self.begun = false;
        self.attempt = None;
        self.undo = None;
    }

    /// The requests are gone: whatever the wire still tells of them means nothing.
    pub(crate) fn forget(&mut self) {
        self.break_off();
        self.taken_back = None;
    }

    /// Buffers whose frame is on the wire, as bits.
    fn on_wire(&self) -> u32 {
        let begun = self.offered.first().filter(|_| self.begun).copied();
        let attempted = self.attempt.map(|attempt| attempt.buffer);
        begun.into_iter().chain(attempted).fold(0, |bits, buffer| bits | 1 << buffer)
    }
}

impl Controller {
    /// Makes the wire's queue agree with the requests. Tells whether anything was taken back.
    pub(crate) fn refresh_wire(&mut self) -> bool {
        let is_active = matches!(self.bus, Bus::Active { .. });
        let mut plan = if is_active { self.transmit.plan(&self.transmit_layout()) } else { Vec::new() };
        if !plan.is_empty() && !self.link.begun && std::mem::take(&mut self.link.starved[Handler::Transmit as usize]) {
            self.raise(ir::MRAF);
            self.set_value(registers::CCCR, self.value(registers::CCCR) | cccr::ASM);
        }
        if self.is_restricted() {
            // What waits still waits: the manual says that sending is aborted, not that the request is gone. [M]
            plan.clear();
        }
        if self.link.fault.is_some() || self.is_off_rate() {
            self.begin_attempt(plan.first().copied());
            plan.clear();
        }
        if self.link.attempt.is_some() {
            // The fault is over, but not the attempt that it spoils.
            plan.clear();
        }
        if let Some(head) = self.link.offered.first().copied().filter(|_| self.link.begun) {
            plan.retain(|buffer| *buffer != head);
            plan.insert(0, head);
        }
        let takes_back = !plan.starts_with(&self.link.offered);
        if takes_back {
            let kept = usize::from(self.link.begun);
            self.link.taken_back = self.link.offered.get(kept).copied().filter(|_| kept == 0);
            self.link.undo = None;
            self.link.offered.truncate(kept);
            self.link.events.push(WireEvent::Withdraw { at: self.now });
        }
        for buffer in plan.into_iter().skip(self.link.offered.len()) {
            self.link.offered.push(buffer);
            let frame = self.transmit.frame(buffer);
            self.link.events.push(WireEvent::Offer { at: self.now, buffer, frame });
        }
        takes_back
    }

    /// The bits of this controller are not those of the bus.
    fn is_off_rate(&self) -> bool {
        self.timing().is_some_and(|timing| timing.bits_per_second().abs_diff(BUS_HZ) > OFF_HZ)
    }

    /// Restricted operation: receives and acknowledges, sends nothing, counts no errors.
    pub(crate) fn is_restricted(&self) -> bool {
        self.value(registers::CCCR) & cccr::ASM != 0
    }

    /// The next access of this handler to the message memory comes too late.
    pub(crate) fn starve(&mut self, handler: Handler) {
        self.link.starved[handler as usize] = true;
        self.refresh_wire();
    }

    /// The oldest offered frame is on the wire.
    pub(crate) fn begun(&mut self) {
        self.link.begun = !self.link.offered.is_empty();
    }

    /// The wire could not take the oldest frame back: it had begun. What asked for it back waits for its end.
    pub(crate) fn still_on_wire(&mut self) {
        let Some(buffer) = self.link.taken_back.take() else { return };
        if !matches!(self.bus, Bus::Active { .. }) || self.link.fault == Some(Fault::StuckDominant) {
            self.link.taken_back = Some(buffer);
            return;
        }
        let undo = self.link.undo.take();
        if let Some((before, flags, _)) = undo {
            (self.transmit, self.flags) = (before, flags);
        }
        if !self.link.offered.is_empty() {
            self.link.events.push(WireEvent::Withdraw { at: self.now });
        }
        self.link.attempt = None;
        self.link.offered = vec![buffer];
        self.link.begun = true;
        match undo {
            Some((_, _, mask)) => self.cancel(mask),
            None => {
                self.refresh_wire();
            }
        }
    }

    /// TXBAR has changed the requests: what was cancelled before stays cancelled.
    pub(crate) fn requested(&mut self) {
        self.link.undo = None;
        self.refresh_wire();
    }

    /// TXBCR.
    pub(crate) fn cancel(&mut self, mask: u32) {
        let before = (self.transmit, self.flags, mask);
        let on_wire = self.link.on_wire();
        self.change_transmit(|transmit, layout| transmit.cancel(layout, mask, on_wire));
        self.link.undo = self.refresh_wire().then_some(before);
    }

    /// The oldest offered frame has been sent and acknowledged.
    pub(crate) fn transmitted(&mut self) {
        let late = self.link.taken_back.take();
        let Some(buffer) = self.link.offered.first().copied().or(late) else { return };
        if !self.link.offered.is_empty() {
            self.link.offered.remove(0);
        } else if self.link.attempt.is_some_and(|attempt| attempt.buffer == buffer) {
            self.link.attempt = None;
        }
        self.link.break_off_head();
        self.change_transmit(|transmit, layout| transmit.end(layout, buffer, true));
        let flags = self.errors.sent();
        self.raise(flags);
        self.refresh_wire();
    }

    /// The oldest offered frame lost against another one.
    pub(crate) fn lost_arbitration(&mut self) {
        let Some(buffer) = self.link.offered.first().copied() else { return };
        self.link.break_off_head();
        self.give_up_if_single(buffer);
        self.refresh_wire();
    }

    /// The attempt of the oldest offered frame failed.
    pub(crate) fn failed(&mut self, error: BusError) {
        let Some(buffer) = self.link.offered.first().copied() else { return };
        self.link.break_off_head();
        self.attempt_failed(buffer, error);
    }

    /// Counts a failed attempt.
    fn attempt_failed(&mut self, buffer: u8, error: BusError) {
        let flags = self.errors.send_failed(error);
        self.raise(flags);
        if !self.leave_if_bus_off() {
            self.give_up_if_single(buffer);
            self.refresh_wire();
        }
    }

    /// An attempt that is not to be repeated ends the request: no automatic retransmission, or cancelled meanwhile.
    fn give_up_if_single(&mut self, buffer: u8) {
        let is_single = self.value(registers::CCCR) & cccr::DAR != 0;
        if is_single || self.transmit.cancelling >> buffer & 1 == 1 {
            self.change_transmit(|transmit, layout| transmit.end(layout, buffer, false));
        }
    }

    /// With a fault set: starts an attempt that will fail, if there is something to send and none is under way.
    fn begin_attempt(&mut self, buffer: Option<u8>) {
        let (Some(buffer), None, false) = (buffer, self.link.attempt, self.link.begun) else { return };
        let frame = self.transmit.frame(buffer);
        let (error, bits) = match self.link.fault {
            Some(Fault::NoAcknowledge) => (BusError::Acknowledge, frame.stuffed_bits() + TO_ACKNOWLEDGE_BITS),
            Some(Fault::BitErrors { .. }) => (BusError::Bit0, TO_DISTURBED_BIT),
            None if self.is_off_rate() => (BusError::Bit0, TO_DISTURBED_BIT),
            Some(Fault::StuckDominant) | None => return,
        };
        let passive = if self.errors.is_passive() { SUSPENSION_BITS } else { 0 };
        let ends = self.after(self.now, bits + ERROR_FRAME_BITS + INTERMISSION_BITS + passive);
        self.link.attempt = ends.map(|ends| Attempt { buffer, error, ends });
    }

    /// The failing attempt is over.
    pub(crate) fn end_attempt(&mut self) {
        let Some(Attempt { buffer, error, .. }) = self.link.attempt.take() else { return };
        if let Some(Fault::BitErrors { attempts }) = &mut self.link.fault {
            *attempts -= 1;
            if *attempts == 0 {
                self.link.fault = None;
            }
        }
        self.attempt_failed(buffer, error);
    }

    /// Sets or ends a fault.
    pub(crate) fn set_fault(&mut self, fault: Option<Fault>) {
        let was_stuck = self.link.fault == Some(Fault::StuckDominant);
        self.link.fault = fault.filter(|fault| *fault != Fault::BitErrors { attempts: 0 });
        let is_stuck = self.link.fault == Some(Fault::StuckDominant);
        if is_stuck && !was_stuck {
            let was_sending = self.transmit.pending != 0;
            self.link.break_off();
            match &mut self.bus {
                Bus::Active { .. } => self.get_stuck(was_sending),
                Bus::Joining { next, .. } => *next = None,
                Bus::Stopped => {}
            }
        } else if was_stuck && !is_stuck {
            self.stuck = None;
            match self.bus {
                Bus::Active { .. } => self.join(1),
                Bus::Joining { left, .. } => self.join(left),
                Bus::Stopped => {}
            }
        }
        self.refresh_wire();
    }

    /// A frame of somebody else has ended.
    pub(crate) fn received(&mut self, memory: &mut Memory, frame: &Frame) {
        // Interframe space not counted: callers that report the frame at its very end are right as well.
        let start =
            self.timing().map_or(0, |timing| self.now.saturating_sub(timing.bits(frame.bits() - INTERMISSION_BITS)));
        let is_stuck = self.link.fault == Some(Fault::StuckDominant);
        if self.is_off_rate() {
            return self.receive_failed(BusError::Form);
        }
        match self.bus {
            Bus::Active { since } if since <= start && !is_stuck => self.store(memory, frame),
            Bus::Stopped => {}
            _ => self.miss(frame),
        }
    }

    /// A frame goes by that the controller cannot receive: its bits were no silence.
    fn miss(&mut self, frame: &Frame) {
        let id = match frame.id {
            Id::Standard(id) => u32::from(id),
            Id::Extended(id) => id,
        };
        self.remark(RemarkKind::Lost, registers::PSR, id, "a frame went by that the controller could not receive");
        if let Bus::Joining { left, next: Some(_) } = self.bus {
            // The frame's own end is eleven recessive bits; what was counted within the frame is taken back.
            let counted = frame.bits() / IDLE_BITS - 1;
            let most = if self.errors.is_bus_off() { RECOVERY_SEQUENCES } else { 1 };
            self.errors.recovery_back(counted);
            self.bus = Bus::Joining { left: (left + counted).min(most), next: self.after(self.now, IDLE_BITS) };
        }
    }

    /// Filters and stores a frame.
    fn store(&mut self, memory: &mut Memory, frame: &Frame) {
        if !self.is_restricted() {
            let flags = self.errors.received();
            self.raise(flags);
        }
        let verdict = verdict(|offset| self.value(offset), memory, frame);
        if let Some(offset) = verdict.unwritten {
            self.memory_remark(RemarkKind::Unwritten, offset, memory.get(offset / 4), "filter element never written");
        }
        if verdict.unmodelled {
            let list = if matches!(frame.id, Id::Standard(_)) { SIDFC } else { XIDFC };
            self.remark(RemarkKind::Unmodelled, list, 0, "a filter stores into a dedicated receive buffer");
        }
        let mut index = None;
        if let Some(fifo) = verdict.fifo {
            if std::mem::take(&mut self.link.starved[Handler::Receive as usize]) {
                // The put index stays: the next frame is written over what was written of this one.
                self.raise(ir::MRAF);
                return;
            }
            let layout = self.receive_layout(fifo);
            let stored = self.fifos[fifo].store(&layout, memory, frame, &verdict);
            self.raise(stored.flags << (4 * fifo));
            index = stored.index;
            if stored.outside {
                self.memory_remark(RemarkKind::Suspicious, 0, 0, "a receive element lies behind the message memory");
            }
        }
        if verdict.priority {
            self.tell_priority(&verdict, index, matches!(frame.id, Id::Extended(_)));
        }
    }

    /// HPMS: list, element, where the frame went, index there.
    fn tell_priority(&mut self, verdict: &Verdict, index: Option<u32>, is_extended: bool) {
        let place = match (verdict.fifo, index) {
            (None, _) => 0,
            (Some(_), None) => 1,
            (Some(fifo), Some(_)) => 2 + fifo as u32,
        };
        let element = verdict.element.unwrap_or(0);
        self.set_value(HPMS, u32::from(is_extended) << 15 | element << 8 | place << 6 | index.unwrap_or(0));
        self.raise(ir::HPM);
    }

    /// A frame of somebody else could not be received.
    pub(crate) fn receive_failed(&mut self, error: BusError) {
        if matches!(self.bus, Bus::Active { .. }) && !self.is_restricted() {
            let flags = self.errors.receive_failed(error, 1);
            self.raise(flags);
        }
    }

    /// A program changes a word of the message memory.
    pub(crate) fn memory_written(&mut self, word: u32, value: u32) {
        let buffer = self.transmit_layout().buffer_of(word);
        if buffer.is_some_and(|buffer| self.transmit.pending >> buffer & 1 == 1) {
            let text = "a transmit element is written while its request is pending";
            self.memory_remark(RemarkKind::Suspicious, word * 4, value, text);
        }
    }

    /// A cancellation in FIFO mode is worth a remark.
    pub(crate) fn remark_on_cancellation(&mut self, value: u32) {
        let text = "transmit cancellation is not intended for a FIFO: the manual does not say all that follows";
        self.remark(RemarkKind::Suspicious, TXBCR, value, text);
    }
}

impl Link {
    /// The oldest frame's attempt is over.
    fn break_off_head(&mut self) {
        self.begun = false;
        self.undo = None;
    }
}
