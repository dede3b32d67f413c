//! `Demonstration`: one recorded movement, checked, at a constant sampling period.

use core::fmt;
use std::vec::Vec;

use super::filter::ZeroPhaseFilter;
use super::orientation::make_sign_continuous;
use crate::vector::all_finite;
use crate::{Configuration, Pose, Quaternion};

/// Fewest samples of a demonstration.
const FEWEST_SAMPLES: usize = 30;

/// A point row (1/s) or orientation (rad/s) that moves no faster rests, whatever its highest speed was: one that
/// never moves has only the noise of its sensor, of which no share is small. 2 mm/s at a lever of 0.1 m.
const RESTING_SPEED: f64 = 0.02;

/// The same of a position, m/s.
const RESTING_LINEAR_SPEED: f64 = 0.002;

/// Samples of one pose.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseSamples {
    /// Positions in the world frame, m.
    pub position: Vec<[f64; 3]>,
    /// Orientations, body -> world, either sign.
    pub orientation: Vec<Quaternion<f64>>,
}

/// Samples of `P` poses and `D` point rows; quaternions are unit and sign-continuous.
#[derive(Clone, Debug, PartialEq)]
pub struct Demonstration<const D: usize, const P: usize> {
    period: f64,
    poses: [PoseSamples; P],
    points: Vec<[f64; D]>,
}

/// Reason for which samples are refused; `sample` counts from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum DemonstrationError {
    /// The sampling period is not a positive number.
    Period,
    /// Fewer than 30 samples.
    TooFew {
        /// Number of samples.
        samples: usize,
    },
    /// Not every quantity, or not every demonstration, has what the others have: samples, or the sampling period.
    Lengths,
    /// No demonstration at all.
    None,
    /// A value of this sample is NaN or infinite.
    NotFinite {
        /// Index of the sample.
        sample: usize,
    },
    /// The quaternion of this sample is not of unit norm (within 1e-3).
    NotUnit {
        /// Index of the sample.
        sample: usize,
    },
    /// At this sample of their mean, orientations of several demonstrations are opposite to each other.
    Opposite {
        /// Index of the sample.
        sample: usize,
    },
}

impl fmt::Display for DemonstrationError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Period => f.write_str("the sampling period is not a positive number"),
            Self::TooFew { samples } => {
                write!(f, "{samples} samples are too few, {FEWEST_SAMPLES} are needed")
            }
            Self::Lengths => f.write_str("the quantities differ in their number of samples or their period"),
            Self::None => f.write_str("there is no demonstration"),
            Self::NotFinite { sample } => {
                write!(f, "sample {sample} holds a value that is not a number")
            }
            Self::NotUnit { sample } => {
                write!(f, "the quaternion of sample {sample} is not of unit norm")
            }
            Self::Opposite { sample } => {
                write!(f, "the orientations of sample {sample} are too far apart to have a mean")
            }
        }
    }
}

impl core::error::Error for DemonstrationError {}

impl<const D: usize, const P: usize> Demonstration<D, P> {
    /// From equally long lists of samples, `period` seconds apart. Poses alone need no list of empty point rows.
    ///
    /// There are no times: a recording with its own is to be interpolated to even ones first.
    ///
    /// # Errors
    /// [`DemonstrationError`].
    pub fn new(
        period: f64,
        mut poses: [PoseSamples; P],
        mut points: Vec<[f64; D]>,
    ) -> Result<Self, DemonstrationError> {
        if !(period > 0.0 && period.is_finite()) {
            return Err(DemonstrationError::Period);
        }
        if D == 0 && points.is_empty() {
            points.resize(poses.first().map_or(0, |pose| pose.position.len()), [0.0; D]);
        }
        let samples = points.len();
        if poses.iter().any(|pose| [pose.position.len(), pose.orientation.len()] != [samples; 2]) {
            return Err(DemonstrationError::Lengths);
        }
        if samples < FEWEST_SAMPLES {
            return Err(DemonstrationError::TooFew { samples });
        }
        if let Some(sample) = points.iter().position(|row| !all_finite(row)) {
            return Err(DemonstrationError::NotFinite { sample });
        }
        for pose in &mut poses {
            for (sample, (x, q)) in pose.position.iter().zip(&mut pose.orientation).enumerate() {
                if !(all_finite(x) && all_finite(&q.to_array())) {
                    return Err(DemonstrationError::NotFinite { sample });
                }
                *q = q.checked_unit(1e-3).ok_or(DemonstrationError::NotUnit { sample })?;
            }
            make_sign_continuous(&mut pose.orientation);
        }
        Ok(Self { period, poses, points })
    }

