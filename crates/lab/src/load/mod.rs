//! Mass and centre of what hangs on the wrist, mounted or held, told by the wrist sensor and by the joints.
//!
//! The device takes the weight of the model's hand off what the sensor says, and a tare that is one wrench in sensor
//! axes, whatever it was taken of. With `g` the gravity in sensor axes of a posture, what it tells is
//!
//! ```text
//! force  = m g + b        torque = p x g + c        p = m centre, from the sensor's origin
//! ```
//! where `m` and `p` are what hangs there beyond the model's hand. `b` and `c` stay the same while `g` turns: postures
//! that turn the wrist tell all ten numbers. The joints carry the same beyond the model's hand; passes both ways free
//! them of friction. They know nothing of `b` and `c`, but they also carry whatever the links weigh beside the model's:
//! these may deviate as [`crate::weigh`] assumes of arms, so the errors say how little the joints tell. They are the
//! cross-check. On an arm that was weighed they also tell what it carries beyond that weight, and tell it better.

use control::model::{ArmModel, Frames, GRAVITY, HAND_CENTRE, HAND_MASS, WeightCorrection};
use control::units::{JointPositions, Vector6};
use nalgebra::{SMatrix, SVector, Vector3};

mod verdict;

pub use verdict::{Contradiction, Finding, HAND_CENTRE_TOLERANCE, HAND_MASS_TOLERANCE};

use crate::weigh::{Arms, Crossing, NUMBERS, Sample, TOUR};

/// Postures whose passes tell the load: the first of the tour, in which the wrist turns by more than a radian each way.
pub const POSTURES: &[[f32; 7]] = TOUR.split_at(8).0;

/// Fewest postures that are regressed.
pub const FEWEST: usize = 5;

/// Mass beyond the model's hand from which on its centre is told, kg.
pub const LEAST_HELD: f64 = 0.1;

/// Error of the sensor's mean over a posture, N and N m: hysteresis, drift, inertia of the hand.
const SENSOR_NOISE: [f64; 6] = [0.05, 0.05, 0.05, 0.0015, 0.0015, 0.0015];

/// Error of a joint's mean torque, N m: bent cables, uneven friction.
const JOINT_NOISE: [f64; 7] = [0.1, 0.1, 0.1, 0.1, 0.03, 0.03, 0.02];

/// Numbers of the links that may deviate beside the load: all but the last, which carries it.
const LINK_NUMBERS: usize = NUMBERS - 4;

/// Numbers that the joints tell: mass and moment, then the links.
const CARRIED_NUMBERS: usize = 4 + LINK_NUMBERS;

/// Largest standard error of a mass, in kg: postures that are too much alike do not tell it from the tare.
const LARGEST_ERROR: f64 = 0.1;

/// Mass and first moment beyond the model's hand, from one kind of measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extra {
    /// Mass, kg.
    pub mass: f64,
    /// Its standard error, kg.
    pub mass_error: f64,
    /// First moment about the sensor's origin, sensor axes, kg m.
    pub moment: [f64; 3],
    /// Its standard errors, kg m.
    pub moment_error: [f64; 3],
    /// Standard errors of mass and moment without what is wrong in every measurement of one arm alike, kg and kg m.
    pub repeat_error: [f64; 4],
}

/// A body on the wrist.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Body {
    /// Mass, kg.
    pub mass: f64,
    /// Centre of mass from the sensor's origin, sensor axes, m.
    pub centre: [f64; 3],
}

/// Result of a measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Load {
    /// As the wrist sensor tells it.
    pub sensor: Extra,
    /// As the joints tell it, whose links may deviate from the model's.
    pub joints: Extra,
    /// Load of the joints beyond the weight that the device computes with, if that was measured.
    pub since_weighed: Option<Extra>,
    /// Residual of the sensor's fit: force, N RMS, and torque, N m RMS.
    pub sensor_left: [f64; 2],
    /// Residual of the joints' fit, N m RMS, J1 first.
    pub joints_left: [f64; 7],
}

