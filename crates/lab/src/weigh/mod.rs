//! The weight of one arm's links, from the torques that carried it slowly through postures both ways.
//!
//! Gravity torque is linear in what [`WeightCorrection`] holds: `tau = g(q) + Y(q) p`, 28 numbers of which the torques
//! tell about a dozen combinations; the others cannot be told by statics, nor do statics need them. Every number has a
//! prior (the model, with a deviation that arms have), so that what is not measured stays the model's:
//!
//! ```text
//! p = argmin  sum ((tau - g - Y p) / sigma)^2 + sum p^2          p in units of the prior's deviation
//! ```
//! `tau` and `Y` of a posture are means over a pass up and one down at the same speed: friction, which points against
//! the motion, cancels. At rest it would not: a joint that sticks may be held by any torque within its friction.

mod tour;

pub use tour::{HALF_WAY, PASS_SECONDS, TOUR, WINDOW, is_held_out};

use control::Payload;
use control::model::{ArmModel, Frames, LinkWeight, WeightCorrection, WeightError};
use control::units::JointPositions;
use nalgebra::{SMatrix, SVector};

/// Numbers of a correction: share and shift (3) of each link.
pub(crate) const NUMBERS: usize = 28;

/// Deviation of a link's mass from the model's, as a share of it: the prior's.
const SHARE: f32 = 0.1;

/// Deviation of a link's centre of mass from the model's, along each axis, m: the prior's.
const SHIFT: f32 = 0.005;

/// Torque that the correction need not explain, N m, J1 first: bent cables, uneven friction, the fingers' posture.
const NOISE: [f64; 7] = [0.1, 0.1, 0.1, 0.1, 0.03, 0.03, 0.02];

/// Largest residual of any joint over the postures that were held out, N m RMS, of a correction that is accepted.
pub const RESIDUAL_BOUND: f64 = 0.3;

/// Least gain of a correction that is accepted: residual over the postures that were held out, N m RMS of all joints.
/// Two measurements of the same arm differ by less.
pub const LEAST_GAIN: f64 = 0.01;

/// Fewest postures to regress from, and to judge by.
pub const FEWEST: (usize, usize) = (8, 3);

/// One moment of a pass.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sample {
    /// Time, s, from a moment that samples of one pass share.
    pub time: f64,
    /// Joint angles, rad.
    pub q: [f64; 7],
    /// Joint torques that were sent, N m.
    pub torque: [f64; 7],
    /// Joint velocities, rad/s. They do not count where links are weighed, nor does the wrench.
    pub speed: [f64; 7],
    /// Wrench at the grasp point as the device tells it: force in world axes (N), torque in tool axes (N m).
    pub wrench: [f64; 6],
}

/// A posture that all joints passed upwards and then downwards.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Crossing {
    /// Samples while every joint turned in its positive direction.
    pub up: Vec<Sample>,
    /// Samples while every joint turned in its negative direction.
    pub down: Vec<Sample>,
}

/// Torque that a model leaves unexplained, N m per joint, over several postures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Residual {
    /// Root of the mean square.
    pub rms: [f64; 7],
    /// Largest magnitude.
    pub worst: [f64; 7],
}

impl Residual {
    /// Root of the mean square over postures and joints, N m.
    #[must_use]
    pub fn total(&self) -> f64 {
        (self.rms.iter().map(|rms| rms * rms).sum::<f64>() / 7.0).sqrt()
    }

    fn of(rows: &[[f64; 7]]) -> Self {
        let count = rows.len().max(1) as f64;
        let over = |joint: usize| rows.iter().map(move |row| row[joint]);
        Self {
            rms: std::array::from_fn(|joint| (over(joint).map(|r| r * r).sum::<f64>() / count).sqrt()),
            worst: std::array::from_fn(|joint| over(joint).fold(0.0, |worst: f64, r| worst.max(r.abs()))),
        }
    }
}

/// Result of a calibration.
#[derive(Debug, Clone, PartialEq)]
pub struct Weighing {
    /// The correction of the model.
    pub correction: WeightCorrection,
    /// Combinations of its 28 numbers that the torques determined better than the prior.
    pub determined: f64,
    /// Residuals of the postures that were regressed: with the correction so far, and with the new one.
    pub fitted: [Residual; 2],
    /// The same of the postures that were held out.
    pub held_out: [Residual; 2],
    /// Friction of each joint at the speed of the passes, N m: mean of half the difference between up and down.
    pub friction: [f64; 7],
}

