//! The processor core with what the crate's lacks: a data cache over bank 2, damaged flash words, and orders from outside.
//!
//! Wraps the crate's processor. Every access to bank 2 is routed to the bus, where this answers it: through the cache while the
//! protection unit or the default map makes the address cacheable, past it otherwise. The registers of cache maintenance
//! are routed the same way.

use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rigless::emulator::{
    Access, AccessKind, BitAlias, Checked, CoreBus, DataModel, Error, Exit, HaltReason, HostCall, InterruptLine,
    Processor, Queued,
};
use rigless::soc::{Endian, Width};
use rigless::time::VirtualNanos;

use crate::cache::{BANK, CacheCount, DataCache, LINE, MAINTENANCE};
use crate::image::Image;

/// Registers by the numbers of the crate's debugger.
mod register {
    pub(super) const SP: usize = 13;
    pub(super) const LR: usize = 14;
    pub(super) const PC: usize = 15;
    pub(super) const XPSR: usize = 16;
    pub(super) const PRIMASK: usize = 36;
    pub(super) const FAULTMASK: usize = 38;
}

/// Registers of the system control space.
const CCR: u64 = 0xE000_ED14;
const CFSR: u64 = 0xE000_ED28;
const HFSR: u64 = 0xE000_ED2C;
const MMFAR: u64 = 0xE000_ED34;
const BFAR: u64 = 0xE000_ED38;
const MPU_CTRL: u64 = 0xE000_ED94;
const MPU_RNR: u64 = 0xE000_ED98;
const MPU_RBAR: u64 = 0xE000_ED9C;
const MPU_RASR: u64 = 0xE000_EDA0;

/// CCR.DC: the data cache is on.
const DATA_CACHE: u64 = 1 << 16;

/// What a word under the stack holds that nothing has touched since service began.
pub const SERVICE_PAINT: u32 = 0xA5A5_A5A5;

/// What somebody outside the chip does to the core, before its next instruction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Order {
    /// The core goes on at this address.
    Jump {
        /// Where.
        pc: u32,
        /// R0 to R3 there.
        arguments: [u32; 4],
        /// Interrupts are masked there.
        masked: bool,
    },
    /// The stack pointer is moved here.
    Stack(u32),
    /// Words are written to memory.
    Poke(u32, Vec<u32>),
    /// A register of the processor's own space is written by a debugger.
    Own(u32, u32),
    /// What a fault handler finds is noted, with this time in ns.
    Note(u64),
    /// The unused stack between these addresses is painted, up to the stack pointer.
    Paint(Range<u32>),
}

/// An access to an address where nothing is: a bus fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stray {
    /// Where to.
    pub address: u32,
    /// Where the program was.
    pub program_counter: u32,
    /// When, ns.
    pub at: u64,
}

/// What the handler of a fault finds when it begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaultNote {
    /// When, ns.
    pub at: u64,
    /// Number of the exception: 3 hard fault, 4 memory management, 5 bus, 6 usage.
    pub exception: u32,
    /// The stack pointer.
    pub stack: u32,
    /// CFSR, HFSR, MMFAR, BFAR.
    pub configurable: u32,
    /// See above.
    pub hard: u32,
    /// See above.
    pub memory_address: u32,
    /// See above.
    pub bus_address: u32,
}

impl FaultNote {
    /// One line for people.
    #[must_use]
    pub fn line(&self, image: &Image) -> String {
        let name = match self.exception {
            2 => "non-maskable interrupt",
            3 => "hard fault",
            4 => "memory management fault",
            5 => "bus fault",
            6 => "usage fault",
            _ => "unexpected exception",
        };
        let place = if self.stack < image.stack.start {
            let below = image.stack.start - self.stack;
            format!(", {below} bytes below the stack, which ends at {:#010x}", image.stack.start)
        } else {
            String::new()
        };
        format!(
            "{name} at {} us: SP {:#010x}{place}; CFSR {:#010x}, HFSR {:#010x}, MMFAR {:#010x}, BFAR {:#010x}",
            self.at / 1000,
            self.stack,
            self.configurable,
            self.hard,
            self.memory_address,
            self.bus_address
        )
    }
}

