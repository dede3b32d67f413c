//! Learning a primitive from one demonstration or several (host only, f64).
//!
//! The demonstration is smoothed without phase shift and differentiated, Eqs. (1) and (6) are solved for the forcing
//! term they would have needed, and the weights of Eq. (2) are fitted to it by one ridge regression. The basis depends
//! only on the phase, so all rows share one matrix and one factorisation. The learned movement is then rolled out
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

pub use demonstration::{Demonstration, DemonstrationError, PoseSamples, minimum_jerk};
pub use derivative::{first_derivative, second_derivative};
pub use expected::{FEWEST_TRIALS, WEIGHT_RANGE, expected_sensors, weights_from_spread};
pub use filter::ZeroPhaseFilter;
pub use orientation::{angular_velocity, largest_angle_to_goal, make_sign_continuous};
pub use report::{OrientationReport, Report, RowReport};
pub use statistics::{PhaseStatistics, phase_statistics, sensor_statistics};

use core::fmt;

use crate::gains::Systems;
use crate::primitive::check_control_period;
use crate::{
    Basis, CanonicalSystem, Configuration, Gain, Gains, Hemisphere, LogMap, OrientationError, Primitive,
    PrimitiveError, PrimitiveTables, Quaternion, Scalar, Stiffness, TransformationSystem, Velocity, bounds,
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
/// Time for which the plan of a demonstration that ends at rest is told to stay at its goal, as a share of the
/// duration.
const REST_SHARE: f64 = 0.5;
/// Beyond this angle to the goal (rad, 359 degrees) even rotation vectors are refused: the sign of the start could not
/// tell which way to turn.
pub const LARGEST_ROTATION_VECTOR: f64 = 359.0 * core::f64::consts::PI / 180.0;

/// Options of learning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitOptions<const D: usize, const P: usize> {
    /// Longest control period of the runs, s; `None`: the sampling period of the demonstration. The integrator of a run
    /// is off by half a step, which the fit takes into account.
    pub control_period: Option<f64>,
    /// Number of kernels N.
    pub kernel_count: usize,
    /// Decay of the phase.
    pub alpha: f64,
    /// Value of a kernel at the next centre.
    pub activation: f64,
    /// Stiffness K; the damping is critical.
    pub stiffness: Stiffness<f64, D, P>,
    /// Orientation error that drives the spring.
    pub orientation_error: OrientationError,
    /// Cut-off of the zero-phase filter, Hz; `None` for data without noise. What is faster is taken out of the movement
    /// and told in [`RowReport::removed_rms`]: of a reach of one second 7.5 Hz takes less than 1e-4 of its extent, of
    /// one of 0.3 s 0.4 %, and of the swing of a leg within 0.15 s 4 %. Choose ten times the reciprocal of such a
    /// duration.
    pub cutoff: Option<f64>,
    /// Ridge relative to the mean diagonal of the normal equations.
    pub ridge: f64,
}

impl<const D: usize, const P: usize> Default for FitOptions<D, P> {
    /// 50 kernels, s(tau) = 0.01, K = 200, 7.5 Hz, ridge 1e-8.
    fn default() -> Self {
        Self {
            control_period: None,
            kernel_count: 50,
            alpha: CanonicalSystem::<f64>::DEFAULT_ALPHA,
            activation: 0.7,
            stiffness: Stiffness::uniform(TransformationSystem::<f64>::DEFAULT_STIFFNESS),
            orientation_error: OrientationError::Quaternion,
            cutoff: Some(7.5),
            ridge: 1e-8,
        }
    }
}

/// Reason for which a demonstration cannot be learned.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum FitError {
    /// Fewer than two kernels, more than [`FIT_CAPACITY`], or values that [`CanonicalSystem::new`] or [`Basis::new`]
    /// refuses.
    Basis,
    /// The cut-off is not between one period within the demonstration and half the sampling rate.
    Cutoff,
    /// The ridge is not a positive number.
    Ridge,
    /// The orientation turns too far from the goal for the chosen error (angle in rad). Up to 359 degrees
    /// [`OrientationError::RotationVector`] can follow.
    TurnsTooFar {
        /// Largest angle to the goal, rad.
        angle: f64,
    },
    /// Several demonstrations have no mean.
    Demonstration(DemonstrationError),
    /// The normal equations could not be factorised.
    Singular,
    /// The learned tables are refused as a primitive.
    Primitive(PrimitiveError),
}