    /// Several demonstrations of one movement as one: resampled on their phase to the mean of their durations, and
    /// averaged. Beside it the root mean square distance from that mean, row by row in the order of the weights
    /// (orientation rows: rotation vector in the body frame, rad).
    ///
    /// Between samples it is interpolated linearly; what that adds lies above any usable cut-off of the fit's filter.
    ///
    /// # Errors
    /// [`DemonstrationError::None`], [`DemonstrationError::Lengths`] for different sampling periods,
    /// [`DemonstrationError::Opposite`] where orientations are opposite to each other.
    pub fn mean(all: &[Self]) -> Result<(Self, Vec<f64>), DemonstrationError> {
        let first = all.first().ok_or(DemonstrationError::None)?;
        if all.iter().any(|one| one.period != first.period) {
            return Err(DemonstrationError::Lengths);
        }
        let intervals = all.iter().map(|one| one.len() - 1).sum::<usize>() as f64 / all.len() as f64;
        let count = libm::round(intervals) as usize + 1;
        let share = 1.0 / all.len() as f64;
        let resampled: Vec<Self> = all.iter().map(|one| one.resampled(count, first)).collect();
        let mut mean = resampled[0].clone();
        let mut squares = std::vec![0.0; 6 * P + D];
        for k in 0..count {
            mean.points[k] =
                core::array::from_fn(|i| share * resampled.iter().map(|one| one.points[k][i]).sum::<f64>());
            for n in 0..P {
                let at = |one: &Self| one.poses[n].orientation[k].to_array();
                mean.poses[n].position[k] = core::array::from_fn(|i| {
                    share * resampled.iter().map(|one| one.poses[n].position[k][i]).sum::<f64>()
                });
                let [w, x, y, z] =
                    core::array::from_fn(|i| share * resampled.iter().map(|one| at(one)[i]).sum::<f64>());
                let q = Quaternion::new(w, x, y, z).checked_unit(0.5);
                mean.poses[n].orientation[k] = q.ok_or(DemonstrationError::Opposite { sample: k })?;
            }
            let rows = resampled.iter().map(|one| one.distance(&mean, k));
            rows.for_each(|row| squares.iter_mut().zip(row).for_each(|(sum, x)| *sum += x * x));
        }
        let spread = squares.iter().map(|sum| libm::sqrt(sum * share / count as f64)).collect();
        Ok((mean, spread))
    }

    /// `count` samples over the same movement, signs of the orientations as those of `like` at its start.
    fn resampled(&self, count: usize, like: &Self) -> Self {
        let last = self.len() - 1;
        let places: Vec<(usize, f64)> = (0..count)
            .map(|k| {
                let place = k as f64 * last as f64 / (count - 1) as f64;
                let left = (place as usize).min(last - 1);
                (left, place - left as f64)
            })
            .collect();
        fn between<const R: usize>(rows: &[[f64; R]], (left, share): (usize, f64)) -> [f64; R] {
            core::array::from_fn(|i| rows[left][i] + share * (rows[left + 1][i] - rows[left][i]))
        }
        let poses = core::array::from_fn(|n| {
            let pose = &self.poses[n];
            let turned = pose.orientation[0].dot(&like.poses[n].orientation[0]) < 0.0;
            let orientation = places.iter().map(|&(left, share)| {
                let (a, b) = (&pose.orientation[left], &pose.orientation[left + 1]);
                let way = a.conjugate().product(b).rotation_vector().map(|r| share * r);
                let q = a.product(&Quaternion::from_rotation_vector(&way));
                if turned { q.negated() } else { q }
            });
            PoseSamples {
                position: places.iter().map(|place| between(&pose.position, *place)).collect(),
                orientation: orientation.collect(),
            }
        });
        Self { period: self.period, poses, points: places.iter().map(|place| between(&self.points, *place)).collect() }
    }

    /// Distance from another one at a sample, row by row in the order of the weights.
    pub(super) fn distance(&self, other: &Self, k: usize) -> Vec<f64> {
        let mut rows = Vec::with_capacity(6 * P + D);
        for (pose, other) in self.poses.iter().zip(&other.poses) {
            rows.extend((0..3).map(|i| pose.position[k][i] - other.position[k][i]));
            let (from, to) = (&other.orientation[k], pose.orientation[k]);
            rows.extend(from.conjugate().product(&to.aligned_with(from)).rotation_vector());
        }
        rows.extend((0..D).map(|i| self.points[k][i] - other.points[k][i]));
        rows
    }

    /// Number of samples.
    #[allow(clippy::len_without_is_empty, reason = "a demonstration is never empty")]
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Sampling period, s.
    pub fn period(&self) -> f64 {
        self.period
    }

    /// From the first to the last sample, s.
    pub fn duration(&self) -> f64 {
        self.period * (self.len() - 1) as f64
    }

    /// Samples of the poses; the orientations are unit and sign-continuous.
    pub fn poses(&self) -> &[PoseSamples; P] {
        &self.poses
    }

