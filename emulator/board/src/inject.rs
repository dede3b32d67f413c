//! Puts faults in from outside while a run goes on.

use fdcan_model::{Fault as WireFault, Handler, Unit};
use rigless::emulator::{Host, Stop};
use rigless::session::Session;
use rigless::soc::Width;
use rigless::time::VirtualNanos;

use crate::board::Board;
use crate::core::{Flush, Order};
use crate::fault::{Kind, ResetKind};
use crate::watcher::Watcher;

/// AIRCR and what a debugger writes there to reset the chip.
const RESET_CONTROL: u32 = 0xE000_ED0C;
const SYSTEM_RESET: u32 = 0x05FA_0004;

/// RCC.RSR after power came: CPU, D1, D2, brown-out, pin, power. After a brown-out: the same without power.
const POWER_FLAGS: u64 = 0x00FE_0000;
const BROWN_OUT_FLAGS: u64 = 0x007E_0000;

/// Where injected instructions and the place of an injected panic lie: the end of the part of the AXI memory that holds
/// data, which no image fills. Behind it lies the memory that is kept over a restart, where nothing may be executed.
const SCRATCH: u32 = 0x2405_FFC0;

/// Two instructions each: branch to itself, undefined as compilers write it.
const LOOP: u32 = 0xE7FE_E7FE;
const UNDEFINED: u32 = 0xDEFE_DEFE;
/// PUSH {R0-R7, LR}, and a branch back to it.
const RECURSION: u32 = 0xE7FD_B5FF;

/// ICSR and its bit that makes a non-maskable interrupt pending.
const INTERRUPT_CONTROL: u32 = 0xE000_ED04;
const PEND_NMI: u32 = 1 << 31;

/// RCC.CR: the first loop is locked; the flags of the others stand two higher each.
const LOOP_READY: u32 = 1 << 25;

/// TIM5_CR1.
const TIME_CONTROL: u32 = 0x4000_0C00;

/// An address below the guard of the stack, where nothing is.
const BELOW_MEMORY: u32 = 0x1FFF_F000;

/// Memory after power was away: random, the same for equal times.
fn scramble(host: &mut dyn Host, seed: u64) {
    let mut state = seed | 1;
    for address in (0x2000_0000_u64..0x2002_0000).chain(0x2400_0000..0x2408_0000).step_by(8) {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        // Memory that cannot be written keeps what it has.
        let _ = host.write(address, Width::W64, state);
    }
}

impl Watcher {
    /// Puts in what is due.
    pub(crate) fn put_in(&mut self, session: &mut Session<Board>, stop: Stop, host: &mut dyn Host) {
        let now = stop.at.0;
        if self.release_wire.take_if(|at| *at <= now).is_some() {
            self.can.lock().set_fault(Unit::One, None, now);
        }
        if self.release_core.take_if(|at| *at <= now).is_some() {
            host.hold(false);
        }
        while self.faults.first().is_some_and(|fault| fault.at <= now) {
            let fault = self.faults.remove(0);
            self.inject(fault.kind, session, stop, host);
        }
    }