/// Why the load cannot be told.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum LoadError {
    /// Nothing measures at the wrist.
    #[error("the arm has no wrist sensor")]
    NoSensor,
    /// Too few postures were passed.
    #[error("{postures} postures are too few to tell what the wrist carries")]
    TooFew {
        /// Their number.
        postures: usize,
    },
    /// A sample is not a number.
    #[error("an angle, torque or force is not a number")]
    NotANumber,
    /// The wrist was turned too little, or what it carries moved.
    #[error("the postures do not tell the mass from the tare: its standard error is above 0.1 kg")]
    Undetermined,
}

impl Extra {
    /// All that hangs on the sensor: the model's hand and what is beyond it.
    #[must_use]
    pub fn hanging(&self) -> Body {
        let mass = HAND_MASS + self.mass;
        Body { mass, centre: std::array::from_fn(|axis| (HAND_MASS * HAND_CENTRE[axis] + self.moment[axis]) / mass) }
    }

    /// The body that is held or mounted beyond the model's hand; `None` where it is too light to have a centre.
    #[must_use]
    pub fn held(&self) -> Option<Body> {
        let centre = self.moment.map(|moment| moment / self.mass);
        (self.mass >= LEAST_HELD).then_some(Body { mass: self.mass, centre })
    }

    /// Standard error of the centre of such a body, m, along the axis where it is largest.
    #[must_use]
    pub fn centre_error(&self, body: &Body) -> f64 {
        let of = |axis: usize| self.moment_error[axis].hypot(body.centre[axis] * self.mass_error) / body.mass;
        (0..3).map(of).fold(0.0, f64::max)
    }

    /// The difference to another measurement of the same arm, whose errors that are always there cancel.
    #[must_use]
    pub fn beyond(&self, other: &Self) -> Self {
        let repeat_error: [f64; 4] = std::array::from_fn(|n| self.repeat_error[n].hypot(other.repeat_error[n]));
        let [mass_error, x, y, z] = repeat_error;
        Self {
            mass: self.mass - other.mass,
            mass_error,
            moment: std::array::from_fn(|axis| self.moment[axis] - other.moment[axis]),
            moment_error: [x, y, z],
            repeat_error,
        }
    }
}

impl Body {
    /// Mass of this one beyond another's (kg), and the distance of their centres (m).
    #[must_use]
    pub fn beside(&self, other: &Self) -> (f64, f64) {
        let apart = Vector3::from(self.centre) - Vector3::from(other.centre);
        (self.mass - other.mass, apart.norm())
    }
}

/// Means of one posture, both ways in equal parts.
#[derive(Clone, Copy)]
struct Means {
    /// Gravity in sensor axes, m/s^2.
    gravity: Vector3<f64>,
    /// Force and torque in sensor axes.
    wrench: Vector6<f64>,
    /// Joint torques beyond the model's.
    torque: SVector<f64, 7>,
    /// Joint torques that carry a kilogram at the sensor's origin, and a kilogram metre along each axis.
    carry: SMatrix<f64, 7, 4>,
    /// Joint torques of deviations of the links short of the last, of the size that arms have them.
    links: SMatrix<f64, 7, LINK_NUMBERS>,
}

impl Means {
    /// Adds a share of one sample.
    fn add(&mut self, model: &ArmModel<f64>, sample: &Sample, share: f64) {
        let frames = Frames::new(model, &JointPositions::from_array(sample.q));
        let (to_world, arm) = (frames.sensor_to_world(), frames.tool_to_sensor());
        let gravity = Vector3::from(GRAVITY);
        let [fx, fy, fz, nx, ny, nz] = sample.wrench;
        let force = Vector3::new(fx, fy, fz);
        let torque = frames.tool_to_world() * Vector3::new(nx, ny, nz) - arm.cross(&force);
        let (force, torque) = (to_world.tr_mul(&force), to_world.tr_mul(&torque));
        self.gravity += to_world.tr_mul(&gravity) * share;
        self.wrench += Vector6::new(force.x, force.y, force.z, torque.x, torque.y, torque.z) * share;
        self.torque += (SVector::from(sample.torque) - model.gravity_torque(&frames).0) * share;
        let jacobian = frames.jacobian();
        let wrench = |force: Vector3<f64>, torque: Vector3<f64>| {
            jacobian.transpose_times(&Vector6::new(force.x, force.y, force.z, torque.x, torque.y, torque.z))
        };
        for number in 0..4 {
            let carried = match number {
                0 => wrench(gravity, arm.cross(&gravity)),
                axis => wrench(Vector3::zeros(), to_world.column(axis - 1).cross(&gravity)),
            };
            let mut column = self.carry.column_mut(number);
            column -= carried * share;
        }
    }

