//! The supply below which the chip is held in reset: an option that lies in the flash, told at start-up.
//!
//! The image never programs it. Option bytes decide how the chip starts; a power cut while they are written may leave a
//! board that needs a programmer, and the image would do that by itself on every new board.

use embassy_stm32::pac::FLASH;

use super::super::constants::supply::{BROWN_OUT_LEVEL, brown_out_millivolts};

/// Tells the level, as a warning if it is lower than it should be.
pub(super) fn tell() {
    let level = FLASH.optsr_cur().read().bor_lev();
    let millivolts = brown_out_millivolts(level);
    if level < BROWN_OUT_LEVEL {
        defmt::warn!("brown-out reset only below {=u32} mV: see docs/board-stm32h743.md, option bytes", millivolts);
    } else {
        defmt::info!("brown-out reset below {=u32} mV", millivolts);
    }
}
