//! The peripherals this image uses, for RTIC and the modules beside this one: interrupt lines, vectors, registers.
//!
//! Interrupts carry the name of their role. Lines 24 and up belong to no peripheral that is used; they are raised by
//! software only.

use cortex_m_rt as _;
use link::metadata::MemoryRegion;

/// Priority levels: QEMU implements 8 bits; 4 is what STM32 parts have, so priorities mean the same on both.
pub const NVIC_PRIO_BITS: u8 = 4;

/// Where the image lies; QEMU loads it there.
pub const IMAGE: MemoryRegion = MemoryRegion { start: 0, length: 1024 * 1024 };

/// The library's flash is the simulator's, not in this address space.
pub const STORE: Option<MemoryRegion> = None;

/// Ticks per second of the peripheral clock, which counts the timers and the free-running counter.
pub const PERIPHERAL_HZ: u32 = 25_000_000;

/// Interrupt lines by role.
#[allow(
    non_camel_case_types,
    clippy::upper_case_acronyms,
    reason = "interrupts are named as in every peripheral crate: RTIC makes handlers of these names"
)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
pub enum Interrupt {
    /// Timer 0: a slot begins.
    SLOT_TIMER = 8,
    /// Timer 1: something happens on the simulated bus.
    BUS_WIRE = 9,
    /// Software: the simulated CAN controller holds a received frame.
    CAN_RECEIVE = 24,
    /// Software: the simulated CAN controller has room for a frame.
    CAN_TRANSMIT = 25,
    /// Software: RTIC's tasks of the link session.
    DISPATCH_SESSION = 26,
    /// Software: RTIC's tasks of the log.
    DISPATCH_LOG = 27,
}

pub use Interrupt as interrupt;

// SAFETY: the numbers are lines of the vector table below, each used once.
unsafe impl cortex_m::interrupt::InterruptNumber for Interrupt {
    fn number(self) -> u16 {
        self as u16
    }
}

/// One entry of the vector table.
#[derive(Clone, Copy)]
#[repr(C)]
pub union Vector {
    handler: unsafe extern "C" fn(),
    reserved: usize,
}

unsafe extern "C" {
    fn SLOT_TIMER();
    fn BUS_WIRE();
    fn CAN_RECEIVE();
    fn CAN_TRANSMIT();
    fn DISPATCH_SESSION();
    fn DISPATCH_LOG();
}

/// Vectors of the 32 lines, placed behind the core's exceptions by cortex-m-rt.
#[unsafe(link_section = ".vector_table.interrupts")]
#[unsafe(no_mangle)]
pub static __INTERRUPTS: [Vector; 32] = {
    let mut table = [Vector { reserved: 0 }; 32];
    table[Interrupt::SLOT_TIMER as usize] = Vector { handler: SLOT_TIMER };
    table[Interrupt::BUS_WIRE as usize] = Vector { handler: BUS_WIRE };
    table[Interrupt::CAN_RECEIVE as usize] = Vector { handler: CAN_RECEIVE };
    table[Interrupt::CAN_TRANSMIT as usize] = Vector { handler: CAN_TRANSMIT };
    table[Interrupt::DISPATCH_SESSION as usize] = Vector { handler: DISPATCH_SESSION };
    table[Interrupt::DISPATCH_LOG as usize] = Vector { handler: DISPATCH_LOG };
    table
};

/// A 32-bit register at a fixed address.
#[derive(Clone, Copy)]
pub(super) struct Register(usize);

impl Register {
    pub(super) fn write(self, value: u32) {
        // SAFETY: only this module makes registers, all of them inside the peripherals listed below.
        unsafe { core::ptr::write_volatile(self.0 as *mut u32, value) }
    }

    pub(super) fn read(self) -> u32 {
        // SAFETY: as for `write`; no register used here changes by being read.
        unsafe { core::ptr::read_volatile(self.0 as *const u32) }
    }
}

/// CMSDK timer: counts down at the peripheral clock, interrupts at 0 and starts again from `reload`.
pub(super) struct Timer {
    /// Bit 0 runs, bit 3 enables the interrupt.
    pub(super) control: Register,
    /// Ticks left.
    pub(super) value: Register,
    /// Value after 0: the period is one more.
    pub(super) reload: Register,
    /// Read: bit 0 is set while the interrupt is up. Write 1: takes it back.
    pub(super) interrupt: Register,
}

impl Timer {
    /// Counts and interrupts.
    pub(super) const RUN: u32 = 0b1001;
    /// Stands still.
    pub(super) const STOP: u32 = 0;

    const fn at(address: usize) -> Self {
        Self {
            control: Register(address),
            value: Register(address + 4),
            reload: Register(address + 8),
            interrupt: Register(address + 12),
        }
    }
}

/// Makes the slots.
pub(super) const TIMER0: Timer = Timer::at(0x4000_0000);

/// Interrupts when something happens on the simulated bus.
pub(super) const TIMER1: Timer = Timer::at(0x4000_1000);

/// FPGAIO counter: free-running, up, 32 bits.
pub(super) const COUNTER: Register = Register(0x4002_8018);

/// FPGAIO prescaler of [`COUNTER`]: 0 counts every tick of the peripheral clock.
pub(super) const PRESCALE: Register = Register(0x4002_801C);

/// FPGAIO light-emitting diodes: bit 0 is the first one.
pub(super) const LEDS: Register = Register(0x4002_8000);
