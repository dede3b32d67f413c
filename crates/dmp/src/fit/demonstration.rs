//! `Demonstration`: one recorded movement, checked, at a constant sampling period.

use core::fmt;
use std::vec::Vec;

use super::filter::ZeroPhaseFilter;
use super::orientation::make_sign_continuous;
use crate::vector::all_finite;
use crate::{Configuration, Quaternion};

/// Fewest samples of a demonstration.
const FEWEST_SAMPLES: usize = 30;

/// A joint of the posture or the hand that moves no faster (rad/s) rests, whatever its highest speed was: one that
/// never moves has only the noise of its encoder, of which no share is small. 2 mm/s at a lever of 0.1 m.
const RESTING_JOINT: f64 = 0.02;

/// Samples of pose, posture and hand; quaternions are unit and sign-continuous.
#[derive(Clone, Debug, PartialEq)]
pub struct Demonstration {
    period: f64,
    position: Vec<[f64; 3]>,
    orientation: Vec<Quaternion<f64>>,
    posture: Vec<[f64; 7]>,
    hand: Vec<[f64; 4]>,
}

/// Why samples are refused; `sample` counts from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum DemonstrationError {
    /// The sampling period is not a positive number.
    Period,
    /// Fewer than 30 samples.
    TooFew {
        /// How many there are.
        samples: usize,
    },
    /// Not every quantity has the same number of samples.
    Lengths,
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
}

impl fmt::Display for DemonstrationError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Period => f.write_str("the sampling period is not a positive number"),
            Self::TooFew { samples } => {
                write!(f, "{samples} samples are too few, {FEWEST_SAMPLES} are needed")
            }
            Self::Lengths => f.write_str("the quantities differ in their number of samples"),
            Self::NotFinite { sample } => {
                write!(f, "sample {sample} holds a value that is not a number")
            }
            Self::NotUnit { sample } => {
                write!(f, "the quaternion of sample {sample} is not of unit norm")
            }
        }
    }
}

impl core::error::Error for DemonstrationError {}

impl Demonstration {
    /// From equally long lists of samples, `period` seconds apart: position (m, world), orientation (body -> world,
    /// either sign), posture (rad), hand (rad: spread, F1, F2, F3).
    ///
    /// # Errors
    /// [`DemonstrationError`].
    pub fn new(
        period: f64,
        position: Vec<[f64; 3]>,
        mut orientation: Vec<Quaternion<f64>>,
        posture: Vec<[f64; 7]>,
        hand: Vec<[f64; 4]>,
    ) -> Result<Self, DemonstrationError> {
        if !(period > 0.0 && period.is_finite()) {
            return Err(DemonstrationError::Period);
        }
        let samples = position.len();
        if [orientation.len(), posture.len(), hand.len()] != [samples; 3] {
            return Err(DemonstrationError::Lengths);
        }
        if samples < FEWEST_SAMPLES {
            return Err(DemonstrationError::TooFew { samples });
        }
        for (sample, q) in orientation.iter_mut().enumerate() {
            let finite = all_finite(&position[sample])
                && all_finite(&q.to_array())
                && all_finite(&posture[sample])
                && all_finite(&hand[sample]);
            if !finite {
                return Err(DemonstrationError::NotFinite { sample });
            }
            *q = q.checked_unit(1e-3).ok_or(DemonstrationError::NotUnit { sample })?;
        }
        make_sign_continuous(&mut orientation);
        Ok(Self { period, position, orientation, posture, hand })
    }

    /// Number of samples.
    #[allow(clippy::len_without_is_empty, reason = "a demonstration is never empty")]
    pub fn len(&self) -> usize {
        self.position.len()
    }

    /// Sampling period, s.
    pub fn period(&self) -> f64 {
        self.period
    }

    /// From the first to the last sample, s.
    pub fn duration(&self) -> f64 {
        self.period * (self.len() - 1) as f64
    }

    /// Positions, m.
    pub fn position(&self) -> &[[f64; 3]] {
        &self.position
    }

    /// Orientations, unit and sign-continuous.
    pub fn orientation(&self) -> &[Quaternion<f64>] {
        &self.orientation
    }

