//! NUCLEO-H743ZI2: an STM32H743 (Cortex-M7, 400 MHz) with a CAN transceiver on FDCAN1.
//!
//! embassy-stm32 sets up clocks and pins and names the registers; the drivers are this module's own, because the
//! application fetches and hands over frames and bytes inside its interrupts and never awaits them
//! (`docs/decisions/0020-drivers-of-the-stm32h743.md`). Every number is in [`constants`]. Built and linked; **never run
//! on hardware**.

pub mod constants;

#[cfg(all(target_os = "none", feature = "board-stm32h743"))]
mod parts;

#[cfg(all(target_os = "none", feature = "board-stm32h743"))]
pub use parts::{SelectedBoard, device};
