//! Which handlers may interrupt which, for every board; the image sets these priorities at run time, and its code is
//! held against this table.
//!
//! Handlers of one level never interrupt each other, those of a higher level (a larger number) interrupt those of a
//! lower one. Level 0 is the idle task.

use std::collections::BTreeMap;

use anyhow::{Context, Result, ensure};

use super::depth::Calls;
use crate::elf::CORE_VECTORS;

/// Handlers of one priority.
pub(super) struct Level {
    /// Logical priority.
    pub(super) priority: u32,
    /// Names of the handlers.
    pub(super) handlers: &'static [&'static str],
}

/// Another stack than the one everything runs on.
pub(super) struct OtherStack {
    /// Symbol of its upper end.
    pub(super) top: &'static str,
    /// Its size.
    pub(super) bytes: u32,
    /// The handlers that take it. None of them returns, so each begins at its upper end.
    pub(super) handlers: &'static [&'static str],
}

/// The interrupt levels of a board, and the memory below its stack.
pub(super) struct Layout {
    /// Name of the board in the image's description.
    pub(super) board: &'static str,
    /// Bytes the processor puts on the stack for an exception, at most: eight words, with floating point 18 more, and
    /// one to align them.
    pub(super) exception: u32,
    /// The levels, the lowest first.
    pub(super) levels: &'static [Level],
    /// Handlers that never return and mask everything first.
    pub(super) ends: &'static [&'static str],
    /// A stack of its own for one of them.
    pub(super) other: Option<OtherStack>,
    /// Bytes below the stack that fault when they are touched.
    pub(super) guard: Option<u32>,
}

const fn level(priority: u32, handlers: &'static [&'static str]) -> Level {
    Level { priority, handlers }
}

/// Exceptions on a processor with floating point.
const EXTENDED: u32 = 4 * (8 + 18 + 1);
/// Exceptions on one without.
const BASIC: u32 = 4 * (8 + 1);

/// Faults and what nobody serves.
const ENDS: &[&str] = &["NonMaskableInt", "DefaultHandler"];
/// The same where a hard fault has no stack of its own.
const ENDS_AND_HARD_FAULT: &[&str] = &["HardFault", "NonMaskableInt", "DefaultHandler"];

const LOG: Level = level(1, &["DISPATCH_LOG"]);
const SESSION: Level = level(2, &["DISPATCH_SESSION"]);
const BUS: Level = level(10, &["CAN_RECEIVE", "CAN_TRANSMIT"]);
const SLOT: Level = level(12, &["SLOT_TIMER"]);

/// Every board.
const LAYOUTS: [Layout; 3] = [
    Layout {
        board: "nucleo-h743zi2",
        exception: EXTENDED,
        levels: &[LOG, SESSION, level(3, &["OTG_FS"]), BUS, SLOT, level(13, &["USART3"]), level(14, &["FDCAN1_IT1"])],
        ends: ENDS,
        other: Some(OtherStack { top: "__emergency_stack", bytes: 4096, handlers: &["MemoryManagement", "HardFault"] }),
        guard: Some(64 * 1024),
    },
    Layout {
        board: "mps2-an500",
        exception: EXTENDED,
        levels: &[LOG, SESSION, BUS, SLOT, level(14, &["BUS_WIRE"])],
        ends: ENDS_AND_HARD_FAULT,
        other: None,
        guard: None,
    },
    Layout {
        board: "mps2-an385",
        exception: BASIC,
        levels: &[SESSION, BUS, SLOT, level(14, &["BUS_WIRE"])],
        ends: ENDS_AND_HARD_FAULT,
        other: None,
        guard: None,
    },
];

impl Layout {
    /// The layout of the board an image says it is for.
    ///
    /// # Errors
    /// If no board has this name.
    pub(super) fn of(board: &str) -> Result<&'static Self> {
        let known = LAYOUTS.iter().find(|layout| layout.board == board);
        known.with_context(|| format!("no priorities are known for the board '{board}' (xtask/src/stack/levels.rs)"))
    }

    /// Fails if a handler in the vector table is not in this table, or the other way round, or if the image gives it
    /// another priority: `stored` has those by line.
    pub(super) fn check(&self, calls: &Calls, vectors: &[u32], stored: &BTreeMap<u32, u32>) -> Result<()> {
        let listed = || {
            let levels = self.levels.iter().flat_map(|level| level.handlers);
            levels.chain(self.ends).chain(self.other.iter().flat_map(|other| other.handlers)).copied()
        };
        // Behind the stack's beginning and where the image begins.
        for (line, vector) in vectors.iter().enumerate().skip(2).filter(|(_, vector)| **vector != 0) {
            let address = vector & !1;
            let known = listed().any(|handler| calls.address(handler).is_ok_and(|known| known == address));
            ensure!(
                known,
                "{}, entry {line} of the vector table, has no priority in xtask/src/stack/levels.rs",
                calls.name(address)
            );
        }
        for handler in listed().filter(|handler| !self.ends.contains(handler)) {
            let address = calls.address(handler)?;
            ensure!(vectors.iter().any(|vector| vector & !1 == address), "{handler} is not in the vector table");
        }
        for level in self.levels {
            for handler in level.handlers {
                let address = calls.address(handler)?;
                let lines = vectors.iter().skip(CORE_VECTORS).zip(0..);
                let lines = lines.filter(|(vector, _)| **vector & !1 == address).map(|(_, line)| line);
                for line in lines {
                    let found = stored.get(&line).copied();
                    let said = found.map_or("none that can be read".to_owned(), |found| found.to_string());
                    ensure!(
                        found == Some(level.priority),
                        "{handler} has priority {} in xtask/src/stack/levels.rs, but {said} in the image",
                        level.priority
                    );
                }
            }
        }
        Ok(())
    }
}