    fn of(model: &ArmModel<f64>, links: SMatrix<f64, 7, LINK_NUMBERS>, crossing: &Crossing) -> Self {
        let (gravity, wrench) = (Vector3::zeros(), Vector6::zeros());
        let mut row = Self { gravity, wrench, torque: SVector::zeros(), carry: SMatrix::zeros(), links };
        for samples in [&crossing.up, &crossing.down] {
            let share = 0.5 / samples.len().max(1) as f64;
            samples.iter().for_each(|sample| row.add(model, sample, share));
        }
        row
    }

    /// The sensor's six equations: mass, moment, and the tare's force and torque.
    fn sensed(&self) -> SMatrix<f64, 6, 10> {
        let mut matrix = SMatrix::<f64, 6, 10>::zeros();
        matrix.fixed_view_mut::<3, 1>(0, 0).copy_from(&self.gravity);
        matrix.fixed_view_mut::<3, 3>(3, 1).copy_from(&-self.gravity.cross_matrix());
        matrix.fixed_view_mut::<6, 6>(0, 4).fill_with_identity();
        matrix
    }

    /// The joints' seven equations: mass and moment, and the links.
    fn carried(&self) -> SMatrix<f64, 7, CARRIED_NUMBERS> {
        let mut matrix = SMatrix::<f64, 7, CARRIED_NUMBERS>::zeros();
        matrix.fixed_view_mut::<7, 4>(0, 0).copy_from(&self.carry);
        matrix.fixed_view_mut::<7, LINK_NUMBERS>(0, 4).copy_from(&self.links);
        matrix
    }
}

/// Weighted least squares of `N` unknowns.
struct LeastSquares<const N: usize> {
    normal: SMatrix<f64, N, N>,
    right: SVector<f64, N>,
    /// The assumption of the unknowns beforehand, as a share of `normal`.
    prior: SMatrix<f64, N, N>,
}

/// Unknowns with the covariance of their errors.
struct Solution<const N: usize> {
    found: SVector<f64, N>,
    covariance: SMatrix<f64, N, N>,
    /// That of what the noise alone does to them.
    repeat: SMatrix<f64, N, N>,
}

impl<const N: usize> LeastSquares<N> {
    /// Unknowns from `known_from` on are zero but for one of their units.
    fn new(known_from: usize) -> Self {
        let mut prior = SMatrix::zeros();
        for number in known_from..N {
            prior[(number, number)] = 1.0;
        }
        Self { normal: prior, right: SVector::zeros(), prior }
    }

    fn add<const M: usize>(&mut self, matrix: &SMatrix<f64, M, N>, values: &SVector<f64, M>, noise: &[f64; M]) {
        for (row, noise) in noise.iter().enumerate() {
            let line = matrix.row(row) / *noise;
            self.normal += line.transpose() * line;
            self.right += line.transpose() * (values[row] / *noise);
        }
    }

    /// The unknowns for noise as assumed; `None` where they are not told.
    fn solve(&self) -> Option<Solution<N>> {
        let factor = self.normal.cholesky()?;
        let covariance = factor.inverse();
        let repeat = covariance * (self.normal - self.prior) * covariance;
        Some(Solution { found: factor.solve(&self.right), covariance, repeat })
    }
}

impl<const N: usize> Solution<N> {
    /// Mass and moment at the head of the unknowns, with errors for noise that is `scale` times the assumed one.
    fn extra(&self, scale: f64) -> Extra {
        let error = |of: &SMatrix<f64, N, N>, number: usize| scale * of[(number, number)].max(0.0).sqrt();
        let moment = |axis: usize| error(&self.covariance, axis + 1);
        Extra {
            mass: self.found[0],
            mass_error: error(&self.covariance, 0),
            moment: [self.found[1], self.found[2], self.found[3]],
            moment_error: std::array::from_fn(moment),
            repeat_error: std::array::from_fn(|number| error(&self.repeat, number)),
        }
    }
}

