//! Encodings as an assembler makes them, and what is read in them.

use super::super::step::{Effect, Source, Way, effect, source, way};
use crate::thumb::Instruction;

/// Encodings as an assembler makes them.
fn read(halves: &[u16]) -> Instruction {
    let code: Vec<u8> = halves.iter().flat_map(|half| half.to_le_bytes()).collect();
    let read = Instruction::read(0x1000, &code).expect("a whole instruction");
    assert_eq!(read.bytes as usize, code.len());
    read
}

#[test]
fn what_is_put_on_the_stack_is_counted() {
    for (halves, bytes, text) in [
        (&[0xB5F0][..], 20, "push {r4, r5, r6, r7, lr}"),
        (&[0xE92D, 0x0F00], 16, "push.w {r8, r9, r10, r11}"),
        (&[0xF84D, 0xED04], 4, "str lr, [sp, #-4]!"),
        (&[0xE96D, 0x2302], 8, "strd r2, r3, [sp, #-8]!"),
        (&[0xED2D, 0x8B10], 64, "vpush {d8 to d15}"),
        (&[0xED2D, 0x8A01], 4, "vpush {s16}"),
        (&[0xB0BF], 252, "sub sp, #252"),
        (&[0xF5AD, 0x5DA4], 5248, "sub.w sp, sp, #5248"),
        (&[0xF5AD, 0x4D70], 61440, "sub.w sp, sp, #61440"),
        (&[0xF6AD, 0x7DFC], 4092, "subw sp, sp, #4092"),
    ] {
        assert_eq!(effect(&read(halves)), Effect::Down(bytes), "{text}");
    }
}

#[test]
fn what_is_taken_from_the_stack_is_counted() {
    for (halves, bytes, text) in [
        (&[0xBDF0][..], 20, "pop {r4, r5, r6, r7, pc}"),
        (&[0xE8BD, 0x0F00], 16, "pop.w {r8, r9, r10, r11}"),
        (&[0xE8BD, 0x8010], 8, "pop.w {r4, pc}"),
        (&[0xF85D, 0xEB04], 4, "ldr lr, [sp], #4"),
        (&[0xE8FD, 0x0102], 8, "ldrd r0, r1, [sp], #8"),
        (&[0xECBD, 0x8B04], 16, "vpop {d8, d9}"),
        (&[0xB009], 36, "add sp, #36"),
        (&[0xF50D, 0x5DA4], 5248, "add.w sp, sp, #5248"),
        (&[0xF20D, 0x7DE4], 2020, "addw sp, sp, #2020"),
    ] {
        assert_eq!(effect(&read(halves)), Effect::Down(-bytes), "{text}");
    }
}

#[test]
fn registers_that_move_the_stack_are_named() {
    assert_eq!(effect(&read(&[0xEBAD, 0x0D0C])), Effect::DownBy(12), "sub.w sp, sp, r12");
    assert_eq!(effect(&read(&[0x44E5])), Effect::UpBy(12), "add sp, r12");
    assert_eq!(effect(&read(&[0xEB0D, 0x0D04])), Effect::UpBy(4), "add.w sp, sp, r4");
    assert_eq!(effect(&read(&[0x46BD])), Effect::From(7), "mov sp, r7");
    assert_eq!(effect(&read(&[0xEA4F, 0x0D04])), Effect::From(4), "mov.w sp, r4");
}

#[test]
fn other_ways_to_write_the_stack_pointer_are_unknown() {
    for (halves, text) in [
        (&[0xF380, 0x8808][..], "msr msp, r0"),
        (&[0xF380, 0x8809], "msr psp, r0"),
        (&[0xF380, 0x8814], "msr control, r0"),
        (&[0xF8D0, 0xD000], "ldr.w sp, [r0]"),
        (&[0xF107, 0x0D08], "add.w sp, r7, #8"),
        (&[0xEA0D, 0x0D04], "and.w sp, sp, r4"),
        (&[0xEBAD, 0x0D44], "sub.w sp, sp, r4, lsl #1"),
        (&[0xF04F, 0x0D08], "mov.w sp, #8"),
        (&[0xE8AD, 0x0030], "stm.w sp!, {r4, r5}"),
        (&[0xE890, 0x2001], "ldm.w r0, {r0, sp}"),
        (&[0xFA00, 0xFD01], "lsl.w sp, r0, r1"),
        (&[0xFB00, 0xFD01], "mul sp, r0, r1"),
        (&[0xEE10, 0xDA10], "vmov sp, s0"),
    ] {
        assert_eq!(effect(&read(halves)), Effect::Unknown, "{text}");
    }
}

