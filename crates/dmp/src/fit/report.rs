//! `Report`: how well a learned movement reproduces its demonstration.

use std::vec::Vec;

use super::{Demonstration, FIT_CAPACITY, WARNING_ANGLE};
use crate::{CONTROL_PERIOD, Coupling, Primitive, ROWS, Rollout, StartState};

/// Quality of one row.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RowReport {
    /// Largest minus smallest demonstrated value, m or rad (orientation rows: 0, see [`OrientationReport`]).
    pub extent: f64,
    /// Root mean square of the forcing term that the kernels could not follow, in the unit of the row.
    pub force_rms: f64,
    /// Root mean square distance between replay and smoothed demonstration, m or rad.
    pub rms: f64,
    /// Largest distance between replay and smoothed demonstration, m or rad.
    pub max: f64,
    /// Root mean square of what the smoothing took away (noise and trembling), m or rad.
    pub removed_rms: f64,
}

/// Quality of the orientation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OrientationReport {
    /// Root mean square angle between replay and smoothed demonstration, rad.
    pub rms: f64,
    /// Largest angle between replay and smoothed demonstration, rad.
    pub max: f64,
    /// Angle swept by the smoothed demonstration, rad.
    pub path: f64,
    /// Angle swept by the replay, rad. A replay that unwinds the other way ends well but sweeps more.
    pub replayed_path: f64,
    /// Largest angle between the smoothed demonstration and its end, rad.
    pub largest_angle: f64,
    /// The largest angle is above 150 degrees: the spring of Eq. (4) is weak there.
    pub wide: bool,
}

/// Quality of a fit. The replay starts with the demonstrated velocity and is compared with the smoothed demonstration;
/// what the smoothing took away is reported beside it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Report {
    /// Row by row: position, orientation, posture, hand.
    pub rows: [RowReport; ROWS],
    /// Orientation as a whole.
    pub orientation: OrientationReport,
    /// Condition number of the design matrix; the weights lose about that factor of precision.
    pub condition: f64,
}

/// Sum and maximum of distances.
#[derive(Clone, Copy, Default)]
struct Distance {
    squares: f64,
    max: f64,
}

impl Distance {
    fn add(&mut self, distance: f64) {
        self.squares += distance * distance;
        self.max = self.max.max(distance.abs());
    }

    fn rms(&self, count: usize) -> f64 {
        libm::sqrt(self.squares / count as f64)
    }
}

/// Rolls the primitive out and compares it with the demonstration.
pub(super) fn replay(
    recorded: &Demonstration,
    demonstration: &Demonstration,
    primitive: &Primitive<f64, FIT_CAPACITY>,
    residuals: &[f64; ROWS],
    condition: f64,
    largest_angle: f64,
) -> Report {
    let mut report = Report { condition, ..Report::default() };
    for (row, &residual) in report.rows.iter_mut().zip(residuals) {
        row.force_rms = residual;
    }
    for (row, column) in demonstration.linear_columns() {
        let low = column.iter().copied().fold(f64::INFINITY, f64::min);
        let high = column.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        report.rows[row].extent = high - low;
    }
    for ((row, raw), (_, smooth)) in recorded.linear_columns().zip(demonstration.linear_columns()) {
        let squares: f64 = raw.iter().zip(&smooth).map(|(a, b)| (a - b) * (a - b)).sum();
        report.rows[row].removed_rms = libm::sqrt(squares / raw.len() as f64);
    }
    // The demonstrated start of a checked primitive is always accepted, and so is each step with that primitive.
    let Ok(mut rollout) = Rollout::start(primitive, &StartState::demonstrated(primitive)) else {
        return report;
    };
    let steps = libm::ceil(demonstration.period() / CONTROL_PERIOD - 1e-6).max(1.0);
    let dt = demonstration.period() / steps;
    let count = demonstration.len();
    let mut rows = [Distance::default(); ROWS];
    let mut turn = Distance::default();
    let mut orientations = Vec::with_capacity(count);
    for k in 0..count {
        let Ok(row) = rollout.step(primitive, dt, &Coupling::NONE) else {
            return report;
        };
        for _ in 1..steps as usize {
            if rollout.step(primitive, dt, &Coupling::NONE).is_err() {
                return report;
            }
        }
        let demonstrated = demonstration.configuration(k);
        let linear = (0..3)
            .map(|i| (i, row.position.x[i] - demonstrated.position[i]))
            .chain((0..7).map(|i| (6 + i, row.posture.x[i] - demonstrated.posture[i])))
            .chain((0..4).map(|i| (13 + i, row.hand.x[i] - demonstrated.hand[i])));
        for (i, distance) in linear {
            rows[i].add(distance);
        }
        let q = row.orientation.quaternion;
        let e =
            q.aligned_with(&demonstrated.orientation).conjugate().product(&demonstrated.orientation).rotation_vector();
        for (i, e) in e.iter().enumerate() {
            rows[3 + i].add(*e);
        }
        turn.add(libm::sqrt(e.iter().map(|e| e * e).sum()));
        orientations.push(q);
    }
    for (row, distance) in report.rows.iter_mut().zip(&rows) {
        row.rms = distance.rms(count);
        row.max = distance.max;
    }
    let path = |orientation: &[crate::Quaternion<f64>]| -> f64 {
        orientation.windows(2).map(|pair| pair[0].conjugate().product(&pair[1]).angle()).sum()
    };
    report.orientation = OrientationReport {
        rms: turn.rms(count),
        max: turn.max,
        path: path(demonstration.orientation()),
        replayed_path: path(&orientations),
        largest_angle,
        wide: largest_angle > WARNING_ANGLE,
    };
    report
}
