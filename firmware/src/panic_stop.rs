//! What the image does when it cannot go on: interrupts off, zero torque, arm and hand to idle, a reason, the end.
//!
//! The pucks hold the last torque they were sent until their watchdog or the safety module stops them, so the zero
//! torques go first. The panic may have come from anywhere: nothing here depends on the state of the application.

use core::fmt;
use core::panic::PanicInfo;

use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};
use puck::stop_frames;

use crate::board::{Board, SelectedBoard};

#[panic_handler]
fn panicked(information: &PanicInfo<'_>) -> ! {
    stop(format_args!("{information}"))
}

/// The end, for a reason that the board has found.
pub fn stop(reason: fmt::Arguments<'_>) -> ! {
    cortex_m::interrupt::disable();
    SelectedBoard::stop(&stop_frames(), reason)
}

/// What the processor's fault registers say.
struct FaultRegisters;

impl fmt::Display for FaultRegisters {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // SAFETY: registers of the processor that only tell.
        let system = unsafe { &*SCB::PTR };
        let (cfsr, hfsr) = (system.cfsr.read(), system.hfsr.read());
        let (mmfar, bfar) = (system.mmfar.read(), system.bfar.read());
        write!(f, "CFSR {cfsr:#010x}, HFSR {hfsr:#010x}, MMFAR {mmfar:#010x}, BFAR {bfar:#010x}")
    }
}

/// The end after a forbidden access, where the board guards its stack: called on another stack.
pub fn after_memory_fault(stack_pointer: u32) -> ! {
    stop(format_args!("memory fault, stack at {stack_pointer:#010x}: stack overflow? {FaultRegisters}"))
}

/// The end after a hard fault. `frame` is what the processor put on the stack, where that can be read.
pub fn after_hard_fault(stack_pointer: u32, frame: Option<&ExceptionFrame>) -> ! {
    match frame {
        Some(frame) => stop(format_args!("hard fault at {:#010x}: {FaultRegisters}; {frame:?}", frame.pc())),
        None => stop(format_args!("hard fault, stack outside its memory at {stack_pointer:#010x}: {FaultRegisters}")),
    }
}

/// The end after an exception or an interrupt that has no handler: exceptions of the processor have negative numbers.
#[exception]
unsafe fn DefaultHandler(number: i16) -> ! {
    stop(format_args!("nobody handles interrupt {number}: {FaultRegisters}"))
}
