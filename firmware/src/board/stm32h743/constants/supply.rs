//! The supply, and below which voltage the chip is held in reset.

/// Brown-out level (BOR_LEV) a board should have: far enough below 3.3 V for every disturbance that does no harm, and
/// so far above what flash and core need that a falling supply ends the image before it ends an erasure half done.
pub const BROWN_OUT_LEVEL: u8 = 2;

/// Supply below which the chip is held in reset at a level, mV. Level 0, as delivered, is the reset of power-on and
/// power-down alone.
#[must_use]
pub const fn brown_out_millivolts(level: u8) -> u32 {
    match level {
        0 => 1_600,
        1 => 2_100,
        2 => 2_400,
        _ => 2_700,
    }
}
