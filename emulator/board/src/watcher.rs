//! Watches a run from outside the chip: the log, the stack, findings, and the faults that are put in.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use fdcan_model::{Fault as WireFault, Unit};
use rigless::emulator::{Access, AccessKind, Driver, Hit, Host, Settled, Stop, Watch};

use rigless::session::Session;
use rigless::soc::Width;
use rigless::soc::stm32h743::generated::rcc;
use rigless::time::VirtualNanos;

use crate::bank::{BankWatch, Operation, tear};
use crate::board::Board;
use crate::cache::BANK;
use crate::can::SharedCan;
use crate::clocks::{Clocks, loop_flaws};
use crate::core::{Order, SharedCore};
use crate::fault::{Fault, Kind, ResetKind};
use crate::findings::{Finding, Findings, Grade};
use crate::image::Image;
use crate::log::Log;
use crate::report::Measured;
use crate::run::{Outcome, Setup};
use crate::stack::{self, StackUse};
use crate::watchdog::SharedWatch;

/// Nanoseconds between two looks: 1 ms.
pub const LOOK: u64 = 1_000_000;

/// RCC.CR, and its flag of the crystal oscillator.
const CLOCK_CONTROL: u64 = 0x5802_4400;
const HSE_READY: u64 = 1 << 17;

/// AIRCR and what a debugger writes there to reset the chip.
const RESET_CONTROL: u32 = 0xE000_ED0C;
const SYSTEM_RESET: u32 = 0x05FA_0004;

/// RCC.RSR after power came: CPU, D1, D2, brown-out, pin, power. After a brown-out: the same without power.
const POWER_FLAGS: u64 = 0x00FE_0000;
const BROWN_OUT_FLAGS: u64 = 0x007E_0000;

/// Where injected instructions and the place of an injected panic lie: the end of the AXI memory, which no image fills.
const SCRATCH: u32 = 0x2407_FFC0;

/// Two instructions each: branch to itself, undefined as compilers write it.
const LOOP: u32 = 0xE7FE_E7FE;
const UNDEFINED: u32 = 0xDEFE_DEFE;

/// ICSR and its bit that makes a non-maskable interrupt pending.
const INTERRUPT_CONTROL: u32 = 0xE000_ED04;
const PEND_NMI: u32 = 1 << 31;

/// An access this near below the stack is taken for one of the stack's.
const NEAR_STACK: u32 = 128 * 1024;

/// See the module.
pub struct Watcher {
    image: Arc<Image>,
    can: SharedCan,
    core: SharedCore,
    watch: SharedWatch,
    log: Log,
    interrupt: Arc<AtomicBool>,
    until: Option<u64>,
    strict: bool,
    tells: bool,
    /// Faults not yet put in, the earliest first.
    faults: Vec<Fault>,
    hse_dead: bool,
    stopped_by_crystal: bool,
    first_slot: Option<u64>,
    power_cut: Option<String>,
    /// The wire or the core is to be let go at this time.
    release_wire: Option<u64>,
    release_core: Option<u64>,
    cut_at: Option<u64>,
    bank_watch: BankWatch,
    clock_control: u64,
    findings: Findings,
    told: usize,
    stack: StackUse,
    resets_seen: usize,
    frames_at_reset: u64,
    bank2: Vec<u8>,
    over: bool,
    cut_short: Option<String>,
    now: u64,
    instructions: u64,
}

impl Watcher {
    /// Nothing seen yet.
    #[must_use]
    pub fn new(
        image: Arc<Image>,
        setup: &Setup,
        can: SharedCan,
        core: SharedCore,
        watch: SharedWatch,
        log: Log,
        interrupt: Arc<AtomicBool>,
    ) -> Self {
        let mut faults = setup.faults.clone();
        faults.sort_by_key(|fault| fault.at);
        let dead_from_start = |fault: &Fault| fault.kind == Kind::HseDead && fault.at == 0;
        let hse_dead = faults.iter().any(dead_from_start);
        faults.retain(|fault| !dead_from_start(fault));
        Self {
            image,
            can,
            core,
            watch,
            log,
            interrupt,
            until: setup.until,
            strict: setup.strict,
            tells: setup.tells,
            faults,
            hse_dead,
            stopped_by_crystal: false,
            first_slot: None,
            power_cut: None,
            release_wire: None,
            release_core: None,
            cut_at: None,
            bank_watch: BankWatch::default(),
            clock_control: 0,
            findings: Findings::default(),
            told: 0,
            stack: StackUse::default(),
            resets_seen: 0,
            frames_at_reset: 0,
            bank2: Vec::new(),
            over: false,
            cut_short: None,
            now: 0,
            instructions: 0,
        }
    }

