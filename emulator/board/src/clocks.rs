//! The clock tree as the image set it up, and the rules about it that the crate's model does not tell.

use rigless::device::RegisterFile;
use rigless::mcu::Mcu;
use rigless::soc::stm32h743::generated::{flash, pwr, rcc, tim2, usart1};
use rigless::soc::stm32h743::peripherals::rcc::{Apb, Kernel, Rcc, TimerBus};
use serde_json::{Value, json};

use crate::part::{HSE_HZ, Part};

/// Rates in Hz and the registers that make them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Clocks {
    /// The core.
    pub core: u64,
    /// AHB, AXI and flash.
    pub ahb: u64,
    /// APB 1.
    pub apb: u64,
    /// The timers on APB 1.
    pub timer: u64,
    /// The CAN controllers' kernel clock.
    pub can: u64,
    /// The USB controllers' kernel clock.
    pub usb: u64,
    /// The serial line's kernel clock.
    pub serial: u64,
    /// The slot timer's overflows, micro-Hz.
    pub slot_micro_hz: u64,
    /// PWR.D3CR.
    pub power: u64,
    /// FLASH.ACR.
    pub flash: u64,
}

impl Clocks {
    /// As they are now.
    pub fn of(part: &mut Part) -> Self {
        let values = |part: &Part, name: &str| part.bus().registers(name).cloned();
        let (Some(timer), Some(power), Some(flash_registers)) =
            (values(part, "TIM2"), values(part, "PWR"), values(part, "Flash"))
        else {
            return Self::default();
        };
        let (tree, registers) = part.chip.clocks();
        let (tree, registers): (&Rcc, &RegisterFile) = (tree, registers);
        let timer_hz = tree.timer_clock(registers, TimerBus::Apb1);
        let period = (timer.get(tim2::Register::Psc) + 1) * (timer.get(tim2::Register::Arr) + 1);
        Self {
            core: tree.cpu_clock(registers),
            ahb: tree.hclk(registers),
            apb: tree.pclk(registers, Apb::One),
            timer: timer_hz,
            can: tree.kernel_clock(registers, Kernel::Fdcan),
            usb: tree.kernel_clock(registers, Kernel::Usb),
            serial: tree.kernel_clock(registers, Kernel::Usart234578),
            slot_micro_hz: timer_hz * 1_000_000 / period.max(1),
            power: power.get(pwr::Register::D3cr),
            flash: flash_registers.get(flash::Register::Acr),
        }
    }

    /// Bits per second of the serial line as its registers make them; 0 while it is off.
    #[must_use]
    pub fn baud(&self, part: &Part) -> u64 {
        let Some(registers) = part.bus().registers("USART3") else { return 0 };
        let divider = registers.get(usart1::Register::Brr);
        // With eight samples a bit the lowest four bits of the divider stand one place lower (RM0433 48.5.7).
        let (clock, divider) = if registers.get(usart1::Register::Cr1) & 1 << 15 != 0 {
            (2 * self.serial, (divider & !0xF) | (divider & 7) << 1)
        } else {
            (self.serial, divider)
        };
        clock.checked_div(divider).unwrap_or(0)
    }

    /// For the report.
    #[must_use]
    pub fn json(&self) -> Value {
        json!({
            "core": self.core,
            "ahb": self.ahb,
            "apb": self.apb,
            "timer": self.timer,
            "can_kernel": self.can,
            "usb": self.usb,
            "serial_kernel": self.serial,
        })
    }
}

/// Bits of RCC.CR that switch the loops on, and where each loop's bits begin in PLLCKSELR and PLLCFGR.
const LOOPS: [(&str, u64, u32, u32); 3] = [("PLL1", 1 << 24, 4, 0), ("PLL2", 1 << 26, 12, 4), ("PLL3", 1 << 28, 20, 8)];

/// Faults of the loops that `written`, a value for RCC.CR, switches on and `before` had off: a reference
/// outside what the chosen oscillator takes (DS12110 tables 137 and 138: the medium one 1 to 2 MHz, the wide one 2 to
/// 16 MHz).
#[must_use]
pub fn loop_flaws(registers: &RegisterFile, before: u64, written: u64) -> Vec<(&'static str, String)> {
    let (selection, configuration) = (registers.get(rcc::Register::Pllckselr), registers.get(rcc::Register::Pllcfgr));
    let source = match selection & 3 {
        0 => 64_000_000,
        1 => 4_000_000,
        2 => HSE_HZ,
        _ => 0,
    };
    let mut flaws = Vec::new();
    for (name, on, divider_at, configuration_at) in LOOPS {
        let divider = selection >> divider_at & 0x3F;
        if written & on == 0 || before & on != 0 || divider == 0 {
            continue;
        }
        let reference = source / divider;
        let is_medium = configuration >> (configuration_at + 1) & 1 == 1;
        let (kind, low, high) =
            if is_medium { ("medium", 1_000_000, 2_000_000) } else { ("wide", 2_000_000, 16_000_000) };
        if !(low..=high).contains(&reference) {
            let text = format!(
                "the {kind} oscillator takes a reference of {low} to {high} Hz (DS12110 tables 137, 138; \
                 RM0433 8.5.5), and is given {reference} Hz: out of range, it may never lock"
            );
            flaws.push((name, text));
        }
    }
    flaws
}
