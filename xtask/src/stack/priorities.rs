//! The priorities an image gives its interrupts: the bytes its code stores in the interrupt controller's registers.

use std::collections::BTreeMap;

use super::memory::Memory;
use super::step::{self, Source};
use crate::code::{Code, Function};
use crate::thumb::{Flow, Instruction};

/// The interrupt controller's priorities: a byte for every line.
const REGISTERS: std::ops::Range<u32> = 0xE000_E400..0xE000_E4F0;

/// Priority levels are the upper bits of a byte: this many.
const BITS: u32 = 4;

/// Logical priorities by line, as constant code stores them. A priority that is computed, or stored through a table, is
/// not seen.
pub(super) fn stored(code: &Code, memory: &Memory) -> BTreeMap<u32, u32> {
    code.functions().flat_map(|(_, function)| stores(function, memory)).collect()
}

fn stores(function: &Function, memory: &Memory) -> Vec<(u32, u32)> {
    let mut registers: [Option<u32>; 16] = [None; 16];
    let mut found = Vec::new();
    for instruction in &function.instructions {
        if let Some((value, base, offset)) = byte_store(instruction)
            && let (Some(value), Some(base)) = (registers[value], registers[base])
        {
            let address = base.wrapping_add(offset);
            if REGISTERS.contains(&address) {
                found.push((address - REGISTERS.start, (1 << BITS) - (value >> (8 - BITS) & ((1 << BITS) - 1))));
            }
        }
        if let Some((register, source)) = step::source(instruction) {
            let register = register as usize & 15;
            registers[register] = match source {
                Source::Constant(number) => Some(number),
                Source::Upper(upper) => registers[register].map(|lower| upper << 16 | lower & 0xFFFF),
                Source::Word(address) => memory.word(address),
                Source::RegisterPlus(from, bytes) => {
                    registers[from as usize & 15].map(|from| from.wrapping_add_signed(bytes))
                }
                Source::StackPlus(_) | Source::Aligned(_) => None,
            };
        } else if matches!(instruction.flow, Flow::Call(_)) {
            // What a call may change.
            for register in [0, 1, 2, 3, 12] {
                registers[register] = None;
            }
        }
    }
    found
}

/// Which register a STRB stores, where another points, and how far from there.
fn byte_store(instruction: &Instruction) -> Option<(usize, usize, u32)> {
    let (first, second) = (u32::from(instruction.halves.0), u32::from(instruction.halves.1));
    match first {
        0x7000..=0x77FF if instruction.bytes == 2 => {
            Some((first as usize & 7, first as usize >> 3 & 7, first >> 6 & 31))
        }
        0xF880..=0xF88F => Some((second as usize >> 12, first as usize & 15, second & 0xFFF)),
        _ => None,
    }
}
