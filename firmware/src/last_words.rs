//! What the image does when it cannot go on: interrupts off, zero torque, arm and hand to idle, a reason, the end.
//!
//! The pucks hold the last torque they were sent until their watchdog or the safety module stops them, so the zero
//! torques go first. The panic may have come from anywhere: nothing here depends on the state of the application.

use core::fmt;
use core::panic::PanicInfo;

use cortex_m_rt::{ExceptionFrame, exception};
use puck::{CanFrame, Group, MotorMode, PropertyId, set, zero_torques};

use crate::board::{Board, Edge};

fn last_frames() -> [CanFrame; 4] {
    let [arm, wrist] = zero_torques();
    let idle = MotorMode::Idle.value();
    [arm, wrist, set(Group::ARM, PropertyId::MODE, idle), set(Group::HAND, PropertyId::MODE, idle)]
}

#[panic_handler]
fn panicked(information: &PanicInfo<'_>) -> ! {
    stop(format_args!("{information}"))
}

/// The end, for a reason that the board has found.
pub fn stop(reason: fmt::Arguments<'_>) -> ! {
    cortex_m::interrupt::disable();
    Board::stop(&last_frames(), reason)
}

/// The end after a forbidden access, where the board guards its stack: called on another stack, with interrupts masked.
pub fn after_memory_fault(address: u32, stack_pointer: u32) -> ! {
    stop(format_args!("memory fault at {address:#010x}, stack at {stack_pointer:#010x}: stack overflow?"))
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    stop(format_args!("hard fault at {:#010x}: {frame:?}", frame.pc()))
}
