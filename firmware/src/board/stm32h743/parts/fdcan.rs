//! The CAN controllers: registers and message memory, without a single wait.
//!
//! [`Controller`] is one of the two; [`ArmBus`] is the first one as the application sees it. Its line 0 is the role
//! `CAN_RECEIVE`: a frame arrived, frames were lost, or the controller left the bus; all three end in
//! [`receive`](embedded_can::nb::Can::receive), which the application then calls. Its line 1, "a frame has left", is
//! answered here and passed on as `CAN_TRANSMIT`, because the application does not touch the controller when it has
//! nothing to send, and the line would never come down.
//!
//! A controller that has left the bus by itself comes back: after bus-off, when it could not read a frame in time and
//! went into restricted operation, in which it sends nothing, and out of any other mode that nobody asked for. What
//! waited to be sent is thrown away first: a torque of the past must not come out later. After bus-off it then waits
//! for 129 times eleven recessive bits (1.4 ms). That motion does not resume is the application's business
//! ([`CanStatus::bus_offs`]).
//!
//! A controller is brought back with all its settings. They are compared with what was written, one word at a time,
//! whenever the processor has nothing else to do ([`Controller::look`]).
//!
//! The two interrupt flags tell it at once. The mode is read once a control cycle as well ([`CanStatus::tend`]): INIT
//! goes from one clock domain to the other and may be read later than the flag of bus-off, and a mode without a flag is
//! seen too.

use core::convert::Infallible;

use cortex_m::peripheral::NVIC;
use embassy_stm32::pac::can::Fdcan;
use embassy_stm32::pac::can::regs::{Cccr, Ir, Txbar};
use embassy_stm32::pac::{FDCAN1, FDCAN2, FDCANRAM, RCC};
use embedded_can::{Frame as _, Id};
use puck::{CanFrame, CanId};

use super::super::constants::can::{ARM, BIT_TIMING, BIT_TIMING_OF_HSI, ELEMENT_WORDS, HOST, MODE_BITS, MessageMemory};
use super::super::constants::can_settings::{ARM_INTERRUPTS, SETTINGS, Setting, settings};
use super::super::constants::filters::{ARM_FILTERS, HOST_FILTERS};
use super::super::constants::timers::{INIT_US, LAST_LEFT_US, LAST_ROOM_US};
use super::SelectedBoard;
use super::clock;
use super::device::{Chip, Interrupt, level};
use crate::board::{CanStatus, panic_stop};

/// Logical priority of the answer to "a frame has left": above every task, it takes a dozen instructions.
const SENT_PRIORITY: u8 = 14;

/// Where the identifier stands in the first word of an element.
const ID_SHIFT: u32 = 18;
/// First word: the identifier has 29 bits.
const EXTENDED: u32 = 1 << 30;
/// First word: a remote frame.
const REMOTE: u32 = 1 << 29;
/// An identifier that no frame of eleven bits has.
const NO_ID: u16 = 0x800;
/// Frames in a row that both queues may bring: twice what the longer one holds.
const MOST_IN_A_ROW: u8 = 128;
/// Most calls for a frame in a control cycle: the shortest frames are 71, and each may come with an interrupt of its
/// own, which asks once in vain. Line 0 stands above the session, and if it stayed up nobody could stop the arm.
const MOST_ANSWERS: u8 = 240;
/// Where the length stands in the second word.
const LENGTH_SHIFT: u32 = 16;

/// One of the two controllers.
pub(super) struct Controller {
    registers: Fdcan,
    memory: MessageMemory,
    set: &'static Set,
}

/// All that a controller is told.
struct Set {
    registers: [Setting; SETTINGS],
    filters: &'static [u32],
}

static ARM_SET: Set = Set { registers: settings(&ARM, &BIT_TIMING, ARM_INTERRUPTS), filters: &ARM_FILTERS };
static OWN_OSCILLATOR_SET: Set = Set { registers: settings(&ARM, &BIT_TIMING_OF_HSI, 0), filters: &ARM_FILTERS };
static HOST_SET: Set = Set { registers: settings(&HOST, &BIT_TIMING, 0), filters: &HOST_FILTERS };