    /// Postures, rad.
    pub fn posture(&self) -> &[[f64; 7]] {
        &self.posture
    }

    /// Hand joints, rad.
    pub fn hand(&self) -> &[[f64; 4]] {
        &self.hand
    }

    pub(super) fn configuration(&self, i: usize) -> Configuration<f64> {
        Configuration {
            position: self.position[i],
            orientation: self.orientation[i],
            posture: self.posture[i],
            hand: self.hand[i],
        }
    }

    /// Position, posture and hand column by column, with the number of their row of weights.
    pub(super) fn linear_columns(&self) -> impl Iterator<Item = (usize, Vec<f64>)> + '_ {
        let position = (0..3).map(|i| (i, column(&self.position, i)));
        let posture = (0..7).map(|i| (6 + i, column(&self.posture, i)));
        let hand = (0..4).map(|i| (13 + i, column(&self.hand, i)));
        position.chain(posture).chain(hand)
    }

    /// True if everything rests at the end: tool, posture and hand. At rest is what has a last speed of at most
    /// `share` of its highest one, the tool by its linear and angular speed, the joints one by one.
    pub(super) fn ends_at_rest(&self, share: f64) -> bool {
        let speed = |step: &dyn Fn(usize) -> f64| {
            let steps = (1..self.len()).map(step);
            (step(self.len() - 1), steps.fold(0.0, f64::max))
        };
        let (last, highest) = speed(&|i| {
            let square = |axis: usize| {
                let step = self.position[i][axis] - self.position[i - 1][axis];
                step * step
            };
            libm::sqrt(square(0) + square(1) + square(2))
        });
        // The sine of half the angle: as good a measure as the angle for steps this small.
        let (last_turn, highest_turn) = speed(&|i| {
            let [x, y, z] = crate::orientation_error(&self.orientation[i - 1], &self.orientation[i]);
            libm::sqrt(x * x + y * y + z * z)
        });
        let resting = RESTING_JOINT * self.period;
        let joint_rests = |at: &dyn Fn(usize) -> f64| {
            let (last, highest) = speed(&|i| (at(i) - at(i - 1)).abs());
            last <= (share * highest).max(resting)
        };
        last <= share * highest
            && last_turn <= share * highest_turn
            && (0..7).all(|joint| joint_rests(&|i| self.posture[i][joint]))
            && (0..4).all(|joint| joint_rests(&|i| self.hand[i][joint]))
    }

    /// Without noise; the same demonstration if there is no filter.
    pub(super) fn smoothed(&self, filter: Option<&ZeroPhaseFilter>) -> Self {
        let Some(filter) = filter else {
            return self.clone();
        };
        let components: Vec<[f64; 4]> = self.orientation.iter().map(Quaternion::to_array).collect();
        let orientation = smooth(filter, &components)
            .into_iter()
            .zip(&self.orientation)
            .map(|([w, x, y, z], raw)| {
                // The mean of unit quaternions is shorter than 1; two opposite ones (impossible after the sign
                // alignment unless the movement is faster than the filter) leave the raw sample.
                Quaternion::new(w, x, y, z).checked_unit(0.5).unwrap_or(*raw)
            })
            .collect();
        Self {
            period: self.period,
            position: smooth(filter, &self.position),
            orientation,
            posture: smooth(filter, &self.posture),
            hand: smooth(filter, &self.hand),
        }
    }
}

fn column<const D: usize>(rows: &[[f64; D]], i: usize) -> Vec<f64> {
    rows.iter().map(|row| row[i]).collect()
}

fn smooth<const D: usize>(filter: &ZeroPhaseFilter, rows: &[[f64; D]]) -> Vec<[f64; D]> {
    let columns: [Vec<f64>; D] = core::array::from_fn(|i| filter.apply(&column(rows, i)));
    (0..rows.len()).map(|k| core::array::from_fn(|i| columns[i][k])).collect()
}

/// Minimum-jerk values from `start` to `goal` in `samples` samples: at rest at both ends. The paper generates the finger
/// trajectories this way.
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