/// What the core and the rest of the board share.
#[derive(Debug, Default)]
pub struct CoreState {
    /// Orders not yet carried out, oldest first.
    pub orders: Vec<Order>,
    /// The data cache.
    pub cache: DataCache,
    /// Flash words whose check bits do not fit: reading them fails.
    pub damaged: BTreeSet<u32>,
    /// Accesses to addresses where nothing is.
    pub strays: Vec<Stray>,
    /// Faults whose handlers have begun.
    pub faults: Vec<FaultNote>,
    /// A damaged word was read, for the flash controller's status.
    pub double_error: bool,
}

/// [`CoreState`], shared.
#[derive(Clone, Debug, Default)]
pub struct SharedCore(Arc<Mutex<CoreState>>);

impl SharedCore {
    /// The state.
    pub fn lock(&self) -> MutexGuard<'_, CoreState> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What the cache has seen.
    #[must_use]
    pub fn cache_count(&self) -> CacheCount {
        self.lock().cache.count
    }
}

/// The wrapped processor.
#[derive(Debug)]
pub struct Core {
    inner: Box<dyn Processor>,
    shared: SharedCore,
    routed: bool,
}

impl Core {
    /// Wraps a processor.
    #[must_use]
    pub fn new(inner: Box<dyn Processor>, shared: SharedCore) -> Self {
        Self { inner, shared, routed: false }
    }

    fn register(&self, number: usize) -> u32 {
        let bytes = self.inner.gdb_register(number).unwrap_or_default();
        bytes.try_into().map_or(0, u32::from_le_bytes)
    }

    fn set_register(&mut self, number: usize, value: u32) {
        self.inner.set_gdb_register(number, &value.to_le_bytes());
    }

    fn own(&mut self, address: u64, write: Option<u64>) -> u64 {
        self.inner.debugger_access(write, address, Width::W32, VirtualNanos(0)).unwrap_or(0)
    }

    /// Whether a read of `address` now goes through the data cache: it is on, and the memory is of a cacheable kind, by the
    /// protection unit or, where that is off or bypassed, by the default map.
    fn is_cacheable(&mut self, address: u32) -> bool {
        if self.own(CCR, None) & DATA_CACHE == 0 {
            return false;
        }
        let control = self.own(MPU_CTRL, None);
        let handler = self.register(register::XPSR) & 0x1FF;
        let negative = self.register(register::FAULTMASK) & 1 != 0 || matches!(handler, 2 | 3);
        // Without HFNMIENA the unit is bypassed at negative priorities; the code region of the default map is normal memory,
        // write-through (ARM DDI 0403 B3.1, B3.5).
        if control & 1 == 0 || (negative && control & 2 == 0) {
            return true;
        }
        let kept = self.own(MPU_RNR, None);
        let mut attributes = None;
        for region in 0..16 {
            self.own(MPU_RNR, Some(region));
            let (base, value) = (self.own(MPU_RBAR, None), self.own(MPU_RASR, None));
            let size = 1_u64 << ((value >> 1 & 0x1F) + 1);
            let offset = u64::from(address).wrapping_sub(base & !(size - 1));
            let disabled = value >> 8 & 0xFF;
            if value & 1 != 0 && offset < size && disabled >> (offset * 8 / size) & 1 == 0 {
                attributes = Some(value);
            }
        }
        self.own(MPU_RNR, Some(kept));
        // TEX, C, B: cacheable if TEX has bit 2 (outer and inner policies apart, inner in C and B), or C is set.
        attributes.is_none_or(|value| {
            let (tex, c, b) = (value >> 19 & 7, value >> 17 & 1, value >> 16 & 1);
            if tex & 4 != 0 { c | b != 0 } else { c != 0 || (tex == 1 && b != 0) }
        })
    }

    fn note(&mut self, at: u64) -> FaultNote {
        FaultNote {
            at,
            exception: self.register(register::XPSR) & 0x1FF,
            stack: self.register(register::SP),
            configurable: self.own(CFSR, None) as u32,
            hard: self.own(HFSR, None) as u32,
            memory_address: self.own(MMFAR, None) as u32,
            bus_address: self.own(BFAR, None) as u32,
        }
    }