/// The controller of the arm's bus.
pub(super) const ARM_CONTROLLER: Controller = Controller { registers: FDCAN1, memory: ARM, set: &ARM_SET };
/// The controller of the host's bus.
pub(super) const HOST_CONTROLLER: Controller = Controller { registers: FDCAN2, memory: HOST, set: &HOST_SET };

impl Controller {
    /// Everything that is set, with the configuration left open.
    fn start(&self) {
        if !self.stop() {
            panic_stop::stop::<SelectedBoard>(format_args!("a CAN controller does not stop: it has no clock"));
        }
        self.configure();
        // The message memory starts with random content, check bits included.
        for word in self.memory.filters_at..self.memory.end() {
            FDCANRAM.ram(word as usize).write_value(0);
        }
        self.set_up();
        self.registers.ir().write_value(Ir(u32::MAX));
    }

    /// Writes every setting and filter. Only while the configuration is open.
    fn set_up(&self) {
        for setting in &self.set.registers {
            // SAFETY: a register of this controller, see `register`; the value is one that its field allows.
            unsafe { self.register(setting.offset).write_volatile(setting.value) };
        }
        for (filter, word) in self.set.filters.iter().zip(self.memory.filters_at as usize..) {
            FDCANRAM.ram(word).write_value(*filter);
        }
    }

    /// The register at an offset of [`settings`].
    fn register(&self, offset: u32) -> *mut u32 {
        self.registers.as_ptr().cast::<u32>().wrapping_byte_add(offset as usize)
    }

    /// Compares one setting or filter with what was written, the next one at the next `turn`. Where a bit has fallen
    /// over, the controller is taken off the bus: whoever tends it brings it back, and that writes all of them anew.
    pub(super) fn look(&self, turn: usize) {
        let turn = turn.checked_rem(SETTINGS + self.set.filters.len()).unwrap_or(0);
        let filter = turn.saturating_sub(SETTINGS);
        let is_as_written = || match (self.set.registers.get(turn), self.set.filters.get(filter)) {
            // SAFETY: a register of this controller that reading does not change, see `register`.
            (Some(setting), _) => unsafe { self.register(setting.offset).read_volatile() == setting.value },
            (None, Some(value)) => FDCANRAM.ram(self.memory.filters_at as usize + filter).read() == *value,
            (None, None) => true,
        };
        // One that is not there, or away already, is set up when it comes. What is read wrong once is not wrong.
        if !self.takes_part() || is_as_written() || is_as_written() {
            return;
        }
        defmt::error!("a setting of a CAN controller had changed, number {=usize}: all are written again", turn);
        critical_section::with(|_| self.registers.cccr().modify(|w| w.set_init(true)));
    }

    /// Takes the controller off the bus, if it is on it. Tells whether it has stopped: the bit goes through another
    /// clock domain, and without that clock it never does.
    fn stop(&self) -> bool {
        let mode = self.registers.cccr();
        mode.modify(|w| w.set_init(true));
        clock::within(INIT_US, || mode.read().init())
    }

    /// Opens the configuration of a controller that has stopped. It sends and receives classic frames, repeats what
    /// fails, and tests nothing: no other mode stays.
    fn configure(&self) {
        let mut open = Cccr(0);
        open.set_init(true);
        open.set_cce(true);
        // The first makes it possible, the second does it.
        self.registers.cccr().write_value(open);
        self.registers.cccr().write_value(open);
    }

    /// Leaves configuration; the controller joins the bus after eleven recessive bits. Tells whether it is on its way.
    fn join(&self) -> bool {
        let mode = self.registers.cccr();
        let mut closed = Cccr(0);
        closed.set_init(true);
        mode.write_value(closed);
        mode.write_value(Cccr(0));
        clock::within(INIT_US, || !mode.read().init())
    }

    /// True if the controller takes part in the bus as it was told to.
    fn takes_part(&self) -> bool {
        self.registers.cccr().read().0 & MODE_BITS == 0
    }

