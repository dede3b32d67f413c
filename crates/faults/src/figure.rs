//! Figures of a scenario, and the bars that hold in every one.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// A measured quantity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Figure {
    /// Largest joint torque on the bus, of what the limiter grants.
    Torque,
    /// Largest step of a joint torque on the bus, of what the limiter grants in a cycle; going to zero is none.
    TorqueStep,
    /// Largest difference between the joint angles told and the true ones, mrad.
    Belief,
    /// Largest true speed of the hand while no torque is sent and no motor brakes, m/s.
    FreeSpeed,
    /// The same, from 10 ms after the end of the torque on: so long takes the request for the brakes.
    FallSpeed,
    /// Number of times the latched fault changed without a clear.
    CausesLost,
    /// Largest difference of a true joint angle from the same scenario without the faults, mrad.
    Deviation,
    /// Distance of the hand from its plan, RMS, as a multiple of that without the faults.
    Tracking,
    /// Largest distance of the hand from its plan, beyond the largest without the faults, mm.
    Astray,
    /// Largest difference of the planned hand from the same scenario without the faults, mm.
    Plan,
    /// Time from the first fault or order until the arm has left its motion, ms.
    Stop,
    /// Time from the first fault or order until every true joint is slower than 0.05 rad/s and stays so, ms: for a
    /// device that tells nothing any more.
    Still,
    /// Time from the stop until every joint is slower than 0.05 rad/s and stays so, ms.
    Rest,
    /// Largest way of a joint after the arm has left its motion, mrad.
    Travel,
    /// Largest true speed of the hand, m/s.
    HandSpeed,
    /// Largest true speed of the hand from 0.3 s after the end of the last fault on, m/s.
    LateSpeed,
    /// Largest true speed of the hand from 0.3 s after the arm has left its motion on, whatever still befalls it, m/s.
    StoppedSpeed,
    /// Way of the hand downwards from its place at time 0, mm.
    Fall,
    /// Replies that the device counts as lost.
    LostReplies,
    /// Frames that the device counts as late, malformed or foreign.
    OddFrames,
    /// Errors of the bus, as the device counts.
    BusErrors,
    /// Cycles in which only one torque frame left, as the device counts.
    TorqueMismatches,
    /// Cycles told in which the limiter cut a joint, a motor or a step, percent.
    Limited,
    /// Torque frames on the bus that are not zero while they must not be: bus off, or the safety module not ACTIVE.
    TorqueUnasked,
    /// The same, if the device may not have been told: its patience with a silent safety module is granted.
    TorqueUnheard,
}

/// Values of figures.
pub type Figures = BTreeMap<Figure, f64>;

/// Bars of every scenario, unless it has its own.
///
/// Rounding of a torque to counts of the pucks is less than 3 % of a step. Telemetry tells of an instant up to two
/// cycles past.
pub const ALWAYS: [(Figure, f64); 6] = [
    (Figure::Torque, 1.001),
    (Figure::TorqueStep, 1.04),
    (Figure::Belief, 20.0),
    (Figure::FreeSpeed, 0.25),
    (Figure::CausesLost, 0.0),
    (Figure::TorqueUnasked, 0.0),
];

/// The largest of these, 0 at least; not a number if one of them is none: no bar lets that pass.
pub(crate) fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(0.0, |largest, value| if value > largest || value.is_nan() { value } else { largest })
}

impl Figure {
    /// Word and unit.
    #[must_use]
    pub const fn label(self) -> (&'static str, &'static str) {
        match self {
            Self::Torque => ("torque", "of limit"),
            Self::TorqueStep => ("torque step", "of limit"),
            Self::Belief => ("told from true", "mrad"),
            Self::FreeSpeed => ("hand speed in free fall", "m/s"),
            Self::FallSpeed => ("hand speed in free fall after 10 ms", "m/s"),
            Self::CausesLost => ("causes overwritten", ""),
            Self::Deviation => ("off nominal", "mrad"),
            Self::Tracking => ("tracking", "of nominal"),
            Self::Astray => ("off its plan, beyond nominal", "mm"),
            Self::Plan => ("plan off nominal", "mm"),
            Self::Stop => ("stops after", "ms"),
            Self::Still => ("still after", "ms"),
            Self::Rest => ("rests after", "ms"),
            Self::Travel => ("way after the stop", "mrad"),
            Self::HandSpeed => ("hand speed", "m/s"),
            Self::LateSpeed => ("hand speed 0.3 s later", "m/s"),
            Self::StoppedSpeed => ("hand speed 0.3 s after the stop", "m/s"),
            Self::Fall => ("hand falls", "mm"),
            Self::LostReplies => ("lost replies", ""),
            Self::OddFrames => ("odd frames", ""),
            Self::BusErrors => ("bus errors", ""),
            Self::TorqueMismatches => ("torque mismatches", ""),
            Self::Limited => ("limiter acts", "% of cycles"),
            Self::TorqueUnasked => ("torque unasked for", ""),
            Self::TorqueUnheard => ("torque unasked for, unheard", ""),
        }
    }
}