    /// Carries orders out between two instructions.
    fn obey(&mut self, bus: &mut dyn CoreBus) {
        let orders = std::mem::take(&mut self.shared.lock().orders);
        for order in orders {
            match order {
                Order::Jump { pc, arguments, masked } => {
                    for (number, argument) in arguments.into_iter().enumerate() {
                        self.set_register(number, argument);
                    }
                    self.set_register(register::LR, 0xFFFF_FFFF);
                    // Thumb state, no IT block, the exception number as it is.
                    let xpsr = self.register(register::XPSR);
                    self.set_register(register::XPSR, xpsr & 0xF800_01FF | 1 << 24);
                    self.set_register(register::PRIMASK, u32::from(masked));
                    self.set_register(register::PC, pc & !1);
                }
                Order::Stack(address) => self.set_register(register::SP, address),
                Order::Poke(address, words) => poke(bus, address, &words),
                Order::Own(address, value) => {
                    self.own(u64::from(address), Some(u64::from(value)));
                }
                Order::Note(at) => {
                    let note = self.note(at);
                    self.shared.lock().faults.push(note);
                }
                Order::Paint(range) => {
                    let top = self.register(register::SP).min(range.end);
                    let words = top.saturating_sub(range.start) / 4;
                    poke(bus, range.start, &vec![SERVICE_PAINT; words as usize]);
                }
            }
        }
    }
}

fn poke(bus: &mut dyn CoreBus, address: u32, words: &[u32]) {
    for (word, at) in words.iter().zip((u64::from(address)..).step_by(4)) {
        bus.access(Access::new(AccessKind::Write, at, Width::W32, u64::from(*word)), false);
    }
}

/// The bus as the processor sees it through this.
struct CacheBus<'a> {
    inner: &'a mut dyn CoreBus,
    shared: &'a SharedCore,
    /// Whether the read that was stopped before goes through the cache, once that is known: its instruction and count.
    verdict: Option<(Option<u64>, u64, bool)>,
    /// The read that waits for a verdict.
    asked: Option<Access>,
}

/// Memory below the peripherals, by first and last address (RM0433 2.3.2): ITCM, flash, system memory, DTCM, AXI, the three
/// of the second domain, that of the third, the backup memory.
const MEMORIES: [(u64, u64); 9] = [
    (0x0000_0000, 0x0000_FFFF),
    (0x0800_0000, 0x081F_FFFF),
    (0x1FF0_0000, 0x1FF1_FFFF),
    (0x1FF4_0000, 0x1FF5_FFFF),
    (0x2000_0000, 0x2001_FFFF),
    (0x2400_0000, 0x2407_FFFF),
    (0x3000_0000, 0x3004_7FFF),
    (0x3800_0000, 0x3800_FFFF),
    (0x3880_0000, 0x3880_0FFF),
];

/// The peripherals, and the processor's own space.
const PERIPHERALS: [(u64, u64); 2] = [(0x4000_0000, 0x5FFF_FFFF), (0xE000_0000, 0xE00F_FFFF)];

/// Whether anything answers at an address; an access elsewhere is a bus fault.
fn exists(address: u64) -> bool {
    MEMORIES.iter().chain(&PERIPHERALS).any(|(first, last)| (*first..=*last).contains(&address))
}

fn in_bank(address: u64) -> bool {
    (u64::from(BANK.start)..u64::from(BANK.end)).contains(&address)
}

