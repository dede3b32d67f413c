//! Where an instruction of a Cortex-M leads: the branches of Thumb-2, as the architecture's manual encodes them (ARM
//! DDI 0403, A7.7).
//!
//! Everything else is only told apart by its length. Branches through a register lead nowhere that can be read here.

/// Effect of an instruction on the flow of control.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Flow {
    /// The next instruction follows, a call through a register included.
    Next,
    /// Calls a function (BL).
    Call(u32),
    /// Always goes on there (B).
    Jump(u32),
    /// Goes on there or at the next instruction (B with a condition, CBZ, CBNZ).
    Branch(u32),
    /// Goes where a register, the stack or a table says: a return, mostly.
    Elsewhere,
    /// Permanently undefined (UDF), as somebody wrote it.
    Abort,
    /// Permanently undefined with the number 254: code that the compiler has proved unreachable.
    Unreachable,
}

/// One instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Instruction {
    /// Where it is.
    pub(crate) address: u32,
    /// 2 or 4.
    pub(crate) bytes: u32,
    /// Its first half, and its second if it has two.
    pub(crate) halves: (u16, u16),
    /// Where it leads.
    pub(crate) flow: Flow,
}

impl Instruction {
    /// Reads the instruction at the beginning of `code`, which lies at `address`; `None` if it is cut off.
    pub(crate) fn read(address: u32, code: &[u8]) -> Option<Self> {
        let half = |at: usize| Some(u16::from_le_bytes(*code.get(at..)?.first_chunk()?));
        let first = half(0)?;
        // Every instruction that begins with 0b11101, 0b11110 or 0b11111 has two halves.
        Some(if first >> 11 >= 0b11101 {
            let second = half(2)?;
            Self { address, bytes: 4, halves: (first, second), flow: wide(address, first, second) }
        } else {
            Self { address, bytes: 2, halves: (first, 0), flow: narrow(address, first) }
        })
    }
}

/// Offsets count from here: the processor's program counter is two halves ahead.
fn target(address: u32, offset: i32) -> u32 {
    address.wrapping_add(4).wrapping_add_signed(offset)
}

/// Lets the bit `sign` be the sign.
fn extended(value: u32, sign: u32) -> i32 {
    let unused = 31 - sign;
    (value << unused).cast_signed() >> unused
}

fn narrow(address: u32, code: u16) -> Flow {
    let bits = u32::from(code);
    match code {
        // B<cond> (T1); the last two conditions are UDF and SVC.
        0xDEFE => Flow::Unreachable,
        0xDE00..=0xDEFF => Flow::Abort,
        0xD000..=0xDDFF => Flow::Branch(target(address, extended((bits & 0xFF) << 1, 8))),
        // B (T2).
        0xE000..=0xE7FF => Flow::Jump(target(address, extended((bits & 0x7FF) << 1, 11))),
        // CBZ, CBNZ: forward only.
        _ if code & 0xF500 == 0xB100 => {
            let offset = (bits >> 9 & 1) << 6 | (bits >> 3 & 31) << 1;
            Flow::Branch(target(address, offset.cast_signed()))
        }
        // BX; POP with the program counter; MOV and ADD to it.
        _ if code & 0xFF80 == 0x4700 || code & 0xFF00 == 0xBD00 => Flow::Elsewhere,
        _ if code & 0xFF87 == 0x4687 || code & 0xFF87 == 0x4487 => Flow::Elsewhere,
        _ => Flow::Next,
    }
}

fn wide(address: u32, first: u16, second: u16) -> Flow {
    if first & 0xFFF0 == 0xF7F0 && second & 0xF000 == 0xA000 {
        return Flow::Abort;
    }
    if first & 0xF800 == 0xF000 {
        let (first, second) = (u32::from(first), u32::from(second));
        let sign = first >> 10 & 1;
        // BL (T1) and B.W (T4): the upper bits are stored as whether they equal the sign.
        let far = || {
            let upper = |bit: u32| 1 ^ (second >> bit & 1) ^ sign;
            let offset = sign << 24 | upper(13) << 23 | upper(11) << 22 | (first & 0x3FF) << 12 | (second & 0x7FF) << 1;
            target(address, extended(offset, 24))
        };
        return match second & 0xD000 {
            0xD000 => Flow::Call(far()),
            0x9000 => Flow::Jump(far()),
            // B<cond>.W (T3); the last two conditions are other instructions.
            0x8000 if first >> 6 & 15 < 14 => {
                let upper = (second >> 11 & 1) << 19 | (second >> 13 & 1) << 18;
                let offset = sign << 20 | upper | (first & 0x3F) << 12 | (second & 0x7FF) << 1;
                Flow::Branch(target(address, extended(offset, 20)))
            }
            // BLX to a fixed place would leave Thumb, which a Cortex-M cannot.
            _ => Flow::Next,
        };
    }
    // TBB, TBH; POP.W and LDR.W with the program counter.
    let by_table = first & 0xFFF0 == 0xE8D0 && second & 0xFFE0 == 0xF000;
    let popped = first == 0xE8BD && second & 0x8000 != 0;
    let loaded = first & 0xFF70 == 0xF850 && second & 0xF000 == 0xF000;
    if by_table || popped || loaded { Flow::Elsewhere } else { Flow::Next }
}

