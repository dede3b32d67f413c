//! The cost of the control cycle, measured while it runs; read by tasks of lower priority.

use core::sync::atomic::{AtomicU32, Ordering};

/// Counters of the slot task. One task writes, any task reads; a reading may mix two cycles, which does no harm.
pub struct Meters {
    dropped: AtomicU32,
    latency_worst: AtomicU32,
    cost_worst: AtomicU32,
    cost_mean: AtomicU32,
}

/// Weight of the newest cost in the mean: 1 / 2^8, a mean over about a second.
const MEAN_SHIFT: u32 = 8;

/// Fraction bits of the mean, so that the weight does not lose what it weighs.
const MEAN_FRACTION: u32 = 8;

impl Meters {
    /// Nothing measured.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            dropped: AtomicU32::new(0),
            latency_worst: AtomicU32::new(0),
            cost_worst: AtomicU32::new(0),
            cost_mean: AtomicU32::new(0),
        }
    }

    /// A slot began `latency` ticks before its task did.
    pub fn slot(&self, latency: u32) {
        self.latency_worst.fetch_max(latency, Ordering::Relaxed);
    }

    /// The control slot took `cost` ticks.
    pub fn control(&self, cost: u32) {
        let first = self.cost_worst.fetch_max(cost, Ordering::Relaxed) == 0;
        let scaled = cost << MEAN_FRACTION;
        let mean = self.cost_mean.load(Ordering::Relaxed);
        let mean = if first { scaled } else { mean - (mean >> MEAN_SHIFT) + (scaled >> MEAN_SHIFT) };
        self.cost_mean.store(mean, Ordering::Relaxed);
    }

    /// A frame found no room in the queue to the core.
    pub fn frame_dropped(&self) {
        self.dropped.fetch_add(1, Ordering::Relaxed);
    }

    /// An event found no room in the queue to the session.
    pub fn event_dropped(&self) {
        self.dropped.fetch_add(1, Ordering::Relaxed);
    }

    /// Frames and events lost between the tasks since start-up.
    #[must_use]
    pub fn dropped(&self) -> u32 {
        self.dropped.load(Ordering::Relaxed)
    }

    /// Longest delay from timer to task, ticks.
    #[must_use]
    pub fn latency_worst(&self) -> u32 {
        self.latency_worst.load(Ordering::Relaxed)
    }

    /// Longest control slot, ticks.
    #[must_use]
    pub fn cost_worst(&self) -> u32 {
        self.cost_worst.load(Ordering::Relaxed)
    }

    /// Mean control slot of the last second, ticks.
    #[must_use]
    pub fn cost_mean(&self) -> u32 {
        self.cost_mean.load(Ordering::Relaxed) >> MEAN_FRACTION
    }
}

impl Default for Meters {
    fn default() -> Self {
        Self::new()
    }
}
