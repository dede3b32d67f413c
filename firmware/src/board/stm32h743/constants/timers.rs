//! Slots of the control cycle, time since start-up, and the watchdog.

use super::clocks::{LSI_HZ, TIMER_HZ};

pub use device::time::{CYCLE_SLOTS, SLOT_HZ};

/// Ticks of the slot timer (TIM2) in one slot, rounded to the nearest. 200 MHz / 900 is not whole: 222 222 ticks make
/// 900.0009 Hz, one millionth too fast, a tenth of what the crystal itself may be off.
pub const SLOT_TICKS: u32 = (TIMER_HZ + SLOT_HZ / 2) / SLOT_HZ;

/// Divider in front of the slot timer's counter: none, so that the rounding is as small as it can be.
pub const SLOT_PRESCALER: u32 = 1;

/// Ticks per second of the time since start-up (TIM5), Hz: every tick of the timer clock. Its 32 bits last 21 s, and
/// every slot reads it.
pub const CLOCK_HZ: u32 = TIMER_HZ;

/// Divider in front of the watchdog's counter, its value after a reset.
pub const WATCHDOG_PRESCALER: u32 = 4;

/// Value that the watchdog counts down from the start of the image until the first slot is due, that after a reset: 512
/// ms. The clock tree and the building of both halves take this long at most, or the chip starts again.
pub const WATCHDOG_START_TICKS: u32 = 4096;

/// Value that the watchdog counts down in service: 80 ticks of 8 kHz are 10 ms, nine slots. The control slot may
/// legally be late by one; pucks keep the last torque until the safety module's heartbeat runs out, so this must be
/// the first to act.
pub const WATCHDOG_TICKS: u32 = 80;

/// Time until the watchdog resets the chip, us, at the nominal frequency of its oscillator.
pub const WATCHDOG_US: u32 = watchdog_us(WATCHDOG_TICKS);

/// The same before the first slot, us.
pub const WATCHDOG_START_US: u32 = watchdog_us(WATCHDOG_START_TICKS);

/// Longest the watchdog may take to make a new window its own, us. It needs six periods of its divided oscillator, 0.8
/// ms; one that needs longer than this has no oscillator, and never resets anything.
pub const WATCHDOG_UPDATE_US: u32 = 5_000;

/// Time of so many ticks of the watchdog, us, at the nominal frequency.
const fn watchdog_us(ticks: u32) -> u32 {
    ticks * WATCHDOG_PRESCALER * (1_000_000 / 1_000) / (LSI_HZ / 1_000)
}

/// At the end, the longest wait for room for the last frames, us: four full frames of ours and one of another node.
pub const LAST_ROOM_US: u32 = 1_500;

/// Longest wait until a CAN controller says that it has stopped, or that it has not any more, us: a few ticks of its
/// clock. One that comes back late is asked again in the next control cycle; the control slot never waits for it.
pub const INIT_US: u32 = 20;

/// At the end, the longest wait for the last frames to leave, us: either the bus has to be joined again, which takes
/// 129 times eleven bits and may begin only when the controller has come to bus-off over them, or a frame of another
/// node and four that waited come first. With the wait for room it stays below the watchdog's shortest window.
pub const LAST_LEFT_US: u32 = 5_000;