/// Why a calibration is not accepted.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum WeighError {
    /// Too few postures were passed.
    #[error("{fitted} postures to regress from and {held_out} to judge by are too few")]
    TooFew {
        /// Postures to regress from.
        fitted: usize,
        /// Postures to judge by.
        held_out: usize,
    },
    /// A sample is not a number.
    #[error("a joint angle or torque is not a number")]
    NotANumber,
    /// The correction cannot be that of an arm.
    #[error("the torques ask for an arm that cannot be: {0}")]
    Absurd(WeightError),
    /// The correction explains the postures it has not seen no better than what counted before, by [`LEAST_GAIN`].
    #[error("no better than before: {after:.3} N m RMS over the postures held out, {before:.3} N m before")]
    NoBetter {
        /// Residual before, N m RMS.
        before: f64,
        /// Residual after, N m RMS.
        after: f64,
    },
    /// Too much remains unexplained.
    #[error("J{} keeps {rms:.3} N m RMS over the postures held out, more than {RESIDUAL_BOUND} N m", .joint + 1)]
    TooLarge {
        /// The joint, 0 for J1.
        joint: usize,
        /// Its residual, N m RMS.
        rms: f64,
    },
}

impl Weighing {
    /// Accepts the correction, or says why not.
    ///
    /// # Errors
    /// [`WeighError::TooLarge`], [`WeighError::NoBetter`]
    pub fn judge(&self) -> Result<(), WeighError> {
        let [before, after] = self.held_out;
        let (joint, rms) = after.rms.into_iter().enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or_default();
        if rms.is_nan() || rms > RESIDUAL_BOUND {
            return Err(WeighError::TooLarge { joint, rms });
        }
        let (before, after) = (before.total(), after.total());
        if before - after < LEAST_GAIN {
            return Err(WeighError::NoBetter { before, after });
        }
        Ok(())
    }
}

/// Torque and regressor of one posture, up and down in equal parts.
pub(crate) struct Balance {
    torque: [f64; 7],
    /// Gravity torque of the model, N m.
    model: [f64; 7],
    /// Gravity torque of each number of a correction at its prior's deviation, N m.
    pub(crate) regressor: SMatrix<f64, 7, NUMBERS>,
    friction: [f64; 7],
}

impl Balance {
    /// True if every number is one: what is none agrees with any bound, as a comparison has it.
    fn is_finite(&self) -> bool {
        let torques = self.torque.iter().chain(&self.model).chain(&self.friction);
        torques.chain(self.regressor.iter()).all(|number| number.is_finite())
    }
}

/// The model, and the model with one number of the correction at the prior's deviation.
pub(crate) struct Arms {
    model: ArmModel<f64>,
    deviating: Vec<ArmModel<f64>>,
}

impl Arms {
    pub(crate) fn new(payload: Payload) -> Result<Self, WeightError> {
        let deviating = (0..NUMBERS).map(|number| {
            let mut unit = SVector::<f64, NUMBERS>::zeros();
            unit[number] = 1.0;
            Ok(ArmModel::corrected(payload, &correction(payload, &unit)?))
        });
        Ok(Self { model: ArmModel::new(payload), deviating: deviating.collect::<Result<_, _>>()? })
    }

    /// Means over one pass: torque sent, gravity torque of the model, regressor.
    fn mean(&self, samples: &[Sample]) -> ([f64; 7], [f64; 7], SMatrix<f64, 7, NUMBERS>) {
        let share = 1.0 / samples.len().max(1) as f64;
        let (mut torque, mut model) = ([0.0; 7], [0.0; 7]);
        let mut regressor = SMatrix::<f64, 7, NUMBERS>::zeros();
        for sample in samples {
            let q = JointPositions::from_array(sample.q);
            // The corrected arms have the same kinematics.
            let frames = Frames::new(&self.model, &q);
            let gravity = self.model.gravity_torque(&frames).0;
            for joint in 0..7 {
                torque[joint] += share * sample.torque[joint];
                model[joint] += share * gravity[joint];
            }
            for (number, arm) in self.deviating.iter().enumerate() {
                let change = (arm.gravity_torque(&frames).0 - gravity) * share;
                let mut column = regressor.column_mut(number);
                column += change;
            }
        }
        (torque, model, regressor)
    }