#[test]
fn everything_else_leaves_the_stack_pointer_alone() {
    for (halves, text) in [
        (&[0xAF03][..], "add r7, sp, #12"),
        (&[0x466C], "mov r4, sp"),
        (&[0x9001], "str r0, [sp, #4]"),
        (&[0xF8CD, 0x0190], "str.w r0, [sp, #400]"),
        (&[0xE9DD, 0x0102], "ldrd r0, r1, [sp, #8]"),
        (&[0xED9D, 0x8B02], "vldr d8, [sp, #8]"),
        (&[0xECA0, 0x8B02], "vstmia r0!, {d8}"),
        (&[0xE8A0, 0x0030], "stm.w r0!, {r4, r5}"),
        (&[0xE89D, 0x0003], "ldm.w sp, {r0, r1}"),
        (&[0xF50D, 0x5080], "add.w r0, sp, #4096"),
        (&[0xF1BD, 0x0F01], "cmp.w sp, #1"),
        (&[0xF380, 0x8811], "msr basepri, r0"),
        (&[0xF3EF, 0x8008], "mrs r0, msp"),
        (&[0xFB82, 0x0103], "smull r0, r1, r2, r3"),
        (&[0xEE10, 0x0A10], "vmov r0, s0"),
        (&[0xE8DF, 0xF001], "tbb [pc, r1]"),
    ] {
        assert_eq!(effect(&read(halves)), Effect::None, "{text}");
    }
}

#[test]
fn ways_out_of_an_instruction_are_told_apart() {
    for (halves, expected, text) in [
        (&[0x4798][..], Way::CallBy(3), "blx r3"),
        (&[0x4760], Way::By(12), "bx r12"),
        (&[0x4770], Way::By(14), "bx lr"),
        (&[0x469F], Way::By(3), "mov pc, r3"),
        (&[0xBDF0], Way::Return, "pop {r4, r5, r6, r7, pc}"),
        (&[0xE8BD, 0x8010], Way::Return, "pop.w {r4, pc}"),
        (&[0xF85D, 0xFB04], Way::Return, "ldr pc, [sp], #4"),
        (&[0xE8DF, 0xF001], Way::Table { base: 15, entry: 1 }, "tbb [pc, r1]"),
        (&[0xE8DF, 0xF010], Way::Table { base: 15, entry: 2 }, "tbh [pc, r0, lsl #1]"),
        (&[0xE8D2, 0xF004], Way::Table { base: 2, entry: 1 }, "tbb [r2, r4]"),
        (&[0xF8DF, 0xF004], Way::Loaded(0x1008), "ldr.w pc, [pc, #4]"),
        (&[0xE91A, 0x8011], Way::Unknown, "ldmdb r10, {r0, r4, pc}"),
        (&[0xF8D0, 0xF000], Way::Unknown, "ldr.w pc, [r0]"),
        (&[0xB672], Way::Known, "cpsid i"),
    ] {
        assert_eq!(way(&read(halves)), expected, "{text}");
    }
}

#[test]
fn values_of_registers_are_followed() {
    for (halves, expected, text) in [
        (&[0x2440][..], (4, Source::Constant(64)), "movs r4, #64"),
        (&[0xF241, 0x0C00], (12, Source::Constant(4096)), "movw r12, #4096"),
        (&[0xF2C0, 0x0C01], (12, Source::Upper(1)), "movt r12, #1"),
        (&[0xF44F, 0x3480], (4, Source::Constant(65536)), "mov.w r4, #65536"),
        (&[0x4902], (1, Source::Word(0x100C)), "ldr r1, [pc, #8]"),
        (&[0xF8DF, 0xC008], (12, Source::Word(0x100C)), "ldr.w r12, [pc, #8]"),
        (&[0xF20F, 0x0210], (2, Source::Constant(0x1014)), "adr.w r2, #16"),
        (&[0xF2AF, 0x0210], (2, Source::Constant(0xFF4)), "adr.w r2, #-16"),
        (&[0xA204], (2, Source::Constant(0x1014)), "adr r2, #16"),
        (&[0xAF03], (7, Source::StackPlus(12)), "add r7, sp, #12"),
        (&[0x466F], (7, Source::StackPlus(0)), "mov r7, sp"),
        (&[0xF50D, 0x5080], (0, Source::StackPlus(4096)), "add.w r0, sp, #4096"),
        (&[0xF1A7, 0x0418], (4, Source::RegisterPlus(7, -24)), "sub.w r4, r7, #24"),
        (&[0xF36F, 0x0404], (4, Source::Aligned(5)), "bfc r4, #0, #5"),
    ] {
        assert_eq!(source(&read(halves)), Some(expected), "{text}");
    }
    assert_eq!(source(&read(&[0xF361, 0x0084])), None, "bfi r0, r1, #2, #3");
}
