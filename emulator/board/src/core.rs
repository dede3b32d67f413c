//! The processor core with what the crate's lacks: a data cache over bank 2, damaged flash words, and orders from
//! outside.
//!
//! Wraps the crate's processor. Every access to bank 2 is routed to the bus, where this answers it: through the cache
//! while the protection unit or the default map makes the address cacheable, past it otherwise. The registers of cache
//! maintenance are routed the same way, and so are the last words of the image, of which a reset may lose a part.

mod cache_bus;
mod partial;

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rigless::emulator::{
    Access, AccessKind, BitAlias, CoreBus, DataModel, Error, Exit, HaltReason, HostCall, Processor, Queued,
};
use rigless::soc::{Endian, Width};
use rigless::time::VirtualNanos;

use crate::cache::{BANK, CacheCount, DataCache};
use crate::notes::{FaultNote, Stray};
use cache_bus::CacheBus;
use partial::PartialWords;

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

/// Bytes of the last words, mark and check sum included.
const KEPT_BYTES: u32 = 512;

/// Content of a word under the stack that nothing has touched since service began.
pub const SERVICE_PAINT: u32 = 0xA5A5_A5A5;

/// An action on the core from outside the chip, before its next instruction.
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
    /// A bit of a word falls over.
    Flip(u32, u8),
    /// A register of the processor's own space is written by a debugger.
    Own(u32, u32),
    /// A register of the processor's own space is read, for [`CoreState::own`].
    Look(u32),
    /// The state that a fault handler finds is noted, with this time in ns.
    Note(u64),
    /// The unused stack between these addresses is painted, up to the stack pointer.
    Paint(Range<u32>),
}

/// Answers of a USB controller whose queues never say that they are empty.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Flush {
    /// They do not.
    pub holds: bool,
    /// A reset of the bus is told.
    pub reset: bool,
    /// Bits of the queues that are being emptied.
    pub asked: u64,
}

/// State that the core and the rest of the board share.
#[derive(Debug, Default)]
pub struct CoreState {
    /// Orders not yet carried out, oldest first.
    pub orders: Vec<Order>,
    /// The data cache.
    pub cache: DataCache,
    /// Flash words whose check bits do not fit: reading them fails.
    pub damaged: BTreeSet<u32>,
    /// Registers of the processor's own space as they were found.
    pub own: BTreeMap<u32, u32>,
    /// Accesses to addresses where nothing is.
    pub strays: Vec<Stray>,
    /// Faults whose handlers have begun.
    pub faults: Vec<FaultNote>,
    /// A damaged word was read, for the flash controller's status.
    pub double_error: bool,
    /// The USB controller has no clock from its transceiver: a reset of it does not end.
    pub usb_dead: bool,
    /// Bank 2 does not take the keys of its control register.
    pub bank_locked: bool,
    /// Bank 2 does nothing that it is told to.
    pub bank_deaf: bool,
    /// Queues of the USB controller that never say that they are empty.
    pub usb_flush: Flush,
    /// Flags of RCC.CR that are read as 0: loops that have lost their lock.
    pub loops_lost: u32,
    /// An operation of bank 2 does not end.
    pub bank_hangs: bool,
    /// Where the image keeps its last words, if it keeps any.
    pub kept: Option<u32>,
    /// Parts of words there that a reset would lose.
    pub partial: PartialWords,
}

/// [`CoreState`], shared.
#[derive(Clone, Debug, Default)]
pub struct SharedCore(Arc<Mutex<CoreState>>);

impl SharedCore {
    /// The state.
    pub fn lock(&self) -> MutexGuard<'_, CoreState> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counters of the cache.
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

    /// True if a read of `address` now goes through the data cache: it is on, and the memory is of a cacheable kind, by
    /// the protection unit or, where that is off or bypassed, by the default map.
    fn is_cacheable(&mut self, address: u32) -> bool {
        if self.own(CCR, None) & DATA_CACHE == 0 {
            return false;
        }
        let control = self.own(MPU_CTRL, None);
        let handler = self.register(register::XPSR) & 0x1FF;
        let negative = self.register(register::FAULTMASK) & 1 != 0 || matches!(handler, 2 | 3);
        // Without HFNMIENA the unit is bypassed at negative priorities; the code region of the default map is normal
        // memory, write-through (ARM DDI 0403 B3.1, B3.5).
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
                Order::Flip(address, bit) if is_own(address) => {
                    let value = self.own(u64::from(address), None);
                    self.own(u64::from(address), Some(value ^ 1 << bit));
                }
                Order::Flip(address, bit) => {
                    let read = Access::new(AccessKind::Read, u64::from(address), Width::W32, 0);
                    let value = bus.access(read, false).unwrap_or(0);
                    poke(bus, address, &[value as u32 ^ 1 << bit]);
                }
                Order::Own(address, value) => {
                    self.own(u64::from(address), Some(u64::from(value)));
                }
                Order::Look(address) => {
                    let value = self.own(u64::from(address), None) as u32;
                    self.shared.lock().own.insert(address, value);
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

/// True if the processor itself answers at an address.
fn is_own(address: u32) -> bool {
    address >> 20 == 0xE00
}

fn poke(bus: &mut dyn CoreBus, address: u32, words: &[u32]) {
    for (word, at) in words.iter().zip((u64::from(address)..).step_by(4)) {
        bus.access(Access::new(AccessKind::Write, at, Width::W32, u64::from(*word)), false);
    }
}

impl Processor for Core {
    fn run(&mut self, budget: u32, bus: &mut dyn CoreBus) -> (Exit, u64) {
        if !self.routed {
            self.routed = true;
            let page = self.inner.page_size().max(1);
            let kept = self.shared.lock().kept.map_or(0..0, |start| u64::from(start)..u64::from(start + KEPT_BYTES));
            let first = kept.start - kept.start % page;
            let kept = (first..kept.end).step_by(page as usize);
            for address in (u64::from(BANK.start)..u64::from(BANK.end)).step_by(page as usize).chain(kept) {
                self.inner.ask(Queued::Route(address));
            }
        }
        self.obey(bus);
        let shared = self.shared.clone();
        let mut wrapped = CacheBus::new(bus, &shared);
        let (exit, ran) = self.inner.run(budget, &mut wrapped);
        let Some(access) = wrapped.take_asked().filter(|_| exit == Exit::Halted) else {
            return (exit, ran);
        };
        let cacheable = self.is_cacheable(access.address as u32);
        wrapped.judge(&access, cacheable);
        // The one instruction that was stopped before; then the runner decides how far to go.
        let (exit, more) = self.inner.run(1, &mut wrapped);
        (if exit == Exit::Budget { Exit::Returned } else { exit }, ran + more)
    }

    fn reset(&mut self) {
        {
            let mut state = self.shared.lock();
            state.cache.clear();
            let lost: Vec<_> = state.partial.forget().collect();
            state.orders.extend(lost.into_iter().map(|(address, held)| Order::Poke(address, vec![held])));
        }
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