    /// The end: what must outlive the run is taken out of it.
    fn finish(&mut self, host: &mut dyn Host) {
        if self.over {
            return;
        }
        self.over = true;
        self.log.drain(host);
        self.measure_stack(host);
        self.bank2 = (u64::from(BANK.start)..u64::from(BANK.end))
            .step_by(8)
            .flat_map(|address| host.read(address, Width::W64).unwrap_or(u64::MAX).to_le_bytes())
            .collect();
        self.interrupt.store(true, Ordering::Relaxed);
    }

    fn measure_stack(&mut self, host: &mut dyn Host) {
        let range = &self.image.stack;
        self.stack.ever = self.stack.ever.max(stack::used_since_start(host, range));
        if self.stack.at_start.is_some() {
            self.stack.in_service = Some(stack::used_in_service(host, range));
        }
    }

    /// Start-up ends with the first frame: from then on the stack is measured anew.
    fn follow_phase(&mut self, session: &Session<Board>, host: &mut dyn Host) {
        let offered = self.can.lock().frames_offered();
        if session.resets().len() != self.resets_seen {
            self.resets_seen = session.resets().len();
            if std::mem::take(&mut self.stopped_by_crystal) {
                host.hold(false);
            }
            self.frames_at_reset = offered;
            self.stack.at_start = None;
            self.stack.in_service = None;
        }
        if self.stack.at_start.is_none() && offered > self.frames_at_reset {
            let used = stack::used_since_start(host, &self.image.stack);
            self.stack.at_start = Some(used);
            let painted = self.image.stack.end - used..self.image.stack.end;
            self.core.lock().orders.push(Order::Paint(painted));
            self.watch.forget();
        }
    }

    /// The core has come to a handler.
    fn hit(&mut self, hit: Hit, session: &mut Session<Board>) {
        if hit.address == u64::from(self.image.slot_handler) {
            self.first_slot.get_or_insert(hit.at.0);
            session.unwatch(Watch::Instruction(hit.address));
        } else {
            self.core.lock().orders.push(Order::Note(hit.at.0));
        }
    }

    /// Accesses to where nothing is.
    fn check_strays(&mut self) {
        for stray in std::mem::take(&mut self.core.lock().strays) {
            let stack = &self.image.stack;
            let below = stack.start.saturating_sub(stray.address);
            let text = if (1..NEAR_STACK).contains(&below) {
                format!("nothing is at this address, {below} bytes below the stack: a bus fault")
            } else {
                "nothing is at this address: a bus fault".into()
            };
            self.findings.add(Finding {
                grade: Grade::Refused,
                register: "memory".into(),
                address: Some(stray.address.into()),
                function: Some(self.image.function_at(stray.program_counter)),
                text,
                at: stray.at,
            });
        }
    }

    fn tell_new(&mut self) {
        if self.tells {
            for finding in self.findings.all().iter().skip(self.told) {
                if finding.grade < Grade::Excused {
                    eprintln!("{}", finding.line());
                }
            }
        }
        self.told = self.findings.all().len();
    }

    /// Rules about the clock tree that the chip's model does not tell.
    fn check_clocks(&mut self, session: &mut Session<Board>, access: &Access) {
        if access.address != CLOCK_CONTROL {
            return;
        }
        let (_, registers) = session.board_mut().mcu.part.chip.clocks();
        if self.hse_dead {
            let control = registers.get(rcc::Register::Cr);
            registers.set(rcc::Register::Cr, control & !HSE_READY);
        }
        if access.kind == AccessKind::Write {
            let flaws = loop_flaws(registers, self.clock_control, access.value);
            self.clock_control = access.value;
            let function = access.program_counter.map(|pc| self.image.function_at(pc as u32));
            for (name, text) in flaws {
                self.findings.add(Finding {
                    grade: Grade::Refused,
                    register: format!("RCC.{name}"),
                    address: Some(access.address),
                    function: function.clone(),
                    text,
                    at: access.virtual_time.0,
                });
            }
        }
    }

    fn check_bank(&mut self, access: &Access, host: &mut dyn Host) {
        let Some(operation) = self.bank_watch.see(access) else { return };
        if let Operation::Erase { address } = operation {
            let sector = address as u32..address as u32 + 0x2_0000;
            self.core.lock().damaged.retain(|word| !sector.contains(word));
        }
        if self.cut_at == Some(self.bank_watch.operations) {
            let damaged = tear(&operation, self.bank_watch.operations, host);
            self.core.lock().damaged.extend(damaged);
            self.power_cut = Some(format!("{operation:?}"));
        }
    }