    /// Puts a frame behind those that wait; `false` if there is no room.
    pub(super) fn send(&self, id: u16, data: &[u8], remote: bool) -> bool {
        let queue = self.registers.txfqs().read();
        if queue.tfqf() {
            return false;
        }
        let place = queue.tfqpi();
        let at = (self.memory.transmit_at + u32::from(place) * ELEMENT_WORDS) as usize;
        let mut bytes = [0; 8];
        for (byte, given) in bytes.iter_mut().zip(data) {
            *byte = *given;
        }
        let [a, b, c, d, e, f, g, h] = bytes;
        let length = data.len().min(8) as u32;
        FDCANRAM.ram(at).write_value(u32::from(id) << ID_SHIFT | if remote { REMOTE } else { 0 });
        FDCANRAM.ram(at + 1).write_value(length << LENGTH_SHIFT);
        FDCANRAM.ram(at + 2).write_value(u32::from_le_bytes([a, b, c, d]));
        FDCANRAM.ram(at + 3).write_value(u32::from_le_bytes([e, f, g, h]));
        // The element must be in the memory before the controller is told to look.
        cortex_m::asm::dsb();
        let mut request = Txbar(0);
        request.set_ar(usize::from(place), true);
        self.registers.txbar().write_value(request);
        true
    }

    /// Takes the oldest received frame: identifier, length, data; none as well if there have been too many in a `row`.
    pub(super) fn fetch(&self, row: &mut Row) -> Option<(u16, usize, [u8; 8])> {
        let queue = self.registers.rxfs(0).read();
        if queue.ffl() == 0 {
            *row = Row::NONE;
            return None;
        }
        if row.is_endless() {
            return None;
        }
        row.0 += 1;
        let place = queue.fgi();
        let at = (self.memory.receive_at + u32::from(place) * ELEMENT_WORDS) as usize;
        let head = FDCANRAM.ram(at).read();
        let length = (FDCANRAM.ram(at + 1).read() >> LENGTH_SHIFT & 0xF) as usize;
        let [a, b, c, d] = FDCANRAM.ram(at + 2).read().to_le_bytes();
        let [e, f, g, h] = FDCANRAM.ram(at + 3).read().to_le_bytes();
        self.registers.rxfa(0).write(|w| w.set_fai(place));
        // The filters let neither through; a controller that does must not confuse the arm.
        let id = if head & (EXTENDED | REMOTE) == 0 { (head >> ID_SHIFT & 0x7FF) as u16 } else { NO_ID };
        Some((id, length.min(8), [a, b, c, d, e, f, g, h]))
    }

    /// Frames that have not been on the wire yet.
    fn waiting(&self) -> usize {
        self.registers.txbrp().read().0.count_ones() as usize
    }

    /// Frames that can be handed over now.
    pub(super) fn room(&self) -> usize {
        usize::from(self.registers.txfqs().read().tffl())
    }

    /// Brings a controller back that does not take part. Tells whether it is on its way; if not, what is handed over
    /// does not leave, and this wants to be called again.
    #[cold]
    #[inline(never)]
    pub(super) fn bring_back(&self) -> bool {
        self.stop() && self.forget_and_join()
    }

    /// The same, if it is necessary, for somebody who comes by often.
    pub(super) fn tend(&self) {
        if !self.takes_part() {
            self.bring_back();
        }
    }

    /// Empties both queues and joins the bus. Only for a controller that has stopped.
    ///
    /// Not by cancelling: that is for dedicated buffers and queues, and the controller's manual does not say that its
    /// FIFO skips a cancelled frame. Opening the configuration (CCE) makes the controller forget what waits and what it
    /// has received (TXBRP, TXFQS, RXF0S). Its settings it would keep; they are written again all the same, because one
    /// in which a bit has fallen over may be what has brought it here.
    fn forget_and_join(&self) -> bool {
        self.configure();
        self.set_up();
        self.join()
    }
}

/// Frames fetched since a queue was last empty.
pub(super) struct Row(u8);

