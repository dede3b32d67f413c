//! The clock tree: 8 MHz from the debug probe's crystal to 400 MHz for the core, 80 MHz for CAN and 48 MHz for USB.
//!
//! ```text
//! HSE 8 MHz ─┬─ PLL1: / 1 × 100 = 800 MHz ─┬─ / 2 ─ 400 MHz core ─ / 2 ─ 200 MHz AHB ─ / 2 ─ 100 MHz APB 1..4
//! (ST-LINK)  │                             │                                        └─ × 2 ─ 200 MHz timers
//!            │                             └─ / 10 ─ 80 MHz FDCAN
//!            └─ PLL3: / 1 × 96 = 768 MHz ─── / 16 ─ 48 MHz USB and the serial line
//! ```

/// Input of all phase-locked loops, Hz: the ST-LINK on the board drives its 8 MHz crystal into HSE (bypass). If it were
/// wrong every rate below would be wrong by the same factor: bus, line and control.
pub const HSE_HZ: u32 = 8_000_000;

/// The chip's own RC oscillator, from which everything runs until the clock tree is set up, Hz; 1 % off at room
/// temperature, so the bus cannot be driven by it.
pub const HSI_HZ: u32 = 64_000_000;

/// Longest wait for HSE before the light begins to blink, us: a clock that is there is ready within microseconds.
pub const HSE_SOON_US: u32 = 2_000;

/// Longest further wait before motors are told by the chip's own oscillator to let go, us: a crystal oscillator, which
/// this board has not, would be ready by then.
pub const HSE_LATE_US: u32 = 2_000;

/// Half a period of that blinking, us: 10 Hz, which nobody takes for the steady light of torque.
pub const HSE_BLINK_US: u32 = 50_000;

/// Times the light is switched before the image gives up and starts again: 300 ms. The ST-LINK starts together with the
/// chip and gives its clock when it has started itself.
pub const HSE_BLINKS: u32 = 6;

/// A phase-locked loop: `input / input_divider × multiplier / output_divider`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PhaseLockedLoop {
    /// Divider of the input (DIVM).
    pub input_divider: u32,
    /// Multiplier of the oscillator (DIVN).
    pub multiplier: u32,
    /// Divider of output P, if it is used.
    pub p: Option<u32>,
    /// Divider of output Q, if it is used.
    pub q: Option<u32>,
}

impl PhaseLockedLoop {
    /// Frequency at which the loop compares, Hz. The wide oscillator wants 2 to 16 MHz, the medium one 1 to 2 MHz.
    #[must_use]
    pub const fn comparison_hz(&self) -> u32 {
        HSE_HZ / self.input_divider
    }

    /// Frequency of its oscillator, Hz; 192 to 836 MHz for the wide one.
    #[must_use]
    pub const fn oscillator_hz(&self) -> u32 {
        self.comparison_hz() * self.multiplier
    }
}

/// embassy-stm32 takes the medium oscillator (150 to 420 MHz) for every frequency up to this one, Hz. That oscillator
/// wants a comparison at 1 to 2 MHz, and these loops compare at 8 MHz: one that stays below this may never lock, and
/// the start-up would wait for it for ever.
pub const MEDIUM_OSCILLATOR_HZ_LIMIT: u32 = 420_000_000;

/// Clock of processor and CAN.
pub const PLL1: PhaseLockedLoop = PhaseLockedLoop { input_divider: 1, multiplier: 100, p: Some(2), q: Some(10) };

/// USB and the serial line.
pub const PLL3: PhaseLockedLoop = PhaseLockedLoop { input_divider: 1, multiplier: 96, p: None, q: Some(16) };

/// Clock of the CAN controller when the 8 MHz have failed, from the chip's own oscillator: 64 / 8 × 40 / 8 = 40 MHz,
/// below the bus clock, which is that oscillator's then.
pub const PLL1_OF_HSI: PhaseLockedLoop = PhaseLockedLoop { input_divider: 8, multiplier: 40, p: None, q: Some(8) };

/// Longest wait for that loop to lock, us: ten times what the maker gives.
pub const LOCK_US: u32 = 1_000;

/// The divided output, Hz; 0 where the output is off.
const fn output(pll: &PhaseLockedLoop, divider: Option<u32>) -> u32 {
    match divider {
        Some(divider) => pll.oscillator_hz() / divider,
        None => 0,
    }
}

/// Clock of the processor, Hz. 400 MHz is the most at voltage scale 1, which every revision of the chip has: 480 MHz
/// needs scale 0 and revision V. The control slot has 444 000 cycles at 400 MHz and needs a tenth of that.
pub const CORE_HZ: u32 = output(&PLL1, PLL1.p);

/// The most at voltage scale 1, Hz.
pub const CORE_HZ_LIMIT: u32 = 400_000_000;

/// Divider from the core to the bus matrix, flash and AXI memory.
pub const AHB_DIVIDER: u32 = 2;

/// Clock of the bus matrix, Hz; at most 200 MHz at voltage scale 1.
pub const AHB_HZ: u32 = CORE_HZ / AHB_DIVIDER;

/// Divider from the bus matrix to all four peripheral buses.
pub const APB_DIVIDER: u32 = 2;

/// Clock of the peripheral buses, Hz; at most 100 MHz at voltage scale 1.
pub const APB_HZ: u32 = AHB_HZ / APB_DIVIDER;

/// Clock of the timers, Hz: twice that of a divided peripheral bus.
pub const TIMER_HZ: u32 = 2 * APB_HZ;

/// Kernel clock of both CAN controllers, Hz. Must not exceed [`APB_HZ`], and must hold a whole number of time quanta.
pub const CAN_HZ: u32 = output(&PLL1, PLL1.q);

/// Clock of the USB device, Hz: 48 MHz within 0.25 %, so from the crystal and not from an RC oscillator.
pub const USB_HZ: u32 = output(&PLL3, PLL3.q);

/// Kernel clock of the serial line to the ST-LINK, Hz: 48 MHz / 52 comes nearer to [`super::lines::BAUD`] than any
/// whole fraction of [`APB_HZ`].
pub const UART_HZ: u32 = output(&PLL3, PLL3.q);

/// The watchdog's own RC oscillator, Hz, nominal.
pub const LSI_HZ: u32 = 32_000;

/// Most that oscillator is off, in percent, over temperature and supply.
pub const LSI_TOLERANCE_PERCENT: u32 = 7;
