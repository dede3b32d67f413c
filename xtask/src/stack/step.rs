//! Effect of one instruction on the stack pointer and on known registers: Thumb-2 as the architecture's
//! manual encodes it (ARM DDI 0403, A5 and A7.7).
//!
//! Every encoding that can write the stack pointer is either read here or [`Effect::Unknown`]; no other changes it.

use crate::thumb::Instruction;

/// Number of the stack pointer.
const SP: u32 = 13;
/// Number of the program counter.
const PC: u32 = 15;

/// Effect on the stack pointer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Effect {
    /// Nothing.
    None,
    /// It goes down by so many bytes; up, if negative.
    Down(i32),
    /// It goes down by a register.
    DownBy(u32),
    /// It goes up by a register.
    UpBy(u32),
    /// It becomes a register.
    From(u32),
    /// It is written in a way that is not read here.
    Unknown,
}

/// Where an instruction goes on that leads nowhere one can read in it alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Way {
    /// To a place known from the instruction, or to the next one.
    Known,
    /// Calls the function a register points to (BLX).
    CallBy(u32),
    /// Goes where a register points to (BX, MOV to the program counter); the link register's way is a return.
    By(u32),
    /// Goes where a constant near the code says (LDR from a fixed place).
    Loaded(u32),
    /// Goes on by a table of bytes (TBB) or halves (TBH).
    Table {
        /// The register that points to it: the program counter, if it follows.
        base: u32,
        /// Bytes of an entry.
        entry: u32,
    },
    /// Returns: the program counter comes from the stack.
    Return,
    /// Somewhere else.
    Unknown,
}

/// Origin of a register's value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    /// A number.
    Constant(u32),
    /// The upper half becomes this (MOVT).
    Upper(u32),
    /// The word at an address.
    Word(u32),
    /// The stack pointer, and so many bytes above it.
    StackPlus(i32),
    /// Another register, and so many bytes above it.
    RegisterPlus(u32, i32),
    /// As many of its lowest bits become zero (BFC).
    Aligned(u32),
}

/// Effect of the instruction on the stack pointer.
pub(super) fn effect(instruction: &Instruction) -> Effect {
    let (first, second) = (u32::from(instruction.halves.0), u32::from(instruction.halves.1));
    if instruction.bytes == 2 { narrow(first) } else { wide(first, second) }
}

fn narrow(code: u32) -> Effect {
    let words = |list: u32| 4 * list.count_ones().cast_signed();
    match code {
        0xB000..=0xB07F => Effect::Down(-((code & 0x7F) << 2).cast_signed()),
        0xB080..=0xB0FF => Effect::Down(((code & 0x7F) << 2).cast_signed()),
        0xB400..=0xB5FF => Effect::Down(words(code & 0x1FF)),
        0xBC00..=0xBDFF => Effect::Down(-words(code & 0x1FF)),
        _ if code & 0xFF87 == 0x4485 => Effect::UpBy(code >> 3 & 15),
        _ if code & 0xFF87 == 0x4685 => Effect::From(code >> 3 & 15),
        _ => Effect::None,
    }
}

/// True if a field of four bits names the stack pointer.
fn is_sp(code: u32, shift: u32) -> bool {
    code >> shift & 15 == SP
}

fn wide(first: u32, second: u32) -> Effect {
    let unknown_if = |writes| if writes { Effect::Unknown } else { Effect::None };
    match first >> 8 {
        0xE8 | 0xE9 if first & 0x40 == 0 => multiple(first, second),
        0xE8 | 0xE9 => double(first, second),
        0xEA | 0xEB => shifted(first, second),
        // The extension's registers; of the processor's, these write some: VMOV and MRC to them.
        0xEC | 0xED | 0xFC | 0xFD => extension(first, second),
        0xEE | 0xFE => unknown_if(second & 0x10 != 0 && first & 0x10 != 0 && is_sp(second, 12)),
        0xF0..=0xF7 if second & 0x8000 == 0 => immediate(first, second),
        0xF0..=0xF7 => control(first, second),
        0xF8 | 0xF9 => single(first, second),
        0xFA => unknown_if(is_sp(second, 8)),
        0xFB => unknown_if(is_sp(second, 8) || first & 0x80 != 0 && is_sp(second, 12)),
        _ => Effect::Unknown,
    }
}

/// LDM, STM and their forms on the stack.
fn multiple(first: u32, second: u32) -> Effect {
    let (writes_back, loads) = (first & 0x20 != 0, first & 0x10 != 0);
    if second & 1 << SP != 0 {
        return Effect::Unknown;
    }
    if !(writes_back && is_sp(first, 0)) {
        return Effect::None;
    }
    let bytes = 4 * second.count_ones().cast_signed();
    match (first >> 7 & 3, loads) {
        (0b01, true) => Effect::Down(-bytes),
        (0b10, false) => Effect::Down(bytes),
        _ => Effect::Unknown,
    }
}

