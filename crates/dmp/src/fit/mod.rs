//! Learning a primitive from one demonstration (host only, f64).
//!
//! The demonstration is smoothed without phase shift and differentiated, Eqs. (1) and (6) are solved for the forcing
//! term they would have needed, and the weights of Eq. (2) are fitted to it by one ridge regression. The basis depends
//! only on the phase, so all 17 rows share one matrix and one factorisation. The learned movement is then rolled out
//! and compared with the demonstration. Learning keeps no state: the same demonstration gives the same weights.

mod demonstration;
mod derivative;
mod expected;
mod filter;
mod orientation;
mod report;
mod ridge;
mod statistics;

use std::vec::Vec;

pub use demonstration::{Demonstration, DemonstrationError, minimum_jerk};
pub use derivative::{first_derivative, second_derivative};
pub use expected::{FEWEST_TRIALS, WEIGHT_RANGE, expected_wrench, weights_from_spread};
pub use filter::ZeroPhaseFilter;
pub use orientation::{angular_velocity, largest_angle_to_goal, make_sign_continuous};
pub use report::{OrientationReport, Report, RowReport};
pub use statistics::{PhaseStatistics, experience, phase_statistics};

use core::fmt;

use crate::{
    Basis, CONTROL_PERIOD, CanonicalSystem, Configuration, Hemisphere, ORIENTATION_ROWS, OrientationError,
    POSITION_ROWS, Primitive, PrimitiveError, PrimitiveTables, Quaternion, ROWS, RotationChart, Scalar, Velocity,
    orientation_error,
};
use ridge::Ridge;

/// Most kernels a fit can use.
pub const FIT_CAPACITY: usize = 200;
/// From this angle to the goal on (rad, 150 degrees) the report warns about the error of Eq. (4).
pub const WARNING_ANGLE: f64 = 150.0 * core::f64::consts::PI / 180.0;
/// Beyond this angle to the goal (rad, 175 degrees) the error of Eq. (4) is refused.
pub const LARGEST_ANGLE: f64 = 175.0 * core::f64::consts::PI / 180.0;
/// A demonstration whose last speed is below this share of its highest one ends at rest.
const REST_SPEED_SHARE: f64 = 0.15;
/// How long the plan of a demonstration that ends at rest is told to stay at its goal, as a share of the duration.
const REST_SHARE: f64 = 0.5;
/// Half a control period, s.
const HALF_TICK: f64 = 0.5 * CONTROL_PERIOD;
/// Beyond this angle to the goal (rad, 359 degrees) even rotation vectors are refused: the sign of the start could not tell which way to turn.
pub const LARGEST_ROTATION_VECTOR: f64 = 359.0 * core::f64::consts::PI / 180.0;

/// How to learn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitOptions {
    /// Number of kernels N.
    pub kernel_count: usize,
    /// Decay of the phase.
    pub alpha: f64,
    /// Value of a kernel at the next centre.
    pub activation: f64,
    /// Stiffness K of position, orientation, posture, hand; the damping is critical.
    pub stiffness: [f64; 4],
    /// Orientation error that drives the spring.
    pub orientation_error: OrientationError,
    /// Cut-off of the zero-phase filter, Hz; `None` for data without noise.
    pub cutoff: Option<f64>,
    /// Ridge relative to the mean diagonal of the normal equations.
    pub ridge: f64,
}

impl Default for FitOptions {
    /// 50 kernels, s(tau) = 0.01, K = 200, 7.5 Hz, ridge 1e-8.
    fn default() -> Self {
        Self {
            kernel_count: 50,
            alpha: CanonicalSystem::<f64>::DEFAULT_ALPHA,
            activation: 0.7,
            stiffness: [200.0; 4],
            orientation_error: OrientationError::Quaternion,
            cutoff: Some(7.5),
            ridge: 1e-8,
        }
    }
}

/// Why a demonstration cannot be learned.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum FitError {
    /// Fewer than two kernels, more than [`FIT_CAPACITY`], or an unusable phase or activation.
    Basis,
    /// The cut-off is not between 0 and half the sampling rate.
    Cutoff,
    /// The ridge is not a positive number.
    Ridge,
    /// The orientation turns too far from the goal for the chosen error (angle in rad). Up to 359 degrees
    /// [`OrientationError::RotationVector`] can follow.
    TurnsTooFar {
        /// Largest angle to the goal, rad.
        angle: f64,
    },
    /// The normal equations could not be factorised.
    Singular,
    /// The learned tables are refused as a primitive.
    Primitive(PrimitiveError),
}

impl fmt::Display for FitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Basis => {
                write!(f, "the number of kernels must be 2..={FIT_CAPACITY}, with a usable phase and activation")
            }
            Self::Cutoff => f.write_str("the cut-off must lie between 0 and half the sampling rate"),
            Self::Ridge => f.write_str("the ridge must be a positive number"),
            Self::TurnsTooFar { angle } => write!(
                f,
                "the orientation turns {:.0} degrees away from the goal, further than the chosen \
                 orientation error can follow",
                angle.to_degrees()
            ),
            Self::Singular => f.write_str("the normal equations are singular"),
            Self::Primitive(error) => write!(f, "the learned primitive is unusable: {error}"),
        }
    }
}

