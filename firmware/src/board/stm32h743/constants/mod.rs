//! Every number of the board, computed where it can be, without a register in sight: the image and its tests on the
//! host read the same constants.
//!
//! Sources, recalled and not checked on hardware: reference manual RM0433 and data sheet DS12110 of the STM32H743, user
//! manual UM2407 of the NUCLEO-H743ZI2. `docs/board-stm32h743.md` explains why each number is what it is.

pub mod can;
pub mod can_settings;
pub mod chip_settings;
pub mod clocks;
pub mod filters;
pub mod lines;
pub mod memory;
pub mod supply;
pub mod timers;