impl fmt::Display for FitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Basis => {
                write!(
                    f,
                    "the number of kernels must be 2..={FIT_CAPACITY}, alpha 2.3..=13.82 and the activation 0.05..=0.95"
                )
            }
            Self::Cutoff => f.write_str(
                "the cut-off must lie between one period within the demonstration and half the sampling rate",
            ),
            Self::Ridge => f.write_str("the ridge must be a positive number"),
            Self::TurnsTooFar { angle } => write!(
                f,
                "the orientation turns {:.0} degrees away from the goal: OrientationError::Quaternion can follow up to \
                 175, OrientationError::RotationVector up to 359",
                angle.to_degrees()
            ),
            Self::Demonstration(error) => error.fmt(f),
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
#[non_exhaustive]
pub struct Learned<const D: usize, const P: usize> {
    /// Duration tau, s.
    pub duration: f64,
    /// Longest control period of a run, s.
    pub control_period: f64,
    /// Options of learning.
    pub options: FitOptions<D, P>,
    /// Stiffness and damping.
    pub gains: Gains<f64, D, P>,
    /// Weights, row-major `[6 P + D][kernel_count]`.
    pub weights: Vec<f64>,
    /// Start of the smoothed demonstration.
    pub start: Configuration<f64, D, P>,
    /// Goal = end of the smoothed demonstration.
    pub goal: Configuration<f64, D, P>,
    /// Velocity at the start.
    pub start_velocity: Velocity<f64, D, P>,
    /// Quality.
    pub report: Report,
}

impl<const D: usize, const P: usize> Learned<D, P> {
    /// The tables.
    #[must_use]
    pub fn tables(&self) -> PrimitiveTables<'_, f64, D, P> {
        self.tables_with(&self.weights)
    }

    /// The primitive in the number type `T` with a capacity of `N` kernels.
    ///
    /// # Errors
    /// [`PrimitiveError`], e.g. more kernels than `N`.
    pub fn primitive<T: Scalar, const N: usize>(&self) -> Result<Primitive<T, D, P, N>, PrimitiveError> {
        let weights: Option<Vec<T::Weight>> = self.weights.iter().map(|&w| T::from_f64(w).to_weight()).collect();
        let weights = weights.ok_or(PrimitiveError::Weight)?;
        Primitive::new(&self.tables_with(&weights))
    }

    fn tables_with<'a, T: Scalar>(&self, weights: &'a [T::Weight]) -> PrimitiveTables<'a, T, D, P> {
        PrimitiveTables {
            control_period: T::from_f64(self.control_period),
            duration: T::from_f64(self.duration),
            alpha: T::from_f64(self.options.alpha),
            activation: T::from_f64(self.options.activation),
            kernel_count: self.options.kernel_count,
            weights,
            gains: self.gains.cast(),
            orientation_error: self.options.orientation_error,
            hemisphere: Hemisphere::Demonstrated,
            start: self.start.cast(),
            goal: self.goal.cast(),
            start_velocity: self.start_velocity.cast(),
        }
    }
}

/// Learns a primitive from several demonstrations of one movement: from their mean, see [`Demonstration::mean`]. How
/// far they lie apart is [`Report::spread`].
///
/// # Errors
/// [`FitError`].
pub fn fit_several<const D: usize, const P: usize>(
    demonstrations: &[Demonstration<D, P>],
    options: &FitOptions<D, P>,
) -> Result<Learned<D, P>, FitError> {
    let (mean, spread) = Demonstration::mean(demonstrations).map_err(FitError::Demonstration)?;
    let mut learned = fit(&mean, options)?;
    learned.report.spread = spread;
    Ok(learned)
}