impl core::error::Error for FitError {}

impl From<PrimitiveError> for FitError {
    fn from(error: PrimitiveError) -> Self {
        Self::Primitive(error)
    }
}

/// A learned movement: tables for [`Primitive::new`] and a report on their quality.
#[derive(Clone, Debug, PartialEq)]
pub struct Learned {
    /// Duration tau, s.
    pub duration: f64,
    /// How it was learned.
    pub options: FitOptions,
    /// Damping D of position, orientation, posture, hand.
    pub damping: [f64; 4],
    /// Weights, row-major `[ROWS][kernel_count]`.
    pub weights: Vec<f64>,
    /// Start of the smoothed demonstration.
    pub start: Configuration<f64>,
    /// Goal = end of the smoothed demonstration.
    pub goal: Configuration<f64>,
    /// Velocity at the start.
    pub start_velocity: Velocity<f64>,
    /// Quality.
    pub report: Report,
}

impl Learned {
    /// The tables without feedback and expectation.
    pub fn tables(&self) -> PrimitiveTables<'_, f64> {
        self.tables_with(&self.weights, |x| x)
    }

    /// The primitive in the number type `T` with a capacity of `N` kernels.
    ///
    /// # Errors
    /// [`PrimitiveError`], e.g. more kernels than `N`.
    pub fn primitive<T: Scalar, const N: usize>(&self) -> Result<Primitive<T, N>, PrimitiveError> {
        let weights: Vec<T> = self.weights.iter().map(|&w| T::from_f64(w)).collect();
        Primitive::new(&self.tables_with(&weights, T::from_f64))
    }

    fn tables_with<'a, T: Scalar>(&self, weights: &'a [T], number: impl Fn(f64) -> T + Copy) -> PrimitiveTables<'a, T> {
        let configuration = |c: &Configuration<f64>| {
            let [w, x, y, z] = c.orientation.to_array().map(number);
            Configuration {
                position: c.position.map(number),
                orientation: Quaternion::new(w, x, y, z),
                posture: c.posture.map(number),
                hand: c.hand.map(number),
            }
        };
        PrimitiveTables {
            duration: number(self.duration),
            alpha: number(self.options.alpha),
            activation: number(self.options.activation),
            kernel_count: self.options.kernel_count,
            weights,
            stiffness: self.options.stiffness.map(number),
            damping: self.damping.map(number),
            orientation_error: self.options.orientation_error,
            hemisphere: Hemisphere::Demonstrated,
            start: configuration(&self.start),
            goal: configuration(&self.goal),
            start_velocity: Velocity {
                position: self.start_velocity.position.map(number),
                orientation: self.start_velocity.orientation.map(number),
                posture: self.start_velocity.posture.map(number),
                hand: self.start_velocity.hand.map(number),
            },
            feedback: None,
            expected: None,
            experience: None,
        }
    }
}