impl Row {
    /// It is empty.
    pub(super) const NONE: Self = Self(0);

    /// True if there were more than a queue holds and a bus brings meanwhile: the controller hands out the same frame
    /// again and again. Whoever fetches would do so for ever, and those below would never have their turn.
    pub(super) fn is_endless(&self) -> bool {
        self.0 >= MOST_IN_A_ROW
    }
}

/// Gives both controllers their clock, and resets them.
fn clock_and_reset() {
    RCC.apb1henr().modify(|w| w.set_fdcanen(true));
    RCC.apb1hrstr().modify(|w| w.set_fdcanrst(true));
    RCC.apb1hrstr().modify(|w| w.set_fdcanrst(false));
}

/// Starts the arm's controller and lets it interrupt, and the host's if the chip bears both.
pub(super) fn start(nvic: &mut NVIC, host: bool) {
    clock_and_reset();
    ARM_CONTROLLER.start();
    ARM_CONTROLLER.join();
    if host {
        HOST_CONTROLLER.start();
        HOST_CONTROLLER.join();
    }
    // SAFETY: the handler below clears one flag and pends one line; it shares nothing with anybody.
    unsafe {
        nvic.set_priority(Chip::FDCAN1_IT1, level(SENT_PRIORITY));
        NVIC::unmask(Chip::FDCAN1_IT1);
    }
}

/// A frame has left: there is room.
#[unsafe(no_mangle)]
extern "C" fn FDCAN1_IT1() {
    let mut sent = Ir(0);
    sent.set_tc(true);
    ARM_CONTROLLER.registers.ir().write_value(sent);
    NVIC::pend(Interrupt::CAN_TRANSMIT);
}

/// The arm's bus as the tasks see it.
pub struct ArmBus {
    overruns: u32,
    bus_offs: u32,
    row: Row,
    /// Calls for a frame since the controller was tended.
    answers: u8,
    /// The controller does not take part, and has not come back yet.
    is_away: bool,
}

impl ArmBus {
    /// The one there is; called once.
    pub(super) const fn take() -> Self {
        Self { overruns: 0, bus_offs: 0, row: Row::NONE, answers: 0, is_away: false }
    }

    /// Answers the flags of line 0.
    fn answer(&mut self) {
        let r = ARM_CONTROLLER.registers;
        let flags = r.ir().read();
        let mut seen = Ir(0);
        seen.set_rfn(0, flags.rfn(0));
        seen.set_rfl(0, flags.rfl(0));
        seen.set_bo(flags.bo());
        seen.set_mraf(flags.mraf());
        // Before the queue is looked at: a frame that comes in between interrupts again.
        r.ir().write_value(seen);
        if flags.rfl(0) {
            self.overruns = self.overruns.wrapping_add(1);
        }
        if flags.bo() || flags.mraf() {
            self.answer_trouble(flags);
        }
    }

    /// Bus-off, whose flag tells its end as well; or a frame that could not be read or stored in time.
    #[cold]
    #[inline(never)]
    fn answer_trouble(&mut self, flags: Ir) {
        let takes_part = ARM_CONTROLLER.takes_part();
        if flags.mraf() && takes_part {
            self.overruns = self.overruns.wrapping_add(1);
        }
        if !takes_part || flags.bo() && ARM_CONTROLLER.registers.psr().read().bo() {
            self.bring_back();
        }
    }

    /// It is counted when the controller is back: what the application sends then is not thrown away.
    #[cold]
    #[inline(never)]
    fn bring_back(&mut self) {
        self.is_away = !ARM_CONTROLLER.bring_back();
        if !self.is_away {
            self.bus_offs = self.bus_offs.wrapping_add(1);
        }
    }
}

impl embedded_can::nb::Can for ArmBus {
    type Frame = CanFrame;
    type Error = Infallible;

    /// Waiting frames are never replaced: order matters more than priority.
    fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, Infallible> {
        let Id::Standard(id) = frame.id() else {
            // `CanFrame` has eleven bits by construction; a frame that cannot exist needs no place.
            return Ok(None);
        };
        if self.is_away {
            // It would be thrown away with what waits.
            return Ok(None);
        }
        if ARM_CONTROLLER.send(id.as_raw(), frame.data(), frame.is_remote_frame()) {
            Ok(None)
        } else {
            Err(nb::Error::WouldBlock)
        }
    }

