//! Interrupts by role, for RTIC: the numbers are the chip's, the names are what they are for.
//!
//! The vector table is that of the chip's peripheral crate; `memory/stm32h743.x` makes its names aliases of these
//! roles.

use embassy_stm32::pac;
use link::metadata::MemoryRegion;

use super::super::constants::memory;

/// Priority levels of the chip.
pub use pac::NVIC_PRIO_BITS;

/// Where the image lies: bank 1 of the flash.
pub const IMAGE: MemoryRegion = region(memory::IMAGE);

/// Where the library lies: bank 2.
pub const STORE: Option<MemoryRegion> = Some(region(memory::STORE));

const fn region(region: memory::Region) -> MemoryRegion {
    MemoryRegion { start: region.start, length: region.length }
}

/// Interrupt lines by role.
#[allow(
    non_camel_case_types,
    clippy::upper_case_acronyms,
    reason = "interrupts are named as in every peripheral crate: RTIC makes handlers of these names"
)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
pub enum Interrupt {
    /// Timer 2: a slot begins.
    SLOT_TIMER = pac::Interrupt::TIM2 as u16,
    /// FDCAN1, line 0: it holds a received frame, lost one, or left the bus.
    CAN_RECEIVE = pac::Interrupt::FDCAN1_IT0 as u16,
    /// Software: FDCAN1 has room for a frame.
    CAN_TRANSMIT = pac::Interrupt::SPI1 as u16,
    /// Software: RTIC's tasks of the link session.
    DISPATCH_SESSION = pac::Interrupt::SPI2 as u16,
    /// Software: RTIC's tasks of the log.
    DISPATCH_LOG = pac::Interrupt::SPI3 as u16,
}

pub use Interrupt as interrupt;

// SAFETY: the numbers are lines of the chip's vector table, each used once.
unsafe impl cortex_m::interrupt::InterruptNumber for Interrupt {
    fn number(self) -> u16 {
        self as u16
    }
}

/// The lines that this board's own handlers serve, below the application.
pub(super) use pac::Interrupt as Chip;

/// The level the processor wants for a logical priority of RTIC, 1 (lowest) to 15.
pub(super) const fn level(logical: u8) -> u8 {
    ((1 << NVIC_PRIO_BITS) - logical) << (8 - NVIC_PRIO_BITS)
}
