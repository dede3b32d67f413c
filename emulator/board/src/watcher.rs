//! Watches a run from outside the chip: the log, the stack, findings, and the faults that are put in.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use fdcan_model::Unit;
use rigless::emulator::{Access, AccessKind, Driver, Hit, Host, Settled, Stop, Watch};

use rigless::session::Session;
use rigless::soc::Width;
use rigless::soc::stm32h743::generated::rcc;
use rigless::time::VirtualNanos;

use crate::bank::{BankWatch, Operation, stalls, tear};
use crate::board::Board;
use crate::cache::BANK;
use crate::can::SharedCan;
use crate::clocks::{Clocks, loop_flaws};
use crate::core::{Order, SharedCore};
use crate::fault::{Fault, Kind};
use crate::findings::{Finding, Findings, Grade};
use crate::image::Image;
use crate::log::Log;
use crate::report::Measured;
use crate::setup::{Outcome, Setup};
use crate::stack::{self, StackUse};
use crate::watchdog::SharedWatch;

/// Nanoseconds between two looks: 1 ms.
pub const LOOK: u64 = 1_000_000;

/// RCC.CR, and its flag of the crystal oscillator.
const CLOCK_CONTROL: u64 = 0x5802_4400;
const HSE_READY: u64 = 1 << 17;

/// The lines of software that run the session (SPI2, 36) and the log (SPI3, 51), and the words of the interrupt
/// controller that hold their priorities.
const PRIORITIES: [(u32, u32); 2] = [(36, 0xE000_E424), (51, 0xE000_E430)];

/// An access this near below the stack is taken for one of the stack's.
const NEAR_STACK: u32 = 128 * 1024;

/// See the module.
pub struct Watcher {
    pub(crate) image: Arc<Image>,
    pub(crate) can: SharedCan,
    pub(crate) core: SharedCore,
    pub(crate) watch: SharedWatch,
    log: Log,
    interrupt: Arc<AtomicBool>,
    until: Option<u64>,
    strict: bool,
    tells: bool,
    /// Faults not yet put in, the earliest first.
    pub(crate) faults: Vec<Fault>,
    pub(crate) hse_dead: bool,
    pub(crate) held: bool,
    first_slot: Option<u64>,
    power_cut: Option<String>,
    /// The wire or the core is to be let go at this time.
    pub(crate) release_wire: Option<u64>,
    pub(crate) release_core: Option<u64>,
    pub(crate) cut_at: Option<u64>,
    pub(crate) hang_at: Option<u64>,
    pub(crate) bank_watch: BankWatch,
    clock_control: u64,
    findings: Findings,
    told: usize,
    stack: StackUse,
    resets_seen: usize,
    frames_at_reset: u64,
    bank2: Vec<u8>,
    over: bool,
    pub(crate) cut_short: Option<String>,
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
            held: false,
            first_slot: None,
            power_cut: None,
            release_wire: None,
            release_core: None,
            cut_at: None,
            hang_at: None,
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
            if std::mem::take(&mut self.held) {
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
            let orders = &mut self.core.lock().orders;
            orders.push(Order::Paint(painted));
            orders.extend(PRIORITIES.map(|(_, address)| Order::Look(address)));
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
        if self.core.lock().bank_hangs && stalls(access) {
            // The bus waits for the bank, and the core for the bus.
            host.hold(true);
            self.held = true;
            self.findings.add(Finding {
                grade: Grade::Refused,
                register: "bank 2".into(),
                address: Some(access.address),
                function: access.program_counter.map(|pc| self.image.function_at(pc as u32)),
                text: "an access to a bank whose operation does not end: the core waits for it".into(),
                at: access.virtual_time.0,
            });
            return;
        }
        let Some(operation) = self.bank_watch.see(access) else { return };
        if self.hang_at == Some(self.bank_watch.operations) {
            self.core.lock().bank_hangs = true;
        }
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

    /// Measurements of the run.
    #[must_use]
    pub fn into_outcome(self, session: &mut Session<Board>) -> Outcome {
        let resets = session.resets().iter().map(|reset| (reset.at.0, format!("{:?}", reset.cause))).collect();
        let clocks = Clocks::of(&mut session.board_mut().mcu.part);
        let serial_baud = clocks.baud(&session.board().mcu.part);
        let core = self.core.lock();
        let faults = core.faults.clone();
        let priorities = PRIORITIES.map(|(line, address)| {
            let word = core.own.get(&address).copied().unwrap_or(0);
            (word >> (8 * (line % 4)) & 0xFF) as u8
        });
        drop(core);
        let can = self.can.lock();
        let measured = Measured {
            now: self.now,
            instructions: self.instructions,
            resets,
            first_frame: can.first_frame(),
            first_slot: self.first_slot,
            second_bus: can.status(Unit::Two).on_bus,
            frames_sent: can.frames_sent(),
            clocks,
            timing: can.status(Unit::One).timing,
            stack: self.stack,
            watchdog: self.watch.get(),
            cache: self.core.cache_count(),
            faults,
            priorities,
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
