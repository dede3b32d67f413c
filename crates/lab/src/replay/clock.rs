//! The logging computer's time in the device's time.
//!
//! A log says when frames were on the bus, not when the device's slots began. But the device's first frame leaves a
//! little after its first slot, and the position request of every cycle a little after another. In the log of a
//! simulation both times are the same.

use puck::CanFrame;
use sim::wire::frame_bits;
use sim::{TICKS_PER_BIT, TICKS_PER_MICROSECOND, Ticks};

use crate::simulation::queues::{FIRST_SLOT, SLOT_TICKS};

/// From the beginning of a slot to its first frame on an idle bus, us: what the application takes to begin.
const LATENCY_US: i64 = 10;

/// Clocks that differ by no more are the same, us: logs have whole microseconds.
const SAME_US: i64 = 2;

/// Cycles over which the smallest delay of the position request is looked for: of so many one finds the bus idle.
const CYCLES: u32 = 64;

/// Translates times of a log.
#[derive(Debug, Clone, Copy)]
pub(super) struct LogClock {
    /// Device time minus log time, us.
    offset_us: i64,
    /// Both clocks are one: the log is that of a simulation.
    one: bool,
    /// Smallest delay of the present cycles, us, and how many there were.
    least: (i64, u32),
}

impl LogClock {
    /// From the device's first frame, whose end has this time in the log.
    pub(super) fn from_first_frame(frame: &CanFrame, end_us: u64) -> Self {
        let first_slot_us = (FIRST_SLOT * SLOT_TICKS / TICKS_PER_MICROSECOND) as i64;
        let offset_us = first_slot_us - (start_us(frame, end_us) - LATENCY_US);
        let one = offset_us.abs() <= SAME_US;
        Self { offset_us: if one { 0 } else { offset_us }, one, least: (i64::MAX, 0) }
    }

    /// Device time of a moment of the log; moments before power-up count as power-up.
    pub(super) fn device_time(&self, log_us: u64) -> Ticks {
        let us = (log_us as i64).saturating_add(self.offset_us).max(0);
        us as Ticks * TICKS_PER_MICROSECOND
    }

    /// Moment of the log at a device time, us.
    pub(super) fn log_time(&self, at: Ticks) -> u64 {
        ((at / TICKS_PER_MICROSECOND) as i64).saturating_sub(self.offset_us).max(0) as u64
    }

    /// A position request of the device, and the slot that sent it: follows the drift between both clocks.
    pub(super) fn follow(&mut self, frame: &CanFrame, end_us: u64, slot: Ticks) {
        if self.one {
            return;
        }
        let slot_us = (slot / TICKS_PER_MICROSECOND) as i64;
        let late_us = start_us(frame, end_us) + self.offset_us - slot_us - LATENCY_US;
        let (least, count) = (self.least.0.min(late_us), self.least.1 + 1);
        self.least = (least, count);
        if count == CYCLES {
            // Half of it, so that one odd cycle does not pull the clock away.
            self.offset_us -= if least.abs() > SAME_US { least / 2 } else { 0 };
            self.least = (i64::MAX, 0);
        }
    }
}

fn start_us(frame: &CanFrame, end_us: u64) -> i64 {
    end_us as i64 - (Ticks::from(frame_bits(frame)) * TICKS_PER_BIT / TICKS_PER_MICROSECOND) as i64
}
