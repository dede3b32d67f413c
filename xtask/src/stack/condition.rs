//! Instructions that are executed on a condition: those an IT stands in front of.

use std::collections::BTreeMap;

use crate::thumb::Instruction;

/// True if the next instructions are executed on a condition (IT).
pub(super) fn is_it(instruction: &Instruction) -> bool {
    let code = instruction.halves.0;
    instruction.bytes == 2 && code & 0xFF00 == 0xBF00 && code & 15 != 0
}

/// The condition that is true if another is not.
pub(super) fn opposite(condition: u16) -> u16 {
    condition ^ 1
}

/// The instructions an IT stands in front of, with their conditions.
pub(super) fn conditions(all: &[Instruction]) -> BTreeMap<usize, u16> {
    let mut found = BTreeMap::new();
    for (index, instruction) in all.iter().enumerate().filter(|(_, instruction)| is_it(instruction)) {
        let code = instruction.halves.0;
        let (first, length) = (code >> 4 & 15, 4 - (code & 15).trailing_zeros() as usize);
        // The lowest bit of the condition of every instruction but the first.
        let condition = |place: usize| if place == 0 { first } else { first & !1 | code >> (4 - place) & 1 };
        found.extend((0..length).map(|place| (index + 1 + place, condition(place))));
    }
    found
}