/// Learns a primitive from one demonstration.
///
/// # Errors
/// [`FitError`].
pub fn fit<const D: usize, const P: usize>(
    demonstration: &Demonstration<D, P>,
    options: &FitOptions<D, P>,
) -> Result<Learned<D, P>, FitError> {
    if !(options.ridge > 0.0 && options.ridge.is_finite()) {
        return Err(FitError::Ridge);
    }
    let canonical = CanonicalSystem::new(options.alpha).ok_or(FitError::Basis)?;
    let basis: Basis<f64, FIT_CAPACITY> =
        Basis::new(&canonical, options.kernel_count, options.activation).ok_or(FitError::Basis)?;
    let period = demonstration.period();
    // Before they become weights that are not numbers.
    if !(demonstration.duration() <= bounds::LONGEST_DURATION) {
        return Err(PrimitiveError::Duration.into());
    }
    let control_period = options.control_period.unwrap_or(period);
    check_control_period(control_period)?;
    let gains = Gains::critically_damped(&options.stiffness, options.orientation_error);
    Systems::new(&gains)?;
    let filter = match options.cutoff {
        Some(cutoff) if cutoff * demonstration.duration() < 1.0 => return Err(FitError::Cutoff),
        Some(cutoff) => Some(ZeroPhaseFilter::new(cutoff, period).ok_or(FitError::Cutoff)?),
        None => None,
    };
    let smooth = demonstration.smoothed(filter.as_ref());
    let angles = smooth.poses().iter().map(|pose| largest_angle_to_goal(&pose.orientation));
    let angle = angles.fold(0.0, f64::max);
    let largest = match options.orientation_error {
        OrientationError::Quaternion => LARGEST_ANGLE,
        OrientationError::RotationVector => LARGEST_ROTATION_VECTOR,
    };
    if angle > largest {
        return Err(FitError::TurnsTooFar { angle });
    }
    let samples = smooth.len();
    // Beyond the last sample nothing ties the last weights down, and they are large, because there f is small: a plan
    // that reproduces its demonstration to a tenth of a millimetre was seen to leave the goal by 24 mm afterwards. So
    // where the demonstration rests at its end, the fit goes on with rest.
    let rest = if smooth.ends_at_rest(REST_SPEED_SHARE) { (samples as f64 * REST_SHARE) as usize } else { 0 };
    let phases: Vec<f64> = (0..samples + rest).map(|k| canonical.phase_at(k as f64 / (samples - 1) as f64)).collect();
    let timing =
        Timing { period, duration: demonstration.duration(), half_tick: 0.5 * control_period, phases: &phases };
    let (targets, start_velocity) = targets(&smooth, &timing, &gains, options.orientation_error);

    let ridge = Ridge::new(&basis, &phases, options.ridge).ok_or(FitError::Singular)?;
    let (mut weights, mut residuals) = (Vec::new(), Vec::new());
    for Target { mut force, resting } in targets {
        force.extend(phases[samples..].iter().map(|s| resting * s));
        let row = ridge.solve(&force);
        residuals.push(ridge.residual(&row, &force[..samples]));
        weights.extend(row);
    }
    let mut learned = Learned {
        duration: timing.duration,
        control_period,
        options: *options,
        gains,
        weights,
        start: smooth.configuration(0),
        goal: smooth.configuration(samples - 1),
        start_velocity,
        report: Report::default(),
    };
    let primitive = learned.primitive::<f64, FIT_CAPACITY>()?;
    learned.report = report::replay(demonstration, &smooth, &primitive, &residuals, ridge.condition());
    Ok(learned)
}

/// Times of a fit, s, and the phase of every sample.
struct Timing<'a> {
    period: f64,
    duration: f64,
    half_tick: f64,
    phases: &'a [f64],
}

/// Forcing term that one row would have needed, sample by sample, and `f/s` with which its plan rests at the goal.
struct Target {
    force: Vec<f64>,
    resting: f64,
}

