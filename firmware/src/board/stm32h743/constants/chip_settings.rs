//! Registers of the chip that keep what the start has written, and would keep a bit that falls over as well.
//!
//! Addresses: RM0433, chapter 2.3.2 and the registers of each peripheral; those of the processor: ARM DDI 0403.

/// A register, and the bits of it that stay as they are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Its address.
    pub address: u32,
    /// Bits that are compared.
    pub mask: u32,
}

const fn all(address: u32) -> Place {
    some(address, u32::MAX)
}

const fn some(address: u32, mask: u32) -> Place {
    Place { address, mask }
}

/// In DBGMCU.APB4FZ1: the watchdog stands still while a debugger halts the core.
pub const STANDS_IN_A_HALT: u32 = 1 << 18;

/// In RCC.CSR: the oscillator of the watchdog is ready (LSIRDY).
const WATCHDOG_CLOCK: u32 = 1 << 1;

/// PWR.CR3 without the bit that tells whether the supply of USB is there (USB33RDY): a cable is no reason to end.
const WITHOUT_USB_SUPPLY: u32 = !(1 << 26);

/// USART3.CR3 without the interrupt for room to send, which comes and goes.
const WITHOUT_ROOM_TO_SEND: u32 = !(1 << 23);

/// First two words of the interrupt controller's enables: FDCAN1 (21), TIM2 (28), SPI1 (35), SPI2 (36), SPI3 (51). The
/// lines of the host and of received frames come and go.
const ENABLED: [u32; 2] = [1 << 21 | 1 << 28, 1 << 3 | 1 << 4 | 1 << 19];

/// The system handlers' control: the memory fault has a handler. Other bits tell which handler runs.
const MEMORY_FAULT: u32 = 1 << 16;

/// Places that are looked at.
pub const PLACES: [Place; 51] = [
    // RCC: CR with the locks of the loops, CFGR.
    all(0x5802_4400),
    all(0x5802_4410),
    // D1CFGR, D2CFGR, D3CFGR.
    all(0x5802_4418),
    all(0x5802_441C),
    all(0x5802_4420),
    // PLLCKSELR, PLLCFGR, PLL1DIVR, PLL3DIVR.
    all(0x5802_4428),
    all(0x5802_442C),
    all(0x5802_4430),
    all(0x5802_4440),
    // D2CCIP1R, D2CCIP2R: sources of the clocks of CAN, serial line and USB.
    all(0x5802_4450),
    all(0x5802_4454),
    // AHB1ENR, AHB4ENR, APB1LENR, APB1HENR.
    all(0x5802_44D8),
    all(0x5802_44E0),
    all(0x5802_44E8),
    all(0x5802_44EC),
    // PWR: CR3, D3CR, supply of the core.
    some(0x5802_480C, WITHOUT_USB_SUPPLY),
    all(0x5802_4818),
    // FLASH.ACR: wait states.
    all(0x5200_2000),
    // TIM2, the slots: CR1, DIER, PSC, ARR.
    all(0x4000_0000),
    all(0x4000_000C),
    all(0x4000_0028),
    all(0x4000_002C),
    // TIM5, the time: PSC, ARR. That it runs is seen in every slot.
    all(0x4000_0C28),
    all(0x4000_0C2C),
    // RCC.CSR: the watchdog's oscillator runs. IWDG1: PR, RLR.
    some(0x5802_4474, WATCHDOG_CLOCK),
    all(0x5800_4804),
    all(0x5800_4808),
    some(0x5C00_1054, STANDS_IN_A_HALT),
    // GPIOA, GPIOB and GPIOD: MODER and what the pins in use have of OTYPER, AFRL, AFRH.
    all(0x5802_0000),
    all(0x5802_0024),
    all(0x5802_0400),
    all(0x5802_0420),
    all(0x5802_0C00),
    all(0x5802_0C04),
    all(0x5802_0C20),
    all(0x5802_0C24),
    // USART3: CR1, CR3, BRR.
    all(0x4000_4800),
    some(0x4000_4808, WITHOUT_ROOM_TO_SEND),
    all(0x4000_480C),
    // NVIC: ISER0, ISER1; priorities of FDCAN1, TIM2, the lines of software and the serial line.
    some(0xE000_E100, ENABLED[0]),
    some(0xE000_E104, ENABLED[1]),
    all(0xE000_E410),
    all(0xE000_E414),
    all(0xE000_E41C),
    all(0xE000_E420),
    all(0xE000_E424),
    all(0xE000_E430),
    // SCB: VTOR, CCR with the caches, SHCSR; MPU_CTRL.
    all(0xE000_ED08),
    all(0xE000_ED14),
    some(0xE000_ED24, MEMORY_FAULT),
    all(0xE000_ED94),
];
