//! The memory map: code in bank 1 of the flash and in ITCM, stack and the control half in DTCM, the rest in AXI
//! memory, the primitives in bank 2. `firmware/memory/stm32h743.x` says the same to the linker; a test compares the
//! two.

/// A stretch of the address space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    /// Address of the first byte.
    pub start: u32,
    /// Bytes.
    pub length: u32,
}

impl Region {
    /// Address of the first byte behind it.
    #[must_use]
    pub const fn end(&self) -> u32 {
        self.start + self.length
    }

    /// True if both share a byte.
    #[must_use]
    pub const fn overlaps(&self, other: &Self) -> bool {
        self.start < other.end() && other.start < self.end()
    }
}

/// Bank 1: the image. Erased and written by the debug probe only.
pub const IMAGE: Region = Region { start: 0x0800_0000, length: 1024 * 1024 };

/// Bank 2: the primitives. Erased and written by the running image only; flashing an image must leave it alone.
pub const STORE: Region = Region { start: 0x0810_0000, length: 1024 * 1024 };

/// Bytes that are erased at a time, the sectors of both banks.
pub const SECTOR_BYTES: u32 = 128 * 1024;

/// Bytes that are written at a time, once each between erasures: a flash word with its check bits.
pub const FLASH_WORD_BYTES: u32 = 32;

/// Longest wait for a flash word to be written, us: a hundred times what the maker gives at this width (0.2 ms).
pub const WRITE_US: u32 = 20_000;

/// Longest wait for a sector to be erased, us: five times what the maker gives at this width (2 s). A worn sector takes
/// its time; the host gives up after 15 s.
pub const ERASE_US: u32 = 10_000_000;

/// All of the tightly coupled code memory.
pub const ITCM: Region = Region { start: 0, length: 64 * 1024 };

/// Its first bytes hold nothing and may not be touched, so that a null pointer is noticed.
pub const NULL_GUARD: Region = Region { start: 0, length: 1024 };

/// The rest of it: the code of the control cycle.
pub const HOT_CODE: Region = Region { start: 0x400, length: 63 * 1024 };

/// All of the tightly coupled data memory.
pub const DTCM: Region = Region { start: 0x2000_0000, length: 128 * 1024 };

/// Addresses below the stack that may not be touched: whoever gets here has overflowed the stack. There is no memory,
/// so the guard costs nothing, and it is as long as the stack itself: no frame that fits into the stack can step over
/// it.
pub const STACK_GUARD: Region = Region { start: 0x1FFF_0000, length: 64 * 1024 };

/// The stack of all tasks and interrupts, growing down to the first byte of the DTCM: never cached, never waited for.
pub const STACK: Region = Region { start: 0x2000_0000, length: 64 * 1024 };

/// The control half, what the tasks own, the log's buffer and the last words.
pub const HOT_DATA: Region = Region { start: 0x2001_0000, length: 60 * 1024 };

/// Stack of the handler that runs when the other stack has overflowed.
pub const EMERGENCY_STACK: Region = Region { start: 0x2001_F000, length: 4 * 1024 };

/// All of the AXI memory.
pub const AXI: Region = Region { start: 0x2400_0000, length: 512 * 1024 };

/// Initialised and zeroed data: the session, the library, queues. Cached; no peripheral reads it by itself.
pub const DATA: Region = Region { start: 0x2400_0000, length: 384 * 1024 };

/// The last second before a fault, kept over a restart. Not cached: a reset loses what only the cache holds.
pub const RETAINED: Region = Region { start: 0x2406_0000, length: 128 * 1024 };

/// Addresses of external memory, of which the board has none. The default map calls them normal memory, which this
/// processor reads ahead in: at a controller that has no clock such a read may never end.
pub const EXTERNAL: [Region; 2] = [
    Region { start: 0x6000_0000, length: 512 * 1024 * 1024 },
    Region { start: 0x8000_0000, length: 512 * 1024 * 1024 },
];