/// The targets of all rows in the order of the weights, and the velocity to start with.
fn targets<const D: usize, const P: usize>(
    smooth: &Demonstration<D, P>,
    timing: &Timing<'_>,
    gains: &Gains<f64, D, P>,
    error: OrientationError,
) -> (Vec<Target>, Velocity<f64, D, P>) {
    let mut targets = Vec::with_capacity(6 * P + D);
    let mut velocity = Velocity::ZERO;
    for ((pose, gains), twist) in smooth.poses().iter().zip(&gains.poses).zip(&mut velocity.poses) {
        for axis in 0..3 {
            let column: Vec<f64> = pose.position.iter().map(|x| x[axis]).collect();
            let (target, start) = linear_target(&column, timing, &gains.position);
            targets.push(target);
            twist.linear[axis] = start;
        }
        let (rows, start) = match error {
            OrientationError::Quaternion => quaternion_targets(&pose.orientation, timing, &gains.orientation),
            OrientationError::RotationVector => vector_targets(&pose.orientation, timing, &gains.orientation),
        };
        targets.extend(rows);
        twist.angular = start;
    }
    for (i, gain) in gains.points.iter().enumerate() {
        let column: Vec<f64> = smooth.points().iter().map(|x| x[i]).collect();
        let (target, start) = linear_target(&column, timing, gain);
        targets.push(target);
        velocity.points[i] = start;
    }
    (targets, velocity)
}

/// Eq. (6) solved for f, sample by sample, and the angular velocity to start with.
fn quaternion_targets(
    orientation: &[Quaternion<f64>],
    timing: &Timing<'_>,
    gain: &Gain<f64>,
) -> ([Target; 3], [f64; 3]) {
    let (tau, k, d) = (timing.duration, gain.stiffness, gain.damping);
    let (q0, goal) = (orientation[0], orientation[orientation.len() - 1]);
    let omega = angular_velocity(orientation, timing.period);
    let e0 = orientation_error(&goal, &q0);
    let mut start = [0.0; 3];
    let rows = core::array::from_fn(|axis| {
        let column: Vec<f64> = omega.iter().map(|omega| omega[axis]).collect();
        let domega = first_derivative(&column, timing.period);
        start[axis] = column[0] - timing.half_tick * domega[0];
        let force = |i: usize| {
            let e = orientation_error(&goal, &orientation[i]);
            // e_o(g, q) = -(g - q), hence the signs.
            let (w, dw) = (column[i], domega[i]);
            let w = w - timing.half_tick * dw;
            (tau * tau * dw + d * tau * w) / k + e[axis] - e0[axis] * timing.phases[i]
        };
        Target { force: (0..orientation.len()).map(force).collect(), resting: -e0[axis] }
    });
    (rows, start)
}

/// Eq. (1) on rotation vectors solved for f, sample by sample, and the angular velocity to start with.
fn vector_targets(orientation: &[Quaternion<f64>], timing: &Timing<'_>, gain: &Gain<f64>) -> ([Target; 3], [f64; 3]) {
    let map = LogMap::between(&orientation[0], &orientation[orientation.len() - 1]);
    let mut y = map.start();
    let next = |q: &Quaternion<f64>| {
        y = map.vector(q, &y);
        y
    };
    let path: Vec<[f64; 3]> = orientation.iter().map(next).collect();
    let mut dy = [0.0; 3];
    let rows = core::array::from_fn(|axis| {
        let column: Vec<f64> = path.iter().map(|y| y[axis]).collect();
        let (target, start) = linear_target(&column, timing, gain);
        dy[axis] = start;
        target
    });
    (rows, map.omega(&path[0], &dy))
}

/// Eq. (1) solved for f, sample by sample, and the velocity to start with.
///
/// The velocity is taken half a tick early, because semi-implicit Euler damps with the velocity of the step before:
/// this cancels its first-order error at the control period.
fn linear_target(x: &[f64], timing: &Timing<'_>, gain: &Gain<f64>) -> (Target, f64) {
    let (tau, k, d) = (timing.duration, gain.stiffness, gain.damping);
    let (dx, ddx) = (first_derivative(x, timing.period), second_derivative(x, timing.period));
    let (x0, goal) = (x[0], x[x.len() - 1]);
    let early = |i: usize| dx[i] - timing.half_tick * ddx[i];
    let force = (0..x.len())
        .map(|i| (tau * tau * ddx[i] + d * tau * early(i)) / k - (goal - x[i]) + (goal - x0) * timing.phases[i])
        .collect();
    (Target { force, resting: goal - x0 }, early(0))
}
