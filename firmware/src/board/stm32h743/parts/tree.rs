//! The clock tree in the words of embassy-stm32.

use embassy_stm32::Config;
use embassy_stm32::rcc::{
    self, AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllDiv, PllMul, PllPreDiv, PllSource, Sysclk, TimerPrescaler,
    VoltageScale,
};
use embassy_stm32::time::Hertz;

use super::super::constants::clocks::{AHB_DIVIDER, APB_DIVIDER, HSE_HZ, PLL1, PLL3, PhaseLockedLoop};

/// Cortex-M7 revisions of the chip before V report less than this.
const REVISION_V: u16 = 0x2000;

/// Read-issuing override of the AXI matrix towards the AXI memory (AXI_TARG7_FN_MOD).
const AXI_MEMORY_READS: *mut u32 = 0x5100_8108 as *mut u32;

// The dividers below are written out as embassy-stm32's names; these lines keep them equal to the constants.
const _: () = assert!(AHB_DIVIDER == 2 && APB_DIVIDER == 2);

/// The clock tree of [`super::super::constants::clocks`].
pub(super) fn config() -> Config {
    let mut config = Config::default();
    config.rcc.hse = Some(Hse { freq: Hertz(HSE_HZ), mode: HseMode::Bypass });
    config.rcc.hsi = Some(rcc::HSIPrescaler::DIV1);
    config.rcc.csi = false;
    config.rcc.hsi48 = None;
    config.rcc.pll1 = Some(pll(&PLL1));
    config.rcc.pll3 = Some(pll(&PLL3));
    config.rcc.sys = Sysclk::PLL1_P;
    config.rcc.d1c_pre = AHBPrescaler::DIV1;
    config.rcc.ahb_pre = AHBPrescaler::DIV2;
    config.rcc.apb1_pre = APBPrescaler::DIV2;
    config.rcc.apb2_pre = APBPrescaler::DIV2;
    config.rcc.apb3_pre = APBPrescaler::DIV2;
    config.rcc.apb4_pre = APBPrescaler::DIV2;
    config.rcc.timer_prescaler = TimerPrescaler::DefaultX2;
    config.rcc.voltage_scale = VoltageScale::Scale1;
    // The watchdog starts its own oscillator; nothing else runs from a slow clock.
    config.rcc.ls = rcc::LsConfig::off();
    config.rcc.mux.fdcansel = rcc::mux::Fdcansel::PLL1_Q;
    config.rcc.mux.usbsel = rcc::mux::Usbsel::PLL3_Q;
    config.rcc.mux.usart234578sel = rcc::mux::Usart234578sel::PLL3_Q;
    config
}

const fn pll(pll: &PhaseLockedLoop) -> Pll {
    Pll {
        source: PllSource::HSE,
        prediv: PllPreDiv::from_bits(pll.input_divider as u8),
        mul: PllMul::from_bits(pll.multiplier as u16 - 1),
        fracn: None,
        divp: divider(pll.p),
        divq: divider(pll.q),
        divr: None,
    }
}

const fn divider(divider: Option<u32>) -> Option<PllDiv> {
    match divider {
        Some(divider) => Some(PllDiv::from_bits(divider as u8 - 1)),
        None => None,
    }
}

/// Applies the maker's errata at start-up: before revision V, reading the AXI memory while something else reads it
/// may give wrong data unless the matrix issues one read at a time.
pub(super) fn repair() {
    if revision() < REVISION_V {
        // SAFETY: a register of the AXI matrix, written once before anything else uses the memory concurrently.
        unsafe { AXI_MEMORY_READS.write_volatile(1) };
    }
}

/// The chip's revision (REV_ID): 0x1001 Z, 0x1003 Y and W, 0x2001 X, 0x2003 V.
pub(super) fn revision() -> u16 {
    embassy_stm32::pac::DBGMCU.idc().read().rev_id()
}
