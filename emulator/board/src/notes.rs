//! Notes of the core: accesses to where nothing is, and faults whose handlers have begun.

use crate::image::Image;

/// An access to an address where nothing is: a bus fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stray {
    /// Where to.
    pub address: u32,
    /// Where the program was.
    pub program_counter: u32,
    /// When, ns.
    pub at: u64,
}

/// State that the handler of a fault finds when it begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaultNote {
    /// When, ns.
    pub at: u64,
    /// Number of the exception: 3 hard fault, 4 memory management, 5 bus, 6 usage.
    pub exception: u32,
    /// The stack pointer.
    pub stack: u32,
    /// CFSR, HFSR, MMFAR, BFAR.
    pub configurable: u32,
    /// See above.
    pub hard: u32,
    /// See above.
    pub memory_address: u32,
    /// See above.
    pub bus_address: u32,
}

impl FaultNote {
    /// One line for people.
    #[must_use]
    pub fn line(&self, image: &Image) -> String {
        let name = match self.exception {
            2 => "non-maskable interrupt",
            3 => "hard fault",
            4 => "memory management fault",
            5 => "bus fault",
            6 => "usage fault",
            _ => "unexpected exception",
        };
        let place = if self.stack < image.stack.start {
            let below = image.stack.start - self.stack;
            format!(", {below} bytes below the stack, which ends at {:#010x}", image.stack.start)
        } else {
            String::new()
        };
        format!(
            "{name} at {} us: SP {:#010x}{place}; CFSR {:#010x}, HFSR {:#010x}, MMFAR {:#010x}, BFAR {:#010x}",
            self.at / 1000,
            self.stack,
            self.configurable,
            self.hard,
            self.memory_address,
            self.bus_address
        )
    }
}