/// LDRD, STRD; LDREX, STREX; TBB, TBH.
fn double(first: u32, second: u32) -> Effect {
    let (indexes, writes_back, loads) = (first & 0x100 != 0, first & 0x20 != 0, first & 0x10 != 0);
    let is_exclusive = !indexes && !writes_back;
    // LDREX and LDRD load the first; LDRD the second, where STREX has its answer.
    let target = loads && is_sp(second, 12) || (loads || is_exclusive) && is_sp(second, 8);
    if target {
        return Effect::Unknown;
    }
    if is_exclusive || !writes_back || !is_sp(first, 0) {
        return Effect::None;
    }
    let bytes = ((second & 0xFF) << 2).cast_signed();
    Effect::Down(if first & 0x80 != 0 { -bytes } else { bytes })
}

/// Arithmetic with a shifted register.
fn shifted(first: u32, second: u32) -> Effect {
    if !is_sp(second, 8) {
        return Effect::None;
    }
    let (register, is_plain) = (second & 15, second & 0x70F0 == 0);
    match (first >> 5 & 15, first & 15, is_plain) {
        (0b0010, PC, true) => Effect::From(register),
        (0b1000, SP, true) => Effect::UpBy(register),
        (0b1101, SP, true) => Effect::DownBy(register),
        _ => Effect::Unknown,
    }
}

/// VPUSH, VPOP and other loads and stores of the extension; moves of two registers.
fn extension(first: u32, second: u32) -> Effect {
    if first & 0xFFE0 == 0xEC40 {
        let loads = first & 0x10 != 0;
        return if loads && (is_sp(second, 12) || is_sp(first, 0)) { Effect::Unknown } else { Effect::None };
    }
    if first & 0x20 == 0 || !is_sp(first, 0) {
        return Effect::None;
    }
    let bytes = ((second & 0xFF) << 2).cast_signed();
    match (first >> 7 & 3, first & 0x10 != 0) {
        _ if first & 0xFE00 != 0xEC00 => Effect::Unknown,
        (0b01, true) => Effect::Down(-bytes),
        (0b10, false) => Effect::Down(bytes),
        _ => Effect::Unknown,
    }
}

/// Arithmetic with a number in the instruction.
fn immediate(first: u32, second: u32) -> Effect {
    if !is_sp(second, 8) {
        return Effect::None;
    }
    if !is_sp(first, 0) {
        return Effect::Unknown;
    }
    let plain = plain_number(first, second);
    match (first & 0x200 == 0, first >> 5 & 15, first >> 4 & 31) {
        (true, 0b1000, _) => Effect::Down(-expanded(plain).cast_signed()),
        (true, 0b1101, _) => Effect::Down(expanded(plain).cast_signed()),
        (false, _, 0b00000) => Effect::Down(-plain.cast_signed()),
        (false, _, 0b01010) => Effect::Down(plain.cast_signed()),
        _ => Effect::Unknown,
    }
}

/// Special registers: the two stack pointers and which of them is in use.
fn control(first: u32, second: u32) -> Effect {
    let is_other = second & 0xD000 == 0x8000 && first >> 6 & 15 >= 14;
    let reads = first & 0xFFE0 == 0xF3E0 && is_sp(second, 8);
    let writes = first & 0xFFE0 == 0xF380 && matches!(second & 0xFF, 8 | 9 | 20);
    if is_other && (reads || writes) { Effect::Unknown } else { Effect::None }
}

/// LDR, STR of one register.
fn single(first: u32, second: u32) -> Effect {
    if first & 0x10 != 0 && is_sp(second, 12) {
        return Effect::Unknown;
    }
    let has_short_offset = first & 0x80 == 0 && second & 0x800 != 0;
    if !has_short_offset || second & 0x100 == 0 || !is_sp(first, 0) {
        return Effect::None;
    }
    let bytes = (second & 0xFF).cast_signed();
    Effect::Down(if second & 0x200 != 0 { -bytes } else { bytes })
}

/// The twelve bits of a number in an instruction.
fn plain_number(first: u32, second: u32) -> u32 {
    (first >> 10 & 1) << 11 | (second >> 12 & 7) << 8 | second & 0xFF
}