    pub(crate) fn row(&self, crossing: &Crossing) -> Balance {
        let ((up, model_up, regressor_up), (down, model_down, regressor_down)) =
            (self.mean(&crossing.up), self.mean(&crossing.down));
        let middle = |a: [f64; 7], b: [f64; 7]| std::array::from_fn(|joint| 0.5 * (a[joint] + b[joint]));
        Balance {
            torque: middle(up, down),
            model: middle(model_up, model_down),
            regressor: (regressor_up + regressor_down) * 0.5,
            friction: std::array::from_fn(|joint| {
                0.5 * ((up[joint] - down[joint]) - (model_up[joint] - model_down[joint]))
            }),
        }
    }
}

/// The correction of these numbers, in units of the prior's deviation.
fn correction(payload: Payload, numbers: &SVector<f64, NUMBERS>) -> Result<WeightCorrection, WeightError> {
    let links = std::array::from_fn(|link| {
        let number = |index: usize| numbers[4 * link + index] as f32;
        LinkWeight { share: SHARE * number(0), shift: [1, 2, 3].map(|axis| SHIFT * number(axis)) }
    });
    WeightCorrection::new(payload, links)
}

/// The numbers of a correction, in units of the prior's deviation.
fn numbers(correction: &WeightCorrection) -> SVector<f64, NUMBERS> {
    SVector::from_fn(|index, _| {
        let LinkWeight { share, shift } = correction.links()[index / 4];
        match index % 4 {
            0 => f64::from(share) / f64::from(SHARE),
            axis => f64::from(shift[axis - 1]) / f64::from(SHIFT),
        }
    })
}

fn residual(rows: &[Balance], numbers: &SVector<f64, NUMBERS>) -> Residual {
    let left = rows.iter().map(|row| {
        let explained = row.regressor * numbers;
        std::array::from_fn(|joint| row.torque[joint] - row.model[joint] - explained[joint])
    });
    Residual::of(&left.collect::<Vec<_>>())
}

/// Regresses the weight of an arm with this payload, whose device computes with `present` so far. The result is to be
/// judged ([`Weighing::judge`]).
///
/// # Errors
/// [`WeighError::TooFew`], [`WeighError::NotANumber`], [`WeighError::Absurd`]
pub fn weigh(
    present: &WeightCorrection,
    payload: Payload,
    fitted: &[Crossing],
    held_out: &[Crossing],
) -> Result<Weighing, WeighError> {
    // A posture of which one pass was not seen tells nothing.
    let complete = |crossing: &&Crossing| !crossing.up.is_empty() && !crossing.down.is_empty();
    let arms = Arms::new(payload).map_err(WeighError::Absurd)?;
    let [fitted, held_out] = [fitted, held_out]
        .map(|crossings| crossings.iter().filter(complete).map(|crossing| arms.row(crossing)).collect::<Vec<_>>());
    if fitted.len() < FEWEST.0 || held_out.len() < FEWEST.1 {
        return Err(WeighError::TooFew { fitted: fitted.len(), held_out: held_out.len() });
    }
    if !fitted.iter().chain(&held_out).all(Balance::is_finite) {
        return Err(WeighError::NotANumber);
    }
    let (mut normal, mut right) = (SMatrix::<f64, NUMBERS, NUMBERS>::zeros(), SVector::<f64, NUMBERS>::zeros());
    for row in &fitted {
        for (joint, noise) in NOISE.iter().enumerate() {
            let line = row.regressor.row(joint) / *noise;
            normal += line.transpose() * line;
            right += line.transpose() * ((row.torque[joint] - row.model[joint]) / *noise);
        }
    }
    for number in 0..NUMBERS {
        // The prior: one measurement of zero, one deviation wrong.
        normal[(number, number)] += 1.0;
    }
    let factor = normal.cholesky().ok_or(WeighError::NotANumber)?;
    let found = factor.solve(&right);
    let correction = correction(payload, &found).map_err(WeighError::Absurd)?;
    let before = if present.payload() == payload { numbers(present) } else { SVector::zeros() };
    // What is judged is what is kept: the rounded numbers.
    let after = numbers(&correction);
    let count = (fitted.len() + held_out.len()) as f64;
    let all = || fitted.iter().chain(&held_out);
    Ok(Weighing {
        determined: NUMBERS as f64 - factor.inverse().trace(),
        fitted: [residual(&fitted, &before), residual(&fitted, &after)],
        held_out: [residual(&held_out, &before), residual(&held_out, &after)],
        friction: std::array::from_fn(|joint| all().map(|row| row.friction[joint]).sum::<f64>() / count),
        correction,
    })
}
