//! The boards the arm image is built for, and what each may cost.

use std::fmt;
use std::path::Path;

use anyhow::{Context, Result, ensure};

use crate::elf::{CORE_VECTORS, Section, Sizes};
use crate::stack::{Depth, START_PERCENT, share};

/// A board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Board {
    /// QEMU's mps2-an500.
    Mps2,
    /// NUCLEO-H743ZI2.
    Stm32h743,
}

/// A memory of a board, and the most an image may take of it.
struct Block {
    name: &'static str,
    start: u32,
    length: u32,
    budget: u32,
}

/// Which handler belongs to which line of the STM32H743.
const HANDLERS: [(usize, &str); 8] = [
    (28, "SLOT_TIMER"),
    (19, "CAN_RECEIVE"),
    (21, "FDCAN1_IT1"),
    (35, "CAN_TRANSMIT"),
    (36, "DISPATCH_SESSION"),
    (51, "DISPATCH_LOG"),
    (39, "USART3"),
    (101, "OTG_FS"),
];

/// Name of the stack in the table.
const STACK: &str = "DTCM, stack";

/// Name of the flash in the table.
const FLASH: &str = "flash, bank 1";

const KIB: u32 = 1024;

/// The memories of the STM32H743; budgets leave room for about half as much again as today.
const STM32H743: [Block; 6] = [
    Block { name: FLASH, start: 0x0800_0000, length: 1024 * KIB, budget: 448 * KIB },
    Block { name: "ITCM", start: 0x0000_0400, length: 63 * KIB, budget: 63 * KIB },
    Block { name: STACK, start: 0x2000_0000, length: 64 * KIB, budget: share(64 * KIB, START_PERCENT) },
    Block { name: "DTCM, data", start: 0x2001_0000, length: 60 * KIB, budget: 60 * KIB },
    Block { name: "AXI", start: 0x2400_0000, length: 384 * KIB, budget: 288 * KIB },
    Block { name: "AXI, kept", start: 0x2406_0000, length: 128 * KIB, budget: 96 * KIB },
];

impl Board {
    /// Every board.
    pub(crate) const ALL: [Self; 2] = [Self::Mps2, Self::Stm32h743];

    /// Name for `--board`.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Mps2 => "mps2",
            Self::Stm32h743 => "stm32h743",
        }
    }

    /// The board of a word.
    pub(crate) fn from_name(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|board| board.name() == word)
    }

    /// Features of the package `firmware`, without the default ones.
    pub(crate) const fn features(self, may_sleep: bool) -> &'static str {
        match (self, may_sleep) {
            (Self::Mps2, true) => "board-mps2,wfi",
            (Self::Mps2, false) => "board-mps2",
            // A real core sleeps at no cost to its timers.
            (Self::Stm32h743, _) => "board-stm32h743",
        }
    }

    /// Level at which the image is optimised.
    ///
    /// At 3 the control slot of a run does not fit the real board's memory that is never waited for; at "s" it takes
    /// 3.4 times the instructions (docs/decisions/0021-four-hundred-megahertz.md). Not a profile of its own: all macros
    /// and build scripts would be built once more for it.
    pub(crate) const fn level(self) -> &'static str {
        match self {
            Self::Mps2 => "profile.firmware.opt-level=3",
            Self::Stm32h743 => "profile.firmware.opt-level=2",
        }
    }

    /// File name of the image beside the tools.
    pub(crate) const fn file(self) -> &'static str {
        match self {
            Self::Mps2 => "arm.elf",
            Self::Stm32h743 => "arm-stm32h743.elf",
        }
    }
}

impl fmt::Display for Board {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Mps2 => "QEMU's mps2-an500",
            Self::Stm32h743 => "the STM32H743 (NUCLEO-H743ZI2)",
        })
    }
}

/// Prints what the image takes of each memory of the STM32H743, and fails if it is more than budgeted.
pub(crate) fn print_sizes(image: &Path) -> Result<()> {
    let sizes = Sizes::of(image)?;
    let depth = Depth::of(image)?;
    println!("{:<16} {:>9} {:>9} {:>9}  sections", "memory", "used B", "budget B", "there B");
    let mut over = Vec::new();
    for block in &STM32H743 {
        let (used, what) = if block.name == STACK {
            (depth.at_start().max(depth.in_service()), depth.summary())
        } else {
            let inside = |section: &&Section| section.lies_in(block.start, block.length);
            let sections: Vec<&Section> = sizes.sections().iter().filter(inside).collect();
            // What start-up copies elsewhere is kept in the flash as well.
            let here = sections.iter().map(|section| section.bytes()).sum();
            let used = if block.name == FLASH { sizes.flash() } else { here };
            let names: Vec<&str> = sections.iter().map(|section| section.name()).collect();
            (used, names.join(" "))
        };
        println!("{:<16} {used:>9} {:>9} {:>9}  {what}", block.name, block.budget, block.length);
        if used > block.budget {
            over.push(format!("{} takes {used} B, more than {}", block.name, block.budget));
        }
    }
    let stray = sizes
        .sections()
        .iter()
        .find(|section| !STM32H743.iter().any(|block| section.lies_in(block.start, block.length)));
    if let Some(section) = stray {
        over.push(format!("section {} at {:#010x} lies in no memory of the board", section.name(), section.address()));
    }
    ensure!(over.is_empty(), "over budget: {}", over.join("; "));
    check_layout(&sizes)
}

/// The chip's interrupt lines by the handler that must stand there, and memory the start-up code clears and copies:
/// what the linker script says in the chip's words, seen in the image it made.
fn check_layout(sizes: &Sizes) -> Result<()> {
    let stack = STM32H743.iter().find(|block| block.name == STACK).context("no stack in the table")?;
    let top = *sizes.vectors().first().context("the image has no vector table")?;
    ensure!(top == stack.start + stack.length, "the stack begins at {top:#010x}, not at the end of its memory");
    for (line, handler) in HANDLERS {
        let address = sizes.symbol(handler).with_context(|| format!("the image has no handler {handler}"))?;
        let vector = sizes.vectors().get(CORE_VECTORS + line).copied();
        ensure!(
            vector.map(|vector| vector | 1) == Some(address | 1),
            "line {line} of the vector table holds {vector:x?}, not {handler} ({address:#010x})"
        );
    }
    for (section, from, until) in [(".bss", "__sbss", "__ebss"), (".data", "__sdata", "__edata")] {
        let section = sizes.sections().iter().find(|found| found.name() == section).context("a section is missing")?;
        let (first, end) = (sizes.symbol(from), sizes.symbol(until));
        let length = first.zip(end).and_then(|(first, end)| end.checked_sub(first));
        ensure!(
            first == Some(section.address()) && length.is_some_and(|length| length.abs_diff(section.bytes()) < 8),
            "start-up would take {first:x?} to {end:x?} for {}",
            section.name()
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::{Board, STM32H743};

    #[test]
    fn budgets_are_no_larger_than_the_memories() {
        for block in &STM32H743 {
            assert!(block.budget <= block.length, "{}", block.name);
        }
    }

    #[test]
    fn every_board_is_found_by_its_word() {
        for board in Board::ALL {
            assert_eq!(Board::from_name(board.name()), Some(board));
        }
        assert_eq!(Board::from_name("arduino"), None);
    }
}
