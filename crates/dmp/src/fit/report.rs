//! `Report`: how well a learned movement reproduces its demonstration.

use std::vec::Vec;

use super::{Demonstration, FIT_CAPACITY, PoseSamples, WARNING_ANGLE, largest_angle_to_goal};
use crate::{Coupling, Primitive, Quaternion, Rollout, StartState};

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

/// Quality of a fit. The replay starts with the demonstrated velocity, goes in steps of the control period and is
/// compared with the smoothed demonstration; what the smoothing took away is reported beside it.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Report {
    /// One report for each row, in the order of the weights.
    pub rows: Vec<RowReport>,
    /// Orientation of each pose as a whole.
    pub orientations: Vec<OrientationReport>,
    /// Condition number of the design matrix; the weights lose about that factor of precision.
    pub condition: f64,
    /// Root mean square distance of several demonstrations from their mean, row by row in the order of the weights
    /// (m, rad); empty where one alone was learned.
    pub spread: Vec<f64>,
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
pub(super) fn replay<const D: usize, const P: usize>(
    recorded: &Demonstration<D, P>,
    demonstration: &Demonstration<D, P>,
    primitive: &Primitive<f64, D, P, FIT_CAPACITY>,
    residuals: &[f64],
    condition: f64,
) -> Report {
    let row = |&force_rms: &f64| RowReport { force_rms, ..RowReport::default() };
    let mut report = Report { rows: residuals.iter().map(row).collect(), condition, ..Report::default() };
    for ((row, raw), (_, smooth)) in recorded.linear_columns().zip(demonstration.linear_columns()) {
        let low = smooth.iter().copied().fold(f64::INFINITY, f64::min);
        let high = smooth.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        report.rows[row].extent = high - low;
        let squares: f64 = raw.iter().zip(&smooth).map(|(a, b)| (a - b) * (a - b)).sum();
        report.rows[row].removed_rms = libm::sqrt(squares / raw.len() as f64);
    }
    let Some(replayed) = roll_out(demonstration, primitive) else {
        return report;
    };
    let count = demonstration.len();
    let mut rows = std::vec![Distance::default(); residuals.len()];
    let mut turns = [Distance::default(); P];
    for k in 0..count {
        let distances = replayed.distance(demonstration, k);
        for (n, turn) in turns.iter_mut().enumerate() {
            turn.add(libm::sqrt(distances[6 * n + 3..6 * n + 6].iter().map(|e| e * e).sum()));
        }
        for (row, distance) in rows.iter_mut().zip(distances) {
            row.add(distance);
        }
    }
    for (row, distance) in report.rows.iter_mut().zip(&rows) {
        row.rms = distance.rms(count);
        row.max = distance.max;
    }
    let path = |pose: &PoseSamples| -> f64 {
        pose.orientation.windows(2).map(|pair| pair[0].conjugate().product(&pair[1]).angle()).sum()
    };
    for ((shown, replayed), turn) in demonstration.poses().iter().zip(replayed.poses()).zip(turns) {
        let largest_angle = largest_angle_to_goal(&shown.orientation);
        report.orientations.push(OrientationReport {
            rms: turn.rms(count),
            max: turn.max,
            path: path(shown),
            replayed_path: path(replayed),
            largest_angle,
            wide: largest_angle > WARNING_ANGLE,
        });
    }
    report
}

/// The samples of a run at the instants of the demonstration, between two ticks by interpolation: where the control
/// period is the longer one, its steps are those that the fit has made up for. `None` if a step is refused: the
/// demonstrated start of a checked primitive is always accepted, and so is each step with that primitive.
fn roll_out<const D: usize, const P: usize>(
    demonstration: &Demonstration<D, P>,
    primitive: &Primitive<f64, D, P, FIT_CAPACITY>,
) -> Option<Demonstration<D, P>> {
    let mut rollout = Rollout::start(primitive, &StartState::demonstrated(primitive)).ok()?;
    let (period, longest) = (demonstration.period(), primitive.control_period());
    let steps = libm::ceil(period / longest - 1e-6).max(1.0);
    let dt = if longest > period { longest } else { (period / steps).min(longest) };
    let mut tick = || rollout.step(primitive, dt, &Coupling::NONE).ok();
    let (mut ticks, mut before, mut after) = (0.0, tick()?, tick()?);
    let mut poses = [const { PoseSamples { position: Vec::new(), orientation: Vec::new() } }; P];
    let mut points = Vec::with_capacity(demonstration.len());
    for k in 0..demonstration.len() {
        let place = k as f64 * period / dt;
        while place >= ticks + 1.0 {
            (before, after) = (after, tick()?);
            ticks += 1.0;
        }
        let share = place - ticks;
        for ((samples, a), b) in poses.iter_mut().zip(&before.poses).zip(&after.poses) {
            let (from, to) = (&a.orientation.quaternion, &b.orientation.quaternion);
            let way = from.conjugate().product(&to.aligned_with(from)).rotation_vector().map(|r| share * r);
            samples.position.push(between(&a.position.x, &b.position.x, share));
            samples.orientation.push(from.product(&Quaternion::from_rotation_vector(&way)));
        }
        points.push(between(&before.points.x, &after.points.x, share));
    }
    Demonstration::new(period, poses, points).ok()
}

/// The values at this share of the way from one tick to the next.
fn between<const R: usize>(from: &[f64; R], to: &[f64; R], share: f64) -> [f64; R] {
    core::array::from_fn(|i| from[i] + share * (to[i] - from[i]))
}
