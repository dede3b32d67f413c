//! The STM32H743 image executed on an emulated chip.
