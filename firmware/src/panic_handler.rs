//! Where a panic, and an exception that nobody handles, meet the board.

use core::panic::PanicInfo;

use cortex_m_rt::exception;

use crate::board::SelectedBoard;
use crate::board::panic_stop::{FaultRegisters, stop};

#[panic_handler]
fn panicked(information: &PanicInfo<'_>) -> ! {
    stop::<SelectedBoard>(format_args!("{information}"))
}

/// The end after an exception or an interrupt that has no handler: exceptions of the processor have negative numbers.
#[exception]
unsafe fn DefaultHandler(number: i16) -> ! {
    stop::<SelectedBoard>(format_args!("nobody handles interrupt {number}: {FaultRegisters}"))
}
