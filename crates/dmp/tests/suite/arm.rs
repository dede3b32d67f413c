//! The composition that the tests use: an arm of seven joints with a hand of four, as a Barrett WAM has them. One pose,
//! posture and hand as eleven point rows, nine sensors.

use dmp::{
    CouplingGains, ExpectedSensors, Gain, PhaseTable, Pose, PoseCoupling, PoseGains, PoseLimits, PoseReference,
    Quaternion, RolloutError, Scalar, TableError, Twist,
};

/// Rows of weights: position 3, orientation 3, posture 7, hand 4.
pub(crate) const ROWS: usize = 17;
/// Force 3, torque 3, one gauge for each finger.
pub(crate) const SENSORS: usize = 9;

pub(crate) type Primitive<T, const N: usize> = dmp::Primitive<T, 11, 1, N>;
pub(crate) type Tables<'a, T> = dmp::PrimitiveTables<'a, T, 11, 1>;
pub(crate) type Rollout<T, const N: usize> = dmp::Rollout<T, 11, 1, N>;
pub(crate) type Reference<T> = dmp::Reference<T, 11, 1>;
pub(crate) type Configuration<T> = dmp::Configuration<T, 11, 1>;
pub(crate) type Velocity<T> = dmp::Velocity<T, 11, 1>;
pub(crate) type StartState<T> = dmp::StartState<T, 11, 1>;
pub(crate) type Coupling<T> = dmp::Coupling<T, 11, 1>;
pub(crate) type Gains<T> = dmp::Gains<T, 11, 1>;
pub(crate) type Limits<T> = dmp::DisplacementLimits<T, 11, 1>;
pub(crate) type Demonstration = dmp::fit::Demonstration<11, 1>;
pub(crate) type FitOptions = dmp::fit::FitOptions<11, 1>;
pub(crate) type Learned = dmp::fit::Learned<11, 1>;
pub(crate) type ExpectedWrench<T> = ExpectedSensors<T, SENSORS, 128>;
pub(crate) type GainSchedule<T, const COLUMNS: usize> = PhaseTable<T, COLUMNS, 32>;

pub(crate) const ORIGIN: Configuration<f64> = Configuration::ORIGIN;

pub(crate) fn points<T: Copy>(posture: [T; 7], hand: [T; 4]) -> [T; 11] {
    core::array::from_fn(|i| if i < 7 { posture[i] } else { hand[i - 7] })
}

pub(crate) fn configuration<T: Scalar>(
    position: [T; 3],
    orientation: Quaternion<T>,
    posture: [T; 7],
    hand: [T; 4],
) -> Configuration<T> {
    Configuration { poses: [Pose { position, orientation }], points: points(posture, hand) }
}

pub(crate) fn velocity<T: Scalar>(linear: [T; 3], angular: [T; 3], posture: [T; 7], hand: [T; 4]) -> Velocity<T> {
    Velocity { poses: [Twist { linear, angular }], points: points(posture, hand) }
}

pub(crate) fn coupling<T: Scalar>(position: [T; 3], orientation: [T; 3], hand: [T; 4]) -> Coupling<T> {
    Coupling { poses: [PoseCoupling { position, orientation }], points: points([T::ZERO; 7], hand) }
}

/// Stiffness and damping of position, orientation, posture, hand.
pub(crate) fn gains<T: Scalar>(k: [T; 4], d: [T; 4]) -> Gains<T> {
    let gain = |i: usize| Gain { stiffness: k[i], damping: d[i] };
    Gains { poses: [PoseGains { position: gain(0), orientation: gain(1) }], points: points([gain(2); 7], [gain(3); 4]) }
}

pub(crate) fn limits<T: Scalar>(displacement: T, rotation: T, hand: T) -> Limits<T> {
    Limits { poses: [PoseLimits { displacement, rotation }], points: points([T::ZERO; 7], [hand; 4]) }
}

/// Still samples but for the position, the posture and the hand.
pub(crate) fn demonstration(
    period: f64,
    position: Vec<[f64; 3]>,
    orientation: Vec<Quaternion<f64>>,
    posture: Vec<[f64; 7]>,
    hand: Vec<[f64; 4]>,
) -> Result<Demonstration, dmp::fit::DemonstrationError> {
    let rows = posture.into_iter().zip(hand).map(|(posture, hand)| points(posture, hand)).collect();
    Demonstration::new(period, [dmp::fit::PoseSamples { position, orientation }], rows)
}

/// Pose of a plan.
pub(crate) fn pose<T: Scalar>(plan: &Reference<T>) -> &PoseReference<T> {
    &plan.poses[0]
}

/// Gains, limits and expectation of the nine sensors, which bend pose and hand.
#[derive(Clone)]
pub(crate) struct Feedback<T> {
    pub(crate) gains: CouplingGains<T, 10, SENSORS, 32>,
    pub(crate) limits: Limits<T>,
    pub(crate) expected: ExpectedWrench<T>,
}

impl<T: Scalar> Feedback<T> {
    /// Nothing is expected.
    pub(crate) fn new(k1: [T; 10], k2: [T; SENSORS], limits: Limits<T>) -> Result<Self, TableError> {
        limits.check()?;
        let gains = CouplingGains::new(PhaseTable::constant(k1)?, PhaseTable::constant(k2)?)?;
        Ok(Self { gains, limits, expected: ExpectedWrench::new(&[[T::ZERO; SENSORS]], T::from_f64(5.0))? })
    }

    /// `zeta` of measured values.
    pub(crate) fn coupling<const N: usize>(
        &self,
        rollout: &Rollout<T, N>,
        primitive: &Primitive<T, N>,
        measured: &[T; SENSORS],
    ) -> Result<Coupling<T>, RolloutError> {
        rollout.check(primitive)?;
        let (u, expected) = (rollout.progress(), &self.expected);
        let trust = expected.trust(expected.recorded_duration() * primitive.rate() * rollout.speed());
        let at = expected.at(u);
        let error = core::array::from_fn(|i| (measured[i] - at[i]) * trust);
        Ok(self.of_error(primitive, u, &error))
    }

    /// `zeta` of an error at a progress.
    pub(crate) fn of_error<const N: usize>(
        &self,
        primitive: &Primitive<T, N>,
        u: T,
        error: &[T; SENSORS],
    ) -> Coupling<T> {
        let [px, py, pz, rx, ry, rz, hand @ ..] = self
            .gains
            .zeta(u, error, |&[fx, fy, fz, tx, ty, tz, f1, f2, f3]| [fx, fy, fz, tx, ty, tz, T::ZERO, f1, f2, f3]);
        primitive.limited_coupling(&coupling([px, py, pz], [rx, ry, rz], hand), &self.limits)
    }
}