    fn receive(&mut self) -> nb::Result<CanFrame, Infallible> {
        self.answer();
        self.answers = self.answers.saturating_add(1);
        if self.answers == MOST_ANSWERS {
            NVIC::mask(Chip::FDCAN1_IT0);
        }
        loop {
            let Some((id, length, data)) = ARM_CONTROLLER.fetch(&mut self.row) else {
                if self.row.is_endless() {
                    self.row = Row::NONE;
                    self.bring_back();
                }
                return Err(nb::Error::WouldBlock);
            };
            let frame = CanId::new(id).and_then(|id| CanFrame::from_slice(id, data.get(..length)?));
            if let Some(frame) = frame {
                return Ok(frame);
            }
        }
    }
}

impl CanStatus for ArmBus {
    fn tend(&mut self) {
        let is_held = self.answers >= MOST_ANSWERS;
        self.answers = 0;
        if self.is_away || is_held || !ARM_CONTROLLER.takes_part() {
            self.bring_back();
        }
        // Also where a bit of the interrupt controller has fallen over.
        // SAFETY: the task of this line is the application's, and was let in before the first slot.
        unsafe { NVIC::unmask(Chip::FDCAN1_IT0) };
    }

    fn waiting(&self) -> usize {
        ARM_CONTROLLER.waiting()
    }

    fn overruns(&self) -> u32 {
        self.overruns
    }

    fn bus_offs(&self) -> u32 {
        self.bus_offs
    }
}

/// Sends these frames by the clock that the chip's own oscillator makes, as far as the bus understands them.
pub(super) fn send_by_own_oscillator(frames: &[CanFrame]) {
    clock_and_reset();
    let controller = Controller { registers: FDCAN1, memory: ARM, set: &OWN_OSCILLATOR_SET };
    controller.start();
    controller.join();
    send_last(frames);
    clock::within_early(LAST_LEFT_US, || controller.waiting() == 0);
    controller.stop();
}

/// The end: hands these frames over behind what waits, of which there is less than a millisecond. Only if the queue
/// does not move, or the controller has left the bus, what waits is thrown away.
pub(super) fn hand_over_last(frames: &[CanFrame]) {
    if !is_started() {
        return;
    }
    let controller = &ARM_CONTROLLER;
    // INIT may be read later than bus-off: what is handed over before that is lost when the controller comes back.
    let is_on = controller.takes_part() && !controller.registers.psr().read().bo();
    if !(is_on && clock::within(LAST_ROOM_US, || controller.room() >= frames.len())) {
        // If it does not stop or does not come back there is nothing left to try.
        let _ = controller.bring_back();
    }
    send_last(frames);
}

/// There is room, unless the bus is dead.
fn send_last(frames: &[CanFrame]) {
    for frame in frames {
        if let Id::Standard(id) = frame.id() {
            let _ = ARM_CONTROLLER.send(id.as_raw(), frame.data(), frame.is_remote_frame());
        }
    }
}

/// Waits until the last frames have left, at most a few milliseconds. A controller that stops taking part over them is
/// brought back once and given them again.
pub(super) fn wait_for_last(frames: &[CanFrame]) {
    if !is_started() {
        return;
    }
    let mut may_repeat = true;
    clock::within(LAST_LEFT_US, || {
        if may_repeat && !ARM_CONTROLLER.takes_part() {
            may_repeat = false;
            let _ = ARM_CONTROLLER.bring_back();
            send_last(frames);
        }
        ARM_CONTROLLER.waiting() == 0
    });
}

/// True if the controllers have their clocks: the end may come before the start-up got here, or because the clock
/// failed. The one that bounds the waits is started before them.
fn is_started() -> bool {
    RCC.apb1henr().read().fdcanen() && RCC.cr().read().pllrdy(0)
}
