//! The bus as the wrapped processor sees it: bank 2 through the data cache or past it, cache maintenance, and addresses
//! where nothing is.

use std::ops::Range;

use rigless::emulator::{Access, AccessKind, Checked, CoreBus, InterruptLine, Queued};
use rigless::soc::Width;
use rigless::time::VirtualNanos;

use crate::cache::{BANK, LINE, MAINTENANCE};
use crate::notes::Stray;

use super::SharedCore;

/// The bus as the processor sees it through this.
pub(crate) struct CacheBus<'a> {
    inner: &'a mut dyn CoreBus,
    shared: &'a SharedCore,
    /// True if the read that was stopped before goes through the cache, once that is known: its instruction and count.
    verdict: Option<(Option<u64>, u64, bool)>,
    /// The read that waits for a verdict.
    asked: Option<Access>,
}

/// Memory below the peripherals, by first and last address (RM0433 2.3.2): ITCM, flash, system memory, DTCM, AXI, the
/// three of the second domain, that of the third, the backup memory.
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

/// The tightly coupled data memory.
const DATA_MEMORY: Range<u64> = 0x2000_0000..0x2002_0000;

/// Address of FLASH.SR2, and its bits BSY and QW: an operation runs.
const BANK_STATUS: u64 = 0x5200_2110;
const BUSY: u64 = 0b101;

/// Address of RCC.CR.
const CLOCK_CONTROL: u64 = 0x5802_4400;

/// Address of GRSTCTL of the USB controller, and its bit CSRST: it is being reset.
const USB_RESET: u64 = 0x4008_0010;
const USB_RESETS: u64 = 1;

/// Its bits of queues that are being emptied.
const USB_FLUSHES: u64 = 0b11 << 4;

/// Address of GINTSTS of the USB controller, and its bit USBRST: the bus is reset.
const USB_STATUS: u64 = 0x4008_0014;
const USB_BUS_RESET: u64 = 1 << 12;

/// Addresses of FLASH.KEYR2 and FLASH.CR2, and the latter's bit START2.
const BANK_KEY: u64 = 0x5200_2104;
const BANK_CONTROL: u64 = 0x5200_210C;
const BANK_START: u64 = 1 << 7;

/// The peripherals, and the processor's own space.
const PERIPHERALS: [(u64, u64); 2] = [(0x4000_0000, 0x5FFF_FFFF), (0xE000_0000, 0xE00F_FFFF)];

/// True if anything answers at an address; an access elsewhere is a bus fault.
fn exists(address: u64) -> bool {
    MEMORIES.iter().chain(&PERIPHERALS).any(|(first, last)| (*first..=*last).contains(&address))
}

fn in_bank(address: u64) -> bool {
    (u64::from(BANK.start)..u64::from(BANK.end)).contains(&address)
}

impl<'a> CacheBus<'a> {
    /// Nothing is known of any read yet.
    pub(crate) fn new(inner: &'a mut dyn CoreBus, shared: &'a SharedCore) -> Self {
        Self { inner, shared, verdict: None, asked: None }
    }

    /// The read of bank 2 that the core was stopped before, if that was why it stopped.
    pub(crate) fn take_asked(&mut self) -> Option<Access> {
        self.asked.take()
    }

    /// Registers of the stopped core at that read.
    pub(crate) fn judge(&mut self, access: &Access, cacheable: bool) {
        self.verdict = Some((access.program_counter, access.instruction_count, cacheable));
    }

    fn verdict_for(&self, access: &Access) -> Option<bool> {
        let (pc, count, cacheable) = self.verdict?;
        (pc == access.program_counter && count == access.instruction_count).then_some(cacheable)
    }

    /// Notes what a write begins, and tells whether a fault keeps it from the chip.
    fn is_lost(&self, access: &Access) -> bool {
        let mut state = self.shared.lock();
        match access.address {
            USB_RESET => state.usb_flush.asked |= access.value & USB_FLUSHES,
            USB_STATUS if access.value & USB_BUS_RESET != 0 => state.usb_flush.reset = false,
            BANK_KEY => return state.bank_locked,
            BANK_CONTROL => return state.bank_deaf && access.value & BANK_START != 0,
            address => return state.bank_deaf && in_bank(address),
        }
        false
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
        for (place, at) in fresh.as_chunks_mut::<4>().0.iter_mut().zip((u64::from(line)..).step_by(4)) {
            let word = self.inner.access(Access::new(AccessKind::Read, at, Width::W32, 0), false).unwrap_or(0);
            *place = (word as u32).to_le_bytes();
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
        if access.kind == AccessKind::Write && self.is_lost(&access) {
            return Some(0);
        }
        if access.kind != AccessKind::Read && DATA_MEMORY.contains(&access.address) {
            let inner = &mut *self.inner;
            let read = |at: u32| {
                let word = Access::new(AccessKind::Read, u64::from(at), Width::W32, 0);
                inner.access(word, false).unwrap_or(0) as u32
            };
            self.shared.lock().partial.write(access.address as u32, access.width.bytes(), read);
        }
        let value = self.inner.access(access, from_code)?;
        if access.kind != AccessKind::Read {
            return Some(value);
        }
        Some(match access.address {
            BANK_STATUS if self.shared.lock().bank_hangs => value | BUSY,
            CLOCK_CONTROL => value & !u64::from(self.shared.lock().loops_lost),
            USB_RESET if self.shared.lock().usb_flush.holds => value | self.shared.lock().usb_flush.asked,
            USB_STATUS if self.shared.lock().usb_flush.reset => value | USB_BUS_RESET,
            USB_RESET if self.shared.lock().usb_dead => value | USB_RESETS,
            _ => value,
        })
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

    /// Stops before a read of bank 2 once: whether it goes through the cache depends on registers that only a stopped
    /// core shows.
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
