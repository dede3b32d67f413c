//! The end of an image that cannot go on: interrupts off, zero torque, arm and hand to idle, a reason, the end.
//!
//! The pucks hold the last torque they were sent until their watchdog or the safety module stops them, so the zero
//! torques go first. The panic may have come from anywhere: nothing here depends on the state of the application.

use core::fmt;

use cortex_m::peripheral::SCB;
use cortex_m_rt::ExceptionFrame;
use puck::stop_frames;

use super::Board;

/// The end, for a reason that the board has found.
pub fn stop<B: Board>(reason: fmt::Arguments<'_>) -> ! {
    cortex_m::interrupt::disable();
    B::stop(&stop_frames(), reason)
}

/// The fault registers of the processor, in words.
pub struct FaultRegisters;

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
pub fn after_memory_fault<B: Board>(stack_pointer: u32) -> ! {
    stop::<B>(format_args!("memory fault, stack at {stack_pointer:#010x}: stack overflow? {FaultRegisters}"))
}

/// The end after a hard fault. `frame` is what the processor put on the stack, where that can be read.
pub fn after_hard_fault<B: Board>(stack_pointer: u32, frame: Option<&ExceptionFrame>) -> ! {
    match frame {
        Some(frame) => stop::<B>(format_args!("hard fault at {:#010x}: {FaultRegisters}; {frame:?}", frame.pc())),
        None => {
            stop::<B>(format_args!("hard fault, stack outside its memory at {stack_pointer:#010x}: {FaultRegisters}"))
        }
    }
}