/// The means of every posture that was passed both ways, beside this weight; `deviate`: the links may, beside it.
fn rows(weight: &WeightCorrection, deviate: bool, crossings: &[Crossing]) -> Result<Vec<Means>, LoadError> {
    let complete = |crossing: &&Crossing| !crossing.up.is_empty() && !crossing.down.is_empty();
    let model = ArmModel::<f64>::corrected(weight.payload(), weight);
    // The unit deviations of the prior are within what a correction may have.
    let arms = Arms::new(weight.payload()).map_err(|_| LoadError::NotANumber)?;
    let of = |crossing: &Crossing| {
        let links = if deviate {
            arms.row(crossing).regressor.fixed_columns::<LINK_NUMBERS>(0).into_owned()
        } else {
            // What weighing left of the links is within the noise.
            SMatrix::zeros()
        };
        Means::of(&model, links, crossing)
    };
    let rows: Vec<Means> = crossings.iter().filter(complete).map(of).collect();
    if rows.len() < FEWEST {
        return Err(LoadError::TooFew { postures: rows.len() });
    }
    if rows.iter().any(|row| !(row.wrench.sum() + row.torque.sum() + row.gravity.sum()).is_finite()) {
        return Err(LoadError::NotANumber);
    }
    Ok(rows)
}

/// Factor on the assumed noise for a mean square residual of each value: over as many values as there are beyond the
/// unknowns, in units of the noise. Less than the noise is luck.
fn noise_scale(left: &[f64], noise: &[f64], postures: f64, unknowns: f64) -> f64 {
    let in_noise: f64 = left.iter().zip(noise).map(|(left, noise)| left / (noise * noise)).sum();
    (postures * in_noise / (postures * noise.len() as f64 - unknowns)).sqrt().max(1.0)
}

/// Load by the joints, and the residual of each, N m RMS.
fn carried(rows: &[Means]) -> Option<(Extra, [f64; 7])> {
    let mut fit = LeastSquares::<CARRIED_NUMBERS>::new(4);
    rows.iter().for_each(|row| fit.add(&row.carried(), &row.torque, &JOINT_NOISE));
    let (told, count) = (fit.solve()?, rows.len() as f64);
    let left = rows.iter().fold(SVector::<f64, 7>::zeros(), |sum, row| {
        sum + (row.torque - row.carried() * told.found).map(|left| left * left / count)
    });
    let scale = noise_scale(left.as_slice(), &JOINT_NOISE, count, 4.0);
    Some((told.extra(scale), left.map(f64::sqrt).into()))
}

/// Measures the load on the wrist of an arm whose device computes with `weight`.
///
/// # Errors
/// [`LoadError`]
pub fn measure(weight: &WeightCorrection, crossings: &[Crossing]) -> Result<Load, LoadError> {
    if weight.payload() == control::Payload::None {
        return Err(LoadError::NoSensor);
    }
    let model = WeightCorrection::none(weight.payload());
    let rows_by_model = rows(&model, true, crossings)?;
    let mut sensed = LeastSquares::<10>::new(10);
    rows_by_model.iter().for_each(|row| sensed.add(&row.sensed(), &row.wrench, &SENSOR_NOISE));
    let sensed = sensed.solve().ok_or(LoadError::Undetermined)?;
    let count = rows_by_model.len() as f64;
    let left = rows_by_model.iter().fold(Vector6::<f64>::zeros(), |sum, row| {
        sum + (row.wrench - row.sensed() * sensed.found).map(|left| left * left / count)
    });
    // What the postures cannot tell; what moves or touches something is told by the residual.
    if sensed.extra(1.0).mass_error > LARGEST_ERROR {
        return Err(LoadError::Undetermined);
    }
    let (joints, joints_left) = carried(&rows_by_model).ok_or(LoadError::Undetermined)?;
    let since_weighed = if *weight == model {
        None
    } else {
        Some(carried(&rows(weight, false, crossings)?).ok_or(LoadError::Undetermined)?.0)
    };
    Ok(Load {
        sensor: sensed.extra(noise_scale(left.as_slice(), &SENSOR_NOISE, count, 10.0)),
        joints,
        since_weighed,
        sensor_left: [0, 3].map(|first| left.fixed_rows::<3>(first).sum().sqrt()),
        joints_left,
    })
}