impl CacheBus<'_> {
    fn verdict_for(&self, access: &Access) -> Option<bool> {
        let (pc, count, cacheable) = self.verdict?;
        (pc == access.program_counter && count == access.instruction_count).then_some(cacheable)
    }

    fn read_bank(&mut self, access: Access, from_code: bool) -> Option<u64> {
        let address = access.address as u32;
        let line = address & !(LINE - 1);
        let mut state = self.shared.lock();
        state.cache.count.reads += 1;
        if state.damaged.contains(&line) {
            state.double_error = true;
            return None;
        }
        let memory = self.inner.access(access, from_code)?;
        if self.verdict_for(&access) != Some(true) {
            return Some(memory);
        }
        state.cache.count.cacheable += 1;
        let bytes = access.width.bytes() as usize;
        let offset = (address - line) as usize;
        if let Some(held) = state.cache.line(address) {
            let mut value = [0; 8];
            value[..bytes].copy_from_slice(&held[offset..offset + bytes]);
            let held = u64::from_le_bytes(value);
            state.cache.count.hits += 1;
            if held != memory {
                state.cache.count.stale += 1;
                state.cache.count.first_stale.get_or_insert(access.program_counter.unwrap_or(0) as u32);
            }
            return Some(held);
        }
        let mut fresh = [0; LINE as usize];
        for (place, at) in fresh.chunks_exact_mut(4).zip((u64::from(line)..).step_by(4)) {
            let word = self.inner.access(Access::new(AccessKind::Read, at, Width::W32, 0), false).unwrap_or(0);
            place.copy_from_slice(&(word as u32).to_le_bytes());
        }
        state.cache.fill(address, fresh);
        Some(memory)
    }
}

impl CoreBus for CacheBus<'_> {
    fn access(&mut self, access: Access, from_code: bool) -> Option<u64> {
        if in_bank(access.address) {
            if access.kind == AccessKind::Read {
                return self.read_bank(access, from_code);
            }
            let bytes = access.value.to_le_bytes();
            self.shared.lock().cache.store(access.address as u32, &bytes[..access.width.bytes() as usize]);
        } else if (u64::from(MAINTENANCE.start)..u64::from(MAINTENANCE.end)).contains(&access.address) {
            if access.kind == AccessKind::Write {
                self.shared.lock().cache.maintain(access.address as u32, access.value as u32);
            }
            return Some(0);
        }
        if !exists(access.address) {
            self.shared.lock().strays.push(Stray {
                address: access.address as u32,
                program_counter: access.program_counter.unwrap_or(0) as u32,
                at: access.virtual_time.0,
            });
            return None;
        }
        self.inner.access(access, from_code)
    }

    fn time(&self, instructions: u64) -> VirtualNanos {
        self.inner.time(instructions)
    }

    fn queued(&mut self) -> Vec<Queued> {
        self.inner.queued()
    }

    fn carry_on(&mut self, instructions: u64, event: Option<VirtualNanos>) -> Option<u32> {
        self.inner.carry_on(instructions, event)
    }

    fn acknowledge(&mut self, line: InterruptLine, instructions: u64) -> Option<u64> {
        self.inner.acknowledge(line, instructions)
    }

    fn read_checked(&mut self, access: Access, report: bool) -> Option<Checked> {
        self.inner.read_checked(access, report)
    }

    fn write_checked(&mut self, access: Access) -> Option<bool> {
        self.inner.write_checked(access)
    }

    /// Stops before a read of bank 2 once: whether it goes through the cache depends on registers that only a stopped core
    /// shows.
    fn stops_before(&mut self, access: &Access) -> bool {
        if access.kind == AccessKind::Read && in_bank(access.address) && self.verdict_for(access).is_none() {
            self.asked = Some(*access);
            return true;
        }
        self.inner.stops_before(access)
    }

    fn send_trace(&mut self, bytes: &[u8]) {
        self.inner.send_trace(bytes);
    }
}

impl Processor for Core {
    fn run(&mut self, budget: u32, bus: &mut dyn CoreBus) -> (Exit, u64) {
        if !self.routed {
            self.routed = true;
            let page = self.inner.page_size().max(1);
            for address in (u64::from(BANK.start)..u64::from(BANK.end)).step_by(page as usize) {
                self.inner.ask(Queued::Route(address));
            }
        }
        self.obey(bus);
        let shared = self.shared.clone();
        let mut wrapped = CacheBus { inner: bus, shared: &shared, verdict: None, asked: None };
        let (exit, ran) = self.inner.run(budget, &mut wrapped);
        let Some(access) = wrapped.asked.take().filter(|_| exit == Exit::Halted) else {
            return (exit, ran);
        };
        let cacheable = self.is_cacheable(access.address as u32);
        wrapped.verdict = Some((access.program_counter, access.instruction_count, cacheable));
        // The one instruction that was stopped before; then the runner decides how far to go.
        let (exit, more) = self.inner.run(1, &mut wrapped);
        (if exit == Exit::Budget { Exit::Returned } else { exit }, ran + more)
    }