    fn inject(&mut self, kind: Kind, session: &mut Session<Board>, stop: Stop, host: &mut dyn Host) {
        let now = stop.at.0;
        let mut wire = |fault: WireFault, us: u64| {
            self.can.lock().set_fault(Unit::One, Some(fault), now);
            self.release_wire = (us > 0).then_some(now + us * 1000);
        };
        let jump = |pc: u32, arguments: [u32; 4]| Order::Jump { pc, arguments, masked: false };
        match kind {
            Kind::BusOff(lag) => {
                wire(WireFault::BitErrors { attempts: 32 }, 0);
                self.can.lock().set_init_lag(Unit::One, lag * 1000);
            }
            Kind::TransmitStarved => self.can.lock().starve(Unit::One, Handler::Transmit, now),
            Kind::ReceiveStarved => self.can.lock().starve(Unit::One, Handler::Receive, now),
            Kind::NoAcknowledge(us) => wire(WireFault::NoAcknowledge, us),
            Kind::Dominant(us) => wire(WireFault::StuckDominant, us),
            Kind::PowerCut(operation) => self.cut_at = Some(self.bank_watch.operations + operation + 1),
            Kind::FlashHangs(operation) => self.hang_at = Some(self.bank_watch.operations + operation + 1),
            Kind::HseDead => self.kill_crystal(session, now, host),
            Kind::Nmi => self.core.lock().orders.push(Order::Own(INTERRUPT_CONTROL, PEND_NMI)),
            Kind::Panic => match self.image.function_named("core::option::unwrap_failed") {
                Some(pc) => {
                    // A place in the source, for the function that panics: text, its length, line, column.
                    let text = u32::from_le_bytes(*b"put ");
                    let place = vec![SCRATCH + 16, 8, 1, 1, text, u32::from_le_bytes(*b"in.r")];
                    let orders = &mut self.core.lock().orders;
                    orders.push(Order::Poke(SCRATCH, place));
                    orders.push(jump(pc, [SCRATCH, 0, 0, 0]));
                }
                None => self.cut_short = Some("the image has no function that panics to jump to".into()),
            },
            Kind::HardFault => self.stand_on(UNDEFINED, false),
            Kind::Hang => self.stand_on(LOOP, true),
            Kind::Stall(us) => {
                host.hold(true);
                self.release_core = Some(now + us * 1000);
            }
            Kind::Guard => self.overflow(self.image.stack.start + 16),
            Kind::BelowGuard => self.overflow(BELOW_MEMORY),
            // CEN goes, and nothing else of the register was set.
            Kind::TimeStands => self.core.lock().orders.push(Order::Poke(TIME_CONTROL, vec![0])),
            Kind::Flip(address, bit) => {
                if !self.can.lock().flip(address, u32::from(bit), now) {
                    self.core.lock().orders.push(Order::Flip(address, bit));
                }
            }
            Kind::LoopLost(number) => self.core.lock().loops_lost |= LOOP_READY << (2 * number),
            Kind::ReceiveStuck => self.can.lock().stick_receive(Unit::One, now),
            Kind::CanHeld => self.can.lock().hold_line(),
            Kind::SerialHeld => session.board_mut().mcu.part.hold_serial(stop.at),
            Kind::FlashLocked => self.core.lock().bank_locked = true,
            Kind::FlashDeaf => self.core.lock().bank_deaf = true,
            Kind::UsbFlushHeld => {
                self.core.lock().usb_flush = Flush { holds: true, reset: true, ..Flush::default() };
                session.board_mut().mcu.part.hold_usb(stop.at);
            }
            Kind::WatchdogDeaf => self.watch.deafen(),
            Kind::UsbDead => self.core.lock().usb_dead = true,
            Kind::UsbHeld => session.board_mut().mcu.part.hold_usb(stop.at),
            Kind::Reset(ResetKind::Probe) => {
                self.core.lock().orders.push(Order::Own(RESET_CONTROL, SYSTEM_RESET));
            }
            Kind::Reset(reset) => {
                session.reset_by_pin(stop.at, stop.instruction_count, host);
                let part = &mut session.board_mut().mcu.part;
                match reset {
                    ResetKind::Power => part.set_reset_flags(POWER_FLAGS),
                    ResetKind::BrownOut => part.set_reset_flags(BROWN_OUT_FLAGS),
                    _ => return,
                }
                scramble(host, now);
            }
        }
    }

    /// The core goes on at these instructions.
    fn stand_on(&mut self, instructions: u32, masked: bool) {
        let orders = &mut self.core.lock().orders;
        orders.push(Order::Poke(SCRATCH, vec![instructions]));
        orders.push(Order::Jump { pc: SCRATCH, arguments: [0; 4], masked });
    }

    /// The core goes on in a function that calls itself for ever, with its stack here.
    fn overflow(&mut self, stack: u32) {
        self.stand_on(RECURSION, false);
        self.core.lock().orders.push(Order::Stack(stack));
    }

    /// The oscillator's input loses its clock while the chip runs from it. With the clock security system on, the chip
    /// goes over to its inner oscillator and has a non-maskable interrupt; without, everything but the watchdog stands
    /// still.
    fn kill_crystal(&mut self, session: &mut Session<Board>, now: u64, host: &mut dyn Host) {
        self.hse_dead = true;
        if session.board_mut().mcu.part.fail_crystal(VirtualNanos(now)) {
            self.core.lock().orders.push(Order::Own(INTERRUPT_CONTROL, PEND_NMI));
        } else {
            host.hold(true);
            self.held = true;
        }
    }
}
