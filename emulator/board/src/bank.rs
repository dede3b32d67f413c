//! Operations of bank 2 as they are asked for, and power that fails in one of them.

use rigless::emulator::{Access, AccessKind, Host};
use rigless::soc::Width;

use crate::cache::BANK;

/// Address of FLASH.CR2.
const CONTROL: u64 = 0x5200_210C;
/// Its bits.
const SECTOR_ERASE: u64 = 1 << 2;
const START: u64 = 1 << 7;

/// Bytes of a flash word and of a sector.
const WORD: u64 = 32;
const SECTOR: u64 = 128 * 1024;

/// An operation that was begun.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Operation {
    /// A word is programmed.
    Word {
        /// Where.
        address: u64,
        /// With what.
        words: Vec<u32>,
    },
    /// A sector is erased.
    Erase {
        /// Its first address.
        address: u64,
    },
}

/// Watches the accesses for operations.
#[derive(Debug, Default)]
pub struct BankWatch {
    pending: Vec<(u64, u32)>,
    /// Operations begun so far.
    pub operations: u64,
}

impl BankWatch {
    /// Looks at an access of the core; an operation, if this begins one.
    pub fn see(&mut self, access: &Access) -> Option<Operation> {
        if access.kind != AccessKind::Write {
            return None;
        }
        if (u64::from(BANK.start)..u64::from(BANK.end)).contains(&access.address) {
            let word = access.address & !(WORD - 1);
            if self.pending.first().is_some_and(|(first, _)| first & !(WORD - 1) != word) {
                self.pending.clear();
            }
            self.pending.push((access.address, access.value as u32));
            if self.pending.len() < WORD as usize / 4 {
                return None;
            }
            let words = std::mem::take(&mut self.pending).into_iter().map(|(_, value)| value).collect();
            self.operations += 1;
            return Some(Operation::Word { address: word, words });
        }
        if access.address == CONTROL && access.value & (SECTOR_ERASE | START) == SECTOR_ERASE | START {
            self.operations += 1;
            return Some(Operation::Erase { address: u64::from(BANK.start) + (access.value >> 8 & 7) * SECTOR });
        }
        None
    }
}

/// True if an access waits for as long as an operation of bank 2 runs: to the bank, and to its control register, which
/// takes nothing meanwhile. [assumed: the manual of the chip before this one says it of the register]
pub fn stalls(access: &Access) -> bool {
    let is_bank = (u64::from(BANK.start)..u64::from(BANK.end)).contains(&access.address);
    is_bank || access.address == CONTROL && access.kind == AccessKind::Write
}

/// Leaves an operation half done: bits on their way are where chance has them. The words whose check bits cannot fit.
pub fn tear(operation: &Operation, seed: u64, host: &mut dyn Host) -> Vec<u32> {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut random = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state as u32
    };
    let put = |host: &mut dyn Host, address: u64, value: u32| {
        // Outside bank 2 there is nothing to tear.
        let _ = host.program(address, Width::W32, u64::from(value));
    };
    match operation {
        Operation::Word { address, words } => {
            for (word, at) in words.iter().zip((*address..).step_by(4)) {
                put(host, at, word | random());
            }
            vec![*address as u32]
        }
        Operation::Erase { address } => {
            let mut damaged = Vec::new();
            for at in (*address..*address + SECTOR).step_by(4) {
                let before = host.read(at, Width::W32).unwrap_or(0) as u32;
                let after = before | random();
                put(host, at, after);
                if after != before && after != u32::MAX && !damaged.contains(&(at as u32 & !31)) {
                    damaged.push(at as u32 & !31);
                }
            }
            damaged
        }
    }
}