    fn reset(&mut self) {
        self.shared.lock().cache.clear();
        self.inner.reset();
    }

    fn retired(&self) -> u64 {
        self.inner.retired()
    }

    fn ask(&mut self, queued: Queued) {
        self.inner.ask(queued);
    }

    fn maps(&self, start: u64, length: u64) -> bool {
        self.inner.maps(start, length)
    }

    fn page_size(&self) -> u64 {
        self.inner.page_size()
    }

    #[expect(unsafe_code, reason = "the trait hands host memory over by raw pointer")]
    unsafe fn map(&mut self, start: u64, length: u64, host: *mut u8, writable: bool) {
        // SAFETY: passed on as it came: the wrapped processor lives exactly as long as this.
        unsafe { self.inner.map(start, length, host, writable) };
    }

    fn boot(&mut self, table: u64, read: &dyn Fn(u64, Width) -> Option<u64>) {
        self.inner.boot(table, read);
    }

    fn take_reset_request(&mut self) -> bool {
        self.inner.take_reset_request()
    }

    fn next_event(&self) -> Option<VirtualNanos> {
        self.inner.next_event()
    }

    fn on_event(&mut self, now: VirtualNanos) {
        self.inner.on_event(now);
    }

    fn waiting(&self) -> bool {
        self.inner.waiting()
    }

    fn pc(&self) -> u64 {
        self.inner.pc()
    }

    fn add_breakpoint(&mut self, address: u64) -> bool {
        self.inner.add_breakpoint(address)
    }

    fn remove_breakpoint(&mut self, address: u64) {
        self.inner.remove_breakpoint(address);
    }

    fn pass_breakpoint(&mut self, address: u64) {
        self.inner.pass_breakpoint(address);
    }

    fn attach_debugger(&mut self, attached: bool) {
        self.inner.attach_debugger(attached);
    }

    fn hold_interrupts(&mut self, held: bool) {
        self.inner.hold_interrupts(held);
    }

    fn gdb_register(&self, number: usize) -> Option<Vec<u8>> {
        self.inner.gdb_register(number)
    }

    fn set_gdb_register(&mut self, number: usize, bytes: &[u8]) -> bool {
        self.inner.set_gdb_register(number, bytes)
    }

    fn debugger_access(&mut self, write: Option<u64>, address: u64, width: Width, now: VirtualNanos) -> Option<u64> {
        self.inner.debugger_access(write, address, width, now)
    }

    fn take_debugger_trace(&mut self) -> Vec<u8> {
        self.inner.take_debugger_trace()
    }

    fn target_xml(&self) -> &'static str {
        self.inner.target_xml()
    }

    fn data_model(&self) -> DataModel {
        self.inner.data_model()
    }

    fn byte_order(&self, address: u64) -> Endian {
        self.inner.byte_order(address)
    }

    fn save(&self) -> Vec<u8> {
        self.inner.save()
    }

    fn load(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.inner.load(bytes)
    }

    fn monitor_command(&mut self, command: &str) -> Option<String> {
        self.inner.monitor_command(command)
    }

    fn debugger_halted(&mut self, why: HaltReason) -> bool {
        self.inner.debugger_halted(why)
    }

    fn bit_alias(&self, address: u64, width: Width) -> Option<BitAlias> {
        self.inner.bit_alias(address, width)
    }

    fn own_ranges(&self) -> Vec<Range<u64>> {
        self.inner.own_ranges()
    }

    fn check_reads(&mut self, every: bool) {
        self.inner.check_reads(every);
    }

    fn check_words(&mut self, words: &[u64]) {
        self.inner.check_words(words);
    }

    fn host_call(&self, read: &mut dyn FnMut(u64, Width) -> Option<u64>) -> Option<HostCall> {
        self.inner.host_call(read)
    }

    fn answer_host_call(&mut self, answer: Option<u64>) {
        self.inner.answer_host_call(answer);
    }
}