#[cfg(test)]
mod tests {
    use super::{Flow, Instruction};

    const AT: u32 = 0x1000;

    fn flow(halves: &[u16]) -> Flow {
        let code: Vec<u8> = halves.iter().flat_map(|half| half.to_le_bytes()).collect();
        let read = Instruction::read(AT, &code).expect("a whole instruction");
        assert_eq!(read.bytes as usize, code.len());
        read.flow
    }

    #[test]
    fn calls_lead_forward_and_backward() {
        assert_eq!(flow(&[0xF000, 0xF801]), Flow::Call(AT + 6), "bl .+6");
        assert_eq!(flow(&[0xF7FF, 0xFFFE]), Flow::Call(AT), "bl .");
        assert_eq!(flow(&[0xF7FF, 0xFF7E]), Flow::Call(AT - 256), "bl .-256");
        assert_eq!(flow(&[0xF3FF, 0xD7FF]), Flow::Call(AT + 4 + 0xFF_FFFE), "the farthest bl");
    }

    #[test]
    fn jumps_lead_forward_and_backward() {
        assert_eq!(flow(&[0xF000, 0xB801]), Flow::Jump(AT + 6), "b.w .+6");
        assert_eq!(flow(&[0xF7FF, 0xBFFE]), Flow::Jump(AT), "b.w .");
        assert_eq!(flow(&[0xE001]), Flow::Jump(AT + 6), "b .+6");
        assert_eq!(flow(&[0xE7FE]), Flow::Jump(AT), "b .");
    }

    #[test]
    fn conditional_branches_of_every_length_are_read() {
        assert_eq!(flow(&[0xD001]), Flow::Branch(AT + 6), "beq .+6");
        assert_eq!(flow(&[0xDDFE]), Flow::Branch(AT), "ble .");
        assert_eq!(flow(&[0xF000, 0x8001]), Flow::Branch(AT + 6), "beq.w .+6");
        assert_eq!(flow(&[0xF47F, 0xAFFE]), Flow::Branch(AT), "bne.w .");
        assert_eq!(flow(&[0xB108]), Flow::Branch(AT + 6), "cbz r0, .+6");
        assert_eq!(flow(&[0xBBFF]), Flow::Branch(AT + 4 + 126), "cbnz r7, the farthest");
    }

    #[test]
    fn ends_and_aborts_are_told_from_what_goes_on() {
        assert_eq!(flow(&[0x4770]), Flow::Elsewhere, "bx lr");
        assert_eq!(flow(&[0xBDF0]), Flow::Elsewhere, "pop r4 to r7, pc");
        assert_eq!(flow(&[0xE8BD, 0x83F0]), Flow::Elsewhere, "pop.w r4 to r9, pc");
        assert_eq!(flow(&[0xE8DF, 0xF000]), Flow::Elsewhere, "tbb [pc, r0]");
        assert_eq!(flow(&[0xF85D, 0xFB04]), Flow::Elsewhere, "ldr pc, [sp], #4");
        assert_eq!(flow(&[0xDE00]), Flow::Abort, "udf #0");
        assert_eq!(flow(&[0xDEFE]), Flow::Unreachable, "udf #254");
        assert_eq!(flow(&[0xF7F0, 0xA000]), Flow::Abort, "udf.w #0");
        assert_eq!(flow(&[0xDF00]), Flow::Next, "svc #0");
        assert_eq!(flow(&[0x4780]), Flow::Next, "blx r0");
        assert_eq!(flow(&[0xF8D0, 0x1000]), Flow::Next, "ldr.w r1, [r0]");
        assert_eq!(flow(&[0xF040, 0x0001]), Flow::Next, "orr.w r0, r0, #1");
        assert_eq!(flow(&[0xF3BF, 0x8F5F]), Flow::Next, "dmb sy");
        assert_eq!(flow(&[0xF3EF, 0x8010]), Flow::Next, "mrs r0, primask");
    }

    #[test]
    fn half_an_instruction_is_none() {
        assert_eq!(Instruction::read(AT, &[0x00, 0xF0]), None);
        assert_eq!(Instruction::read(AT, &[]), None);
    }
}
