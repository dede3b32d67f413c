//! Start of a puck: power, monitor (boot loader), main firmware, and the silences between.
//!
//! ```text
//! power on --20 ms--> Monitor (STAT 0) --SET STAT 2--> still there for 10 ms --> silent 0.3..1.0 s --> Ready (STAT 2)
//! ```
//! Sources: docs/barrett-can.md. The 10 ms and the range of the silence are documented by drivers; the time from power
//! to monitor is assumed.

use crate::noise::Noise;
use crate::time::{TICKS_PER_MILLISECOND, Ticks, ticks};

/// From motor power to the first answer of the monitor. Assumed.
const START_TIME: Ticks = 20 * TICKS_PER_MILLISECOND;

/// A waking puck leaves the bus this long after SET STAT = 2.
const LEAVE_TIME: Ticks = 10 * TICKS_PER_MILLISECOND;

/// Shortest and longest silence of a waking puck, s.
const WAKE_SECONDS: (f64, f64) = (0.3, 1.0);

/// The program that answers, if any.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Presence {
    /// Nothing: no power, starting or waking.
    Absent,
    /// The monitor: properties 0..=7 only.
    Monitor,
    /// The main firmware.
    Ready,
}

#[derive(Clone, Copy, Debug)]
enum Phase {
    Off,
    Starting { until: Ticks },
    Waking { leaves: Ticks, answers: Ticks },
    Running,
}

/// Power and firmware state of one puck.
#[derive(Clone, Debug)]
pub(crate) struct Boot {
    phase: Phase,
    noise: Noise,
}

impl Boot {
    /// A puck without power; `noise` decides how long it takes to wake.
    pub(crate) fn new(noise: Noise) -> Self {
        Self { phase: Phase::Off, noise }
    }

    /// Returns the program that answers at time `now`.
    pub(crate) fn presence(&self, now: Ticks) -> Presence {
        match self.phase {
            Phase::Off => Presence::Absent,
            Phase::Starting { until } if now < until => Presence::Absent,
            Phase::Starting { .. } => Presence::Monitor,
            Phase::Waking { leaves, .. } if now < leaves => Presence::Monitor,
            Phase::Waking { answers, .. } if now < answers => Presence::Absent,
            Phase::Waking { .. } | Phase::Running => Presence::Ready,
        }
    }

    /// Motor power comes, or the puck is told to return to its monitor.
    pub(crate) fn start(&mut self, now: Ticks) {
        self.phase = Phase::Starting { until: now + START_TIME };
    }

    /// The main firmware runs from time 0 on.
    pub(crate) fn run(&mut self) {
        self.phase = Phase::Running;
    }

    /// Motor power goes.
    pub(crate) fn cut(&mut self) {
        self.phase = Phase::Off;
    }

    /// SET STAT = 2 in the monitor. A puck that is already waking takes no notice.
    pub(crate) fn wake(&mut self, now: Ticks) {
        if matches!(self.phase, Phase::Starting { .. }) {
            let leaves = now + LEAVE_TIME;
            let answers = leaves + ticks(self.noise.uniform(WAKE_SECONDS.0, WAKE_SECONDS.1));
            self.phase = Phase::Waking { leaves, answers };
        }
    }
}