    /// Puts in what is due.
    fn put_in(&mut self, session: &mut Session<Board>, stop: Stop, host: &mut dyn Host) {
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
            Kind::BusOff => wire(WireFault::BitErrors { attempts: 32 }, 0),
            Kind::NoAcknowledge(us) => wire(WireFault::NoAcknowledge, us),
            Kind::Dominant(us) => wire(WireFault::StuckDominant, us),
            Kind::PowerCut(operation) => self.cut_at = Some(self.bank_watch.operations + operation + 1),
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
            Kind::Guard => self.core.lock().orders.push(Order::Stack(self.image.stack.start)),
            Kind::BelowGuard => self.core.lock().orders.push(Order::Stack(BELOW_MEMORY)),
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

    /// The oscillator's input loses its clock while the chip runs from it. With the clock security system on, the chip goes
    /// over to its inner oscillator and has a non-maskable interrupt; without, everything but the watchdog stands still.
    fn kill_crystal(&mut self, session: &mut Session<Board>, now: u64, host: &mut dyn Host) {
        self.hse_dead = true;
        if session.board_mut().mcu.part.fail_crystal(VirtualNanos(now)) {
            self.core.lock().orders.push(Order::Own(INTERRUPT_CONTROL, PEND_NMI));
        } else {
            host.hold(true);
            self.stopped_by_crystal = true;
        }
    }

    /// What the run has measured.
    #[must_use]
    pub fn into_outcome(self, session: &mut Session<Board>) -> Outcome {
        let resets = session.resets().iter().map(|reset| (reset.at.0, format!("{:?}", reset.cause))).collect();
        let clocks = Clocks::of(&mut session.board_mut().mcu.part);
        let serial_baud = clocks.baud(&session.board().mcu.part);
        let can = self.can.lock();
        let measured = Measured {
            now: self.now,
            instructions: self.instructions,
            resets,
            first_frame: can.first_frame(),
            first_slot: self.first_slot,
            frames_sent: can.frames_sent(),
            clocks,
            timing: can.status(Unit::One).timing,
            stack: self.stack,
            watchdog: self.watch.get(),
            cache: self.core.cache_count(),
            faults: self.core.lock().faults.clone(),
            accepted: can.accepted(),
            serial_baud,
            bank_operations: self.bank_watch.operations,
            findings: self.findings,
        };
        Outcome {
            measured,
            log: self.log.bytes,
            bank2: self.bank2,
            cut_short: self.cut_short,
            power_cut: self.power_cut,
        }
    }
}

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

impl Driver<Board> for Watcher {
    fn on_settled(&mut self, session: &mut Session<Board>, host: &mut dyn Host, settled: Settled) {
        let (remarks, gone) = {
            let mut can = self.can.lock();
            (can.take_remarks(), can.is_gone())
        };
        if !remarks.is_empty() {
            self.findings.note_remarks(remarks, &self.image, &settled);
        }
        self.findings.look(session, &self.image, &settled);
        match settled {
            Settled::Access { access, .. } => {
                (self.now, self.instructions) = (access.virtual_time.0, access.instruction_count);
                self.check_clocks(session, &access);
                self.check_bank(&access, host);
            }
            Settled::Hit(hit) => self.hit(hit, session),
            Settled::Stop(stop) => (self.now, self.instructions) = (stop.at.0, stop.instruction_count),
            _ => {}
        }
        if self.hse_dead {
            let (_, registers) = session.board_mut().mcu.part.chip.clocks();
            let control = registers.get(rcc::Register::Cr);
            registers.set(rcc::Register::Cr, control & !HSE_READY);
        }
        self.check_strays();
        if self.findings.all().len() > self.told {
            self.tell_new();
        }
        if self.strict
            && self.cut_short.is_none()
            && let Some(finding) = self.findings.of(Grade::Unmodelled).next()
        {
            self.cut_short = Some(finding.line());
        }
        if gone || self.cut_short.is_some() || self.power_cut.is_some() {
            self.finish(host);
        }
    }

    fn on_stop(&mut self, session: &mut Session<Board>, stop: Stop, host: &mut dyn Host) -> Option<VirtualNanos> {
        self.log.drain(host);
        self.follow_phase(session, host);
        self.put_in(session, stop, host);
        if self.over || self.until.is_some_and(|until| stop.at.0 >= until) {
            self.finish(host);
            return None;
        }
        let wanted = [self.faults.first().map(|fault| fault.at), self.release_wire, self.release_core, self.until];
        let next = wanted.into_iter().flatten().filter(|at| *at > stop.at.0).min();
        Some(VirtualNanos(next.unwrap_or(u64::MAX).min(stop.at.0 + LOOK)))
    }
}