/// Learns a primitive from one demonstration.
///
/// # Errors
/// [`FitError`].
pub fn fit(demonstration: &Demonstration, options: &FitOptions) -> Result<Learned, FitError> {
    if !(options.ridge > 0.0 && options.ridge.is_finite()) {
        return Err(FitError::Ridge);
    }
    let canonical = CanonicalSystem::new(options.alpha).ok_or(FitError::Basis)?;
    let basis: Basis<f64, FIT_CAPACITY> =
        Basis::new(&canonical, options.kernel_count, options.activation).ok_or(FitError::Basis)?;
    let period = demonstration.period();
    let filter = match options.cutoff {
        Some(cutoff) => Some(ZeroPhaseFilter::new(cutoff, period).ok_or(FitError::Cutoff)?),
        None => None,
    };
    let smooth = demonstration.smoothed(filter.as_ref());
    let orientation = smooth.orientation();
    let angle = largest_angle_to_goal(orientation);
    let largest = match options.orientation_error {
        OrientationError::Quaternion => LARGEST_ANGLE,
        OrientationError::RotationVector => LARGEST_ROTATION_VECTOR,
    };
    if angle > largest {
        return Err(FitError::TurnsTooFar { angle });
    }

    let duration = demonstration.duration();
    let [k_p, k_o, k_q, k_h] = options.stiffness;
    let critical = |k: f64| 2.0 * libm::sqrt(k);
    let damping = [critical(k_p), options.orientation_error.critical_damping(k_o), critical(k_q), critical(k_h)];
    let samples = smooth.len();
    // Beyond the last sample nothing ties the last weights down, and they are large, because there f is small: a plan that
    // reproduces its demonstration to a tenth of a millimetre was seen to leave the goal by 24 mm afterwards. So where
    // the demonstration rests at its end, the fit goes on with rest.
    let rest = if smooth.ends_at_rest(REST_SPEED_SHARE) { (samples as f64 * REST_SHARE) as usize } else { 0 };
    let phases: Vec<f64> = (0..samples + rest).map(|k| canonical.phase_at(k as f64 / (samples - 1) as f64)).collect();
    // What f/s must be for the plan to rest at the goal.
    let mut resting = [0.0; ROWS];

    // Targets sample by sample, all rows side by side.
    let mut targets = std::vec![[0.0; ROWS]; samples];
    let mut start_velocity = Velocity::ZERO;
    for (row, column) in smooth.linear_columns() {
        let (group, gains) = match row {
            0..POSITION_ROWS => (Group::Position(row), (k_p, damping[0])),
            6..13 => (Group::Posture(row - 6), (k_q, damping[2])),
            _ => (Group::Hand(row - 13), (k_h, damping[3])),
        };
        let (force, velocity) = linear_target(&column, period, duration, gains, &phases);
        for (target, force) in targets.iter_mut().zip(force) {
            target[row] = force;
        }
        resting[row] = column[samples - 1] - column[0];
        match group {
            Group::Position(i) => start_velocity.position[i] = velocity,
            Group::Posture(i) => start_velocity.posture[i] = velocity,
            Group::Hand(i) => start_velocity.hand[i] = velocity,
        }
    }
    let (q0, goal) = (orientation[0], orientation[samples - 1]);
    match options.orientation_error {
        OrientationError::Quaternion => {
            let omega = angular_velocity(orientation, period);
            let domega: [Vec<f64>; 3] = core::array::from_fn(|axis| {
                let column: Vec<f64> = omega.iter().map(|omega| omega[axis]).collect();
                first_derivative(&column, period)
            });
            for axis in 0..ORIENTATION_ROWS {
                let lag = HALF_TICK * domega[axis][0];
                start_velocity.orientation[axis] = omega[0][axis] - lag;
            }
            let e0 = orientation_error(&goal, &q0);
            for axis in 0..ORIENTATION_ROWS {
                resting[POSITION_ROWS + axis] = -e0[axis];
            }
            for (i, target) in targets.iter_mut().enumerate() {
                let e = orientation_error(&goal, &orientation[i]);
                for axis in 0..ORIENTATION_ROWS {
                    // Eq. (6) solved for f; e_o(g, q) = -(g - q), hence the other signs.
                    let (w, dw) = (omega[i][axis], domega[axis][i]);
                    let w = w - HALF_TICK * dw;
                    target[POSITION_ROWS + axis] =
                        (duration * duration * dw + damping[1] * duration * w) / k_o + e[axis] - e0[axis] * phases[i];
                }
            }
        }
        OrientationError::RotationVector => {
            let chart = RotationChart::between(&q0, &goal);
            let mut y = chart.start();
            let path: Vec<[f64; 3]> = orientation
                .iter()
                .map(|q| {
                    y = chart.vector(q, &y);
                    y
                })
                .collect();
            let mut dy = [0.0; 3];
            for axis in 0..ORIENTATION_ROWS {
                let column: Vec<f64> = path.iter().map(|y| y[axis]).collect();
                let (force, velocity) = linear_target(&column, period, duration, (k_o, damping[1]), &phases);
                dy[axis] = velocity;
                resting[POSITION_ROWS + axis] = column[samples - 1] - column[0];
                for (target, force) in targets.iter_mut().zip(force) {
                    target[POSITION_ROWS + axis] = force;
                }
            }
            start_velocity.orientation = chart.omega(&path[0], &dy);
        }
    }

    let ridge = Ridge::new(&basis, &phases, options.ridge).ok_or(FitError::Singular)?;
    targets.extend(phases[samples..].iter().map(|s| resting.map(|value| value * s)));
    let by_kernel = ridge.solve(&targets);
    let residuals = ridge.residuals(&by_kernel, &targets[..samples]);
    let weights: Vec<f64> = (0..ROWS).flat_map(|row| by_kernel.iter().map(move |weights| weights[row])).collect();

    let mut learned = Learned {
        duration,
        options: *options,
        damping,
        weights,
        start: smooth.configuration(0),
        goal: smooth.configuration(samples - 1),
        start_velocity,
        report: Report::default(),
    };
    let primitive = learned.primitive::<f64, FIT_CAPACITY>()?;
    learned.report = report::replay(demonstration, &smooth, &primitive, &residuals, ridge.condition(), angle);
    Ok(learned)
}

/// Eq. (1) solved for f, sample by sample, and the velocity to start with.
///
/// The velocity is taken half a tick early, because semi-implicit Euler damps with the velocity of the step before: this
/// cancels its first-order error at 300 Hz.
fn linear_target(x: &[f64], period: f64, tau: f64, (k, d): (f64, f64), phases: &[f64]) -> (Vec<f64>, f64) {
    let (dx, ddx) = (first_derivative(x, period), second_derivative(x, period));
    let (x0, goal) = (x[0], x[x.len() - 1]);
    let early = |i: usize| dx[i] - HALF_TICK * ddx[i];
    let force = (0..x.len())
        .map(|i| (tau * tau * ddx[i] + d * tau * early(i)) / k - (goal - x[i]) + (goal - x0) * phases[i])
        .collect();
    (force, early(0))
}

/// Where a row belongs.
enum Group {
    Position(usize),
    Posture(usize),
    Hand(usize),
}
