//! The NUCLEO-H743ZI2 as the emulator steps it: the part, its message memory, its core.

use std::num::{NonZeroU32, NonZeroU64};
use std::path::Path;
use std::sync::Arc;

use rigless::cpu::armv7m::{Window as CoreWindow, windows};
use rigless::emulator::CoreSpec;
use rigless::image::Image as Placed;
use rigless::machine::{Board as Machine, Target, armv7m};
use rigless::mcu::{Mcu, Wired};
use rigless::snapshot::Store;
use rigless::soc::Window;

use crate::cache::MAINTENANCE;
use crate::can::{MESSAGE_MEMORY, MESSAGE_MEMORY_BYTES, MessageMemory};
use crate::core::Core;
use crate::part::{Fitting, Part};

/// Name of the only microcontroller.
const MCU: &str = "stm32h743";

/// The unique identifier of this chip, as the maker writes one into each.
pub const UNIQUE: [u32; 3] = [0x0030_0021, 0x5451_5105, 0x3233_3631];

/// Where it stands.
const UNIQUE_AT: u64 = 0x1FF1_E800;

/// Where the core starts: the boot pin is low.
const FLASH: u32 = 0x0800_0000;

/// The board.
#[derive(Debug)]
pub struct Board {
    /// The part with its message memory.
    pub mcu: Wired<Part, MessageMemory>,
    spec: CoreSpec,
}

/// A description that does not fit the crate's chip.
#[derive(Debug, thiserror::Error)]
pub enum BoardError {
    /// The chip's.
    #[error("the chip's description: {0}")]
    Chip(#[from] rigless::soc::Error),
    /// Memory that is placed before the run.
    #[error("the chip's factory memory: {0}")]
    Factory(#[from] rigless::image::Error),
}

impl Board {
    /// The board after power-up.
    ///
    /// # Errors
    /// [`BoardError`]: a flaw of this crate or of a new version of the chip's.
    pub fn new(fitting: &Fitting) -> Result<Self, BoardError> {
        let part = Part::new(fitting)?;
        let bytes = NonZeroU64::new(MESSAGE_MEMORY_BYTES).unwrap_or(NonZeroU64::MIN);
        let window = Window::new("FDCAN message memory", MESSAGE_MEMORY, bytes);
        let mcu = Wired::new(part, window, MessageMemory(fitting.can.clone()))?;
        let spec = core_of(&mcu, fitting)?;
        Ok(Self { mcu, spec })
    }
}

/// The core clock, which only the core's own timer counts.
const CORE_HZ: NonZeroU64 = NonZeroU64::new(400_000_000).expect("not zero");

/// A Cortex-M7 r1p1.
const CPUID: u32 = 0x411F_C271;

/// 16 KiB of instructions and of data in lines of 32 bytes.
const CACHES: armv7m::Caches =
    armv7m::Caches { clidr: 0x0900_0003, ctr: 0x8303_C003, ccsidr: &[0xF00F_E019, 0xF01F_E009] };

/// ITCMCR, DTCMCR, AHBPCR, CACR, AHBSCR, ABFSR: offset, value after a reset, writable bits.
const ACCESS_CONTROL: [(u64, u32, u32); 6] = [
    (0xF90, 0b0111 << 3, 0b111),
    (0xF94, 0b1000 << 3, 0b111),
    (0xF98, 0, 1),
    (0xF9C, 0, 0b111),
    (0xFA0, 1 << 11, 0xFFFF),
    (0xFA8, 0, 0),
];

/// The core of the chip, with our processor around the crate's.
fn core_of(mcu: &Wired<Part, MessageMemory>, fitting: &Fitting) -> Result<CoreSpec, BoardError> {
    let lines = u32::from(mcu.bus().cpu().interrupt_lines);
    let mut own = windows(mcu.bus());
    own.push(CoreWindow { base: u64::from(MAINTENANCE.start), size: u64::from(MAINTENANCE.end - MAINTENANCE.start) });
    let core = armv7m::Core {
        variant: armv7m::Variant::M7,
        clock_hz: CORE_HZ,
        interrupt_lines: NonZeroU32::new(lines).unwrap_or(NonZeroU32::MIN),
        priority_bits: 4,
        refclk_divider: NonZeroU32::new(8).unwrap_or(NonZeroU32::MIN),
        instructions_per_second: NonZeroU64::new(u64::from(fitting.mips) * 1_000_000).unwrap_or(NonZeroU64::MIN),
        boot: "flash",
    };
    let mut config = armv7m::Config::new(core, &own);
    config.fpu = armv7m::Fpu::FpV5Dp;
    config.mpu_regions = armv7m::MpuRegions::Sixteen;
    config.cpuid = CPUID;
    config.caches = Some(CACHES);
    config.branch_prediction = armv7m::BranchPrediction::Always;
    config.implementation_registers = ACCESS_CONTROL
        .iter()
        .map(|(offset, reset, writable)| armv7m::ImplementationRegister {
            offset: *offset,
            reset: *reset,
            writable: *writable,
        })
        .collect();
    config.vector_table = Some(FLASH);
    let mut spec = config.spec();
    let inner = spec.processor.clone();
    let shared = fitting.core.clone();
    spec.processor = Arc::new(move |endian| Ok(Box::new(Core::new(inner(endian)?, shared.clone()))));
    let unique = UNIQUE.iter().flat_map(|word| word.to_le_bytes()).collect();
    spec.factory_images = vec![Placed::new(Path::new("unique identifier"), unique, Some(UNIQUE_AT))?];
    Ok(spec)
}

impl Store for Board {}

impl Machine for Board {
    fn name(&self) -> &'static str {
        crate::image::BOARD
    }

    fn targets(&mut self) -> Vec<Target<'_>> {
        let spec = self.spec.clone();
        vec![Target::new(MCU, &mut self.mcu, spec)]
    }

    fn target_names(&self) -> Vec<&'static str> {
        vec![MCU]
    }

    fn mcu(&mut self, target: usize) -> Option<&mut dyn Mcu> {
        (target == 0).then_some(&mut self.mcu)
    }
}