/// The number that twelve bits mean in most instructions (ThumbExpandImm).
fn expanded(number: u32) -> u32 {
    let byte = number & 0xFF;
    match number >> 8 {
        0 => byte,
        1 => byte << 16 | byte,
        2 => byte << 24 | byte << 8,
        3 => byte << 24 | byte << 16 | byte << 8 | byte,
        _ => (0x80 | number & 0x7F).rotate_right(number >> 7 & 31),
    }
}

/// Where the instruction goes on.
pub(super) fn way(instruction: &Instruction) -> Way {
    let (first, second) = (u32::from(instruction.halves.0), u32::from(instruction.halves.1));
    if instruction.bytes == 2 {
        return match first {
            0x4780..=0x47FF => Way::CallBy(first >> 3 & 15),
            0x4700..=0x477F => Way::By(first >> 3 & 15),
            0xBD00..=0xBDFF => Way::Return,
            _ if first & 0xFF87 == 0x4687 => Way::By(first >> 3 & 15),
            _ if first & 0xFF87 == 0x4487 => Way::Unknown,
            _ => Way::Known,
        };
    }
    match first {
        _ if first & 0xFFF0 == 0xE8D0 && second & 0xFFE0 == 0xF000 => {
            Way::Table { base: first & 15, entry: if second & 0x10 == 0 { 1 } else { 2 } }
        }
        0xE8BD if second & 0x8000 != 0 => Way::Return,
        // LDR of the program counter: from the stack, from a constant, from anywhere.
        0xF85D if second == 0xFB04 => Way::Return,
        0xF85F | 0xF8DF if second >> 12 == PC => {
            Way::Loaded(literal(instruction.address, first & 0x80 != 0, second & 0xFFF))
        }
        _ if first & 0xFF70 == 0xF850 && second >> 12 == PC => Way::Unknown,
        _ if first & 0xFE50 == 0xE810 && second & 0x8000 != 0 => Way::Unknown,
        _ => Way::Known,
    }
}

/// Address of a constant near the code.
fn literal(address: u32, is_above: bool, offset: u32) -> u32 {
    let base = address.wrapping_add(4) & !3;
    if is_above { base.wrapping_add(offset) } else { base.wrapping_sub(offset) }
}

/// The register that gets a value one can follow, and which.
pub(super) fn source(instruction: &Instruction) -> Option<(u32, Source)> {
    let (first, second) = (u32::from(instruction.halves.0), u32::from(instruction.halves.1));
    if instruction.bytes == 2 {
        return match first {
            0x2000..=0x27FF => Some((first >> 8 & 7, Source::Constant(first & 0xFF))),
            0x4800..=0x4FFF => {
                Some((first >> 8 & 7, Source::Word(literal(instruction.address, true, (first & 0xFF) << 2))))
            }
            0xA000..=0xA7FF => {
                Some((first >> 8 & 7, Source::Constant(literal(instruction.address, true, (first & 0xFF) << 2))))
            }
            0xA800..=0xAFFF => Some((first >> 8 & 7, Source::StackPlus(((first & 0xFF) << 2).cast_signed()))),
            0x4600..=0x46FF => {
                let (to, from) = (first >> 4 & 8 | first & 7, first >> 3 & 15);
                Some((to, if from == SP { Source::StackPlus(0) } else { Source::RegisterPlus(from, 0) }))
            }
            _ => None,
        };
    }
    let (to, from) = (second >> 8 & 15, first & 15);
    let number = plain_number(first, second);
    let plus = |bytes: u32, is_down: bool| {
        let bytes = if is_down { -bytes.cast_signed() } else { bytes.cast_signed() };
        Some((to, if from == SP { Source::StackPlus(bytes) } else { Source::RegisterPlus(from, bytes) }))
    };
    if first & 0xFF7F == 0xF85F {
        return Some((second >> 12, Source::Word(literal(instruction.address, first & 0x80 != 0, second & 0xFFF))));
    }
    if first & 0xF800 != 0xF000 || second & 0x8000 != 0 {
        return None;
    }
    if first & 0xFB5F == 0xF20F {
        return Some((to, Source::Constant(literal(instruction.address, first & 0xA0 == 0, number))));
    }
    let half = from << 12 | number;
    match first & 0xFBF0 {
        0xF240 => Some((to, Source::Constant(half))),
        0xF2C0 => Some((to, Source::Upper(half))),
        0xF040 if from == PC => Some((to, Source::Constant(expanded(number)))),
        0xF100 => plus(expanded(number), false),
        0xF1A0 => plus(expanded(number), true),
        0xF200 => plus(number, false),
        0xF2A0 => plus(number, true),
        0xF360 if from == PC && second >> 6 & 3 == 0 && second >> 12 & 7 == 0 => {
            Some((to, Source::Aligned((second & 31) + 1)))
        }
        _ => None,
    }
}
