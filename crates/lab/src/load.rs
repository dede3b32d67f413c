//! Mass and centre of what hangs on the wrist, mounted or held, told by the wrist sensor and by the joints.
//!
//! The device takes the weight of the model's hand off what the sensor says, and a tare that is one wrench in sensor
//! axes, whatever it was taken of. With `g` the gravity in sensor axes of a posture, what it tells is
//!
//! ```text
//! force  = m g + b        torque = p x g + c        p = m centre, from the sensor's origin
//! ```
//! where `m` and `p` are what hangs there beyond the model's hand. `b` and `c` stay the same while `g` turns: postures
//! that turn the wrist tell all ten numbers. The joints carry the same beyond the weight that their device computes
//! with; passes both ways free them of friction. They know nothing of `b` and `c`, but they also carry whatever the
//! links weigh beside that weight: they are the cross-check.

use control::model::{ArmModel, Frames, GRAVITY, HAND_CENTRE, HAND_MASS, WeightCorrection};
use control::units::{JointPositions, Vector6};
use nalgebra::{SMatrix, SVector, Vector3};

use crate::weigh::{Crossing, Sample, TOUR};

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
    /// As the joints tell it, beyond the weight that the device computes with.
    pub joints: Extra,
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

    fn of(model: &ArmModel<f64>, crossing: &Crossing) -> Self {
        let (gravity, wrench) = (Vector3::zeros(), Vector6::zeros());
        let mut row = Self { gravity, wrench, torque: SVector::zeros(), carry: SMatrix::zeros() };
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
}

/// Weighted least squares of `N` unknowns.
struct Fit<const N: usize> {
    normal: SMatrix<f64, N, N>,
    right: SVector<f64, N>,
}

impl<const N: usize> Fit<N> {
    fn new() -> Self {
        Self { normal: SMatrix::zeros(), right: SVector::zeros() }
    }

    fn add<const M: usize>(&mut self, matrix: &SMatrix<f64, M, N>, values: &SVector<f64, M>, noise: &[f64; M]) {
        for (row, noise) in noise.iter().enumerate() {
            let line = matrix.row(row) / *noise;
            self.normal += line.transpose() * line;
            self.right += line.transpose() * (values[row] / *noise);
        }
    }

    /// The unknowns and their covariance for noise as assumed; `None` where they are not told.
    fn solve(&self) -> Option<(SVector<f64, N>, SMatrix<f64, N, N>)> {
        let factor = self.normal.cholesky()?;
        Some((factor.solve(&self.right), factor.inverse()))
    }
}

/// Mass and moment at the head of the unknowns, with errors for noise that is `scale` times the assumed one.
fn extra<const N: usize>((found, covariance): &(SVector<f64, N>, SMatrix<f64, N, N>), scale: f64) -> Extra {
    let error = |number: usize| scale * covariance[(number, number)].max(0.0).sqrt();
    Extra {
        mass: found[0],
        mass_error: error(0),
        moment: [found[1], found[2], found[3]],
        moment_error: [error(1), error(2), error(3)],
    }
}

/// Measures the load on the wrist of an arm whose device computes with `weight`.
///
/// # Errors
/// [`LoadError`]
pub fn measure(weight: &WeightCorrection, crossings: &[Crossing]) -> Result<Load, LoadError> {
    if weight.payload() == control::Payload::None {
        return Err(LoadError::NoSensor);
    }
    let complete = |crossing: &&Crossing| !crossing.up.is_empty() && !crossing.down.is_empty();
    let model = ArmModel::<f64>::corrected(weight.payload(), weight);
    let rows: Vec<Means> = crossings.iter().filter(complete).map(|crossing| Means::of(&model, crossing)).collect();
    if rows.len() < FEWEST {
        return Err(LoadError::TooFew { postures: rows.len() });
    }
    if rows.iter().any(|row| !(row.wrench.sum() + row.torque.sum() + row.gravity.sum()).is_finite()) {
        return Err(LoadError::NotANumber);
    }
    let (mut sensed, mut carried) = (Fit::<10>::new(), Fit::<4>::new());
    for row in &rows {
        sensed.add(&row.sensed(), &row.wrench, &SENSOR_NOISE);
        carried.add(&row.carry, &row.torque, &JOINT_NOISE);
    }
    let (sensed, carried) =
        (sensed.solve().ok_or(LoadError::Undetermined)?, carried.solve().ok_or(LoadError::Undetermined)?);
    let count = rows.len() as f64;
    let (mut wrench_left, mut torque_left) = (Vector6::zeros(), SVector::<f64, 7>::zeros());
    for row in &rows {
        wrench_left += (row.wrench - row.sensed() * sensed.0).map(|left| left * left / count);
        torque_left += (row.torque - row.carry * carried.0).map(|left| left * left / count);
    }
    // Residuals in units of the noise, over as many as there are beyond the unknowns; less than the noise is luck.
    let scale = |left: f64, values: f64, unknowns: f64| (count * left / (count * values - unknowns)).sqrt().max(1.0);
    let in_noise = |left: &[f64], noise: &[f64]| left.iter().zip(noise).map(|(l, n)| l / (n * n)).sum::<f64>();
    let sensor_scale = scale(in_noise(wrench_left.as_slice(), &SENSOR_NOISE), 6.0, 10.0);
    let joints_scale = scale(in_noise(torque_left.as_slice(), &JOINT_NOISE), 7.0, 4.0);
    let load = Load {
        sensor: extra(&sensed, sensor_scale),
        joints: extra(&carried, joints_scale),
        sensor_left: [0, 3].map(|first| wrench_left.fixed_rows::<3>(first).sum().sqrt()),
        joints_left: torque_left.map(f64::sqrt).into(),
    };
    if load.sensor.mass_error > LARGEST_ERROR { Err(LoadError::Undetermined) } else { Ok(load) }
}
