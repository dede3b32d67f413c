//! Faults of the processor: their handlers run on a stack of their own and end the image with what the processor tells.
//!
//! The stack at fault may be overflown, or point to where there is no memory at all because one large frame stepped
//! over the guard. So nothing is pushed to it and nothing is read from it unless it lies where the stack belongs.

use core::arch::global_asm;

use cortex_m_rt::ExceptionFrame;

use super::super::constants::memory::STACK;
use super::SelectedBoard;
use crate::board::panic_stop;

// The stack's position goes along as the argument.
global_asm!(
    ".macro on_emergency_stack name, handler",
    ".section .text.\\name,\"ax\",%progbits",
    ".global \\name",
    ".type \\name,%function",
    ".thumb_func",
    "\\name:",
    "mov r0, sp",
    "ldr r1, =__emergency_stack",
    "mov sp, r1",
    "b \\handler",
    ".ltorg",
    ".endm",
    "on_emergency_stack MemoryManagement, memory_fault",
    "on_emergency_stack HardFault, hard_fault",
    ".purgem on_emergency_stack",
);

/// Somebody touched a guard. Never returns.
#[unsafe(no_mangle)]
extern "C" fn memory_fault(stack_pointer: u32) -> ! {
    panic_stop::after_memory_fault::<SelectedBoard>(stack_pointer)
}

/// Everything else that the processor cannot go on from. Never returns.
#[unsafe(no_mangle)]
extern "C" fn hard_fault(stack_pointer: u32) -> ! {
    let inside = stack_pointer >= STACK.start
        && stack_pointer.is_multiple_of(4)
        && stack_pointer <= STACK.end() - size_of::<ExceptionFrame>() as u32;
    // SAFETY: the processor has put a frame there, see above; every bit pattern is one.
    let frame = inside.then(|| unsafe { &*(stack_pointer as *const ExceptionFrame) });
    panic_stop::after_hard_fault::<SelectedBoard>(stack_pointer, frame)
}