    /// Samples of the point rows.
    pub fn points(&self) -> &[[f64; D]] {
        &self.points
    }

    pub(super) fn configuration(&self, i: usize) -> Configuration<f64, D, P> {
        Configuration {
            poses: core::array::from_fn(|n| Pose {
                position: self.poses[n].position[i],
                orientation: self.poses[n].orientation[i],
            }),
            points: self.points[i],
        }
    }

    /// Positions and point rows column by column, with the number of their row of weights.
    pub(super) fn linear_columns(&self) -> impl Iterator<Item = (usize, Vec<f64>)> + '_ {
        let position = move |n: usize| (0..3).map(move |i| (6 * n + i, column(&self.poses[n].position, i)));
        (0..P).flat_map(position).chain((0..D).map(|i| (6 * P + i, column(&self.points, i))))
    }

    /// True if everything rests at the end. At rest is what has a last speed of at most `share` of its highest one,
    /// poses by their linear and angular speed, point rows one by one.
    pub(super) fn ends_at_rest(&self, share: f64) -> bool {
        let speed = |step: &dyn Fn(usize) -> f64| {
            let steps = (1..self.len()).map(step);
            (step(self.len() - 1), steps.fold(0.0, f64::max))
        };
        let resting = RESTING_SPEED * self.period;
        let pose_rests = |pose: &PoseSamples| {
            let (last, highest) = speed(&|i| {
                let square = |axis: usize| {
                    let step = pose.position[i][axis] - pose.position[i - 1][axis];
                    step * step
                };
                libm::sqrt(square(0) + square(1) + square(2))
            });
            // The sine of half the angle: as good a measure as the angle for steps this small.
            let (last_turn, highest_turn) = speed(&|i| {
                let [x, y, z] = crate::orientation_error(&pose.orientation[i - 1], &pose.orientation[i]);
                libm::sqrt(x * x + y * y + z * z)
            });
            last <= (share * highest).max(RESTING_LINEAR_SPEED * self.period)
                && last_turn <= (share * highest_turn).max(0.5 * resting)
        };
        let point_rests = |row: usize| {
            let (last, highest) = speed(&|i| (self.points[i][row] - self.points[i - 1][row]).abs());
            last <= (share * highest).max(resting)
        };
        self.poses.iter().all(pose_rests) && (0..D).all(point_rests)
    }

    /// Without noise; the same demonstration if there is no filter.
    pub(super) fn smoothed(&self, filter: Option<&ZeroPhaseFilter>) -> Self {
        let Some(filter) = filter else {
            return self.clone();
        };
        let pose = |pose: &PoseSamples| {
            let components: Vec<[f64; 4]> = pose.orientation.iter().map(Quaternion::to_array).collect();
            let orientation = smooth(filter, &components)
                .into_iter()
                .zip(&pose.orientation)
                .map(|([w, x, y, z], raw)| {
                    // The mean of unit quaternions is shorter than 1; two opposite ones (impossible after the sign
                    // alignment unless the movement is faster than the filter) leave the raw sample.
                    Quaternion::new(w, x, y, z).checked_unit(0.5).unwrap_or(*raw)
                })
                .collect();
            PoseSamples { position: smooth(filter, &pose.position), orientation }
        };
        Self { period: self.period, poses: self.poses.each_ref().map(pose), points: smooth(filter, &self.points) }
    }
}

impl Demonstration<1, 0> {
    /// Of one row alone.
    ///
    /// # Errors
    /// [`DemonstrationError`].
    pub fn of_row(period: f64, samples: &[f64]) -> Result<Self, DemonstrationError> {
        Self::new(period, [], samples.iter().map(|x| [*x]).collect())
    }
}

fn column<const D: usize>(rows: &[[f64; D]], i: usize) -> Vec<f64> {
    rows.iter().map(|row| row[i]).collect()
}

fn smooth<const D: usize>(filter: &ZeroPhaseFilter, rows: &[[f64; D]]) -> Vec<[f64; D]> {
    let columns: [Vec<f64>; D] = core::array::from_fn(|i| filter.apply(&column(rows, i)));
    (0..rows.len()).map(|k| core::array::from_fn(|i| columns[i][k])).collect()
}

/// Minimum-jerk values from `start` to `goal` in `samples` samples: at rest at both ends. The paper generates the
/// finger trajectories this way.
pub fn minimum_jerk<const D: usize>(start: [f64; D], goal: [f64; D], samples: usize) -> Vec<[f64; D]> {
    let intervals = samples.saturating_sub(1).max(1) as f64;
    (0..samples)
        .map(|k| {
            let u = k as f64 / intervals;
            let blend = u * u * u * (10.0 + u * (6.0 * u - 15.0));
            core::array::from_fn(|i| start[i] + (goal[i] - start[i]) * blend)
        })
        .collect()
}
