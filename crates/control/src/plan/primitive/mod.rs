//! `Primitive`: a movement of this arm with the gains of its sensory feedback, the sensor values that it expects and
//! the statistics of successful runs.
//!
//! `dmp` knows rows and sensors by number; which row is which joint, and which sensor bends which row, is said here.

mod rows;

pub(crate) use rows::write_error;
pub use rows::{
    Configuration, Coupling, Gains, HAND_ROWS, Limits, Movement, MovementTables, ORIENTATION_ROWS, POINT_ROWS,
    POSITION_ROWS, POSTURE_ROWS, ROWS, Reference, Rollout, RowGroup, StartState, Velocity, configuration, gains,
    limits, points, posture_and_hand, velocity,
};

pub use crate::guard::watch::{STATISTICS_CAPACITY, STATISTICS_CHANNELS, SensorStatistics};
pub use crate::sense::deviation::SENSORS;

use dmp::{CouplingGains, PhaseTable, PoseCoupling, PrimitiveError, RolloutError, Scalar, TableError};

/// Rows with feedback: position 3, orientation 3, hand 4 (the spread has no gauge).
pub const COUPLED_ROWS: usize = 10;
/// Most samples of a gain over the phase.
pub const GAIN_CAPACITY: usize = 32;
/// Most samples of an expectation.
pub const EXPECTED_CAPACITY: usize = 128;
/// Channels of the statistics that are judged upwards only: a finger that closes too far holds nothing, one that stops
/// early has met something.
pub const ONE_SIDED_CHANNELS: [bool; STATISTICS_CHANNELS] =
    [false, false, false, false, false, false, false, false, false, true, true, true];

/// Gain by phase.
pub type GainSchedule<T, const COLUMNS: usize> = PhaseTable<T, COLUMNS, GAIN_CAPACITY>;
/// Sensor values that a successful run measures (`F_des`).
pub type ExpectedWrench<T> = dmp::ExpectedSensors<T, SENSORS, EXPECTED_CAPACITY>;
/// Gains and limits of the sensory feedback, Eq (8).
#[derive(Clone, Debug, PartialEq)]
pub struct Feedback<T> {
    gains: CouplingGains<T, COUPLED_ROWS, SENSORS, GAIN_CAPACITY>,
    limits: Limits<T>,
    /// Largest `K1` of a position row over the phase.
    largest: T,
}

impl<T: Scalar> Feedback<T> {
    const EMPTY: Self = Self { gains: CouplingGains::EMPTY, limits: Limits::NONE, largest: T::ZERO };

    /// With sensitivity `K1` per coupled row, weight `K2` per sensor, and limits ([`limits`]).
    ///
    /// # Errors
    /// As [`CouplingGains::new`] and [`dmp::DisplacementLimits::check`].
    pub fn new(
        sensitivity: GainSchedule<T, COUPLED_ROWS>,
        weight: GainSchedule<T, SENSORS>,
        limits: Limits<T>,
    ) -> Result<Self, TableError> {
        limits.check()?;
        let gains = CouplingGains::new(sensitivity, weight)?;
        let largest = largest(&gains);
        Ok(Self { gains, limits, largest })
    }

    /// `K1` and `K2`.
    pub fn gains(&self) -> &CouplingGains<T, COUPLED_ROWS, SENSORS, GAIN_CAPACITY> {
        &self.gains
    }

    /// Limits.
    pub fn limits(&self) -> &Limits<T> {
        &self.limits
    }

    /// Largest `K1` of a position row over the phase.
    pub(crate) fn largest(&self) -> T {
        self.largest
    }

    /// `zeta` at progress `u` for the error `F - F_expected`, within the limits. Forces are in the world frame and
    /// torques in the body frame at the controlled point: `J^T` only sorts them.
    fn coupling<const N: usize>(&self, movement: &Movement<T, N>, u: T, error: &[T; SENSORS]) -> Coupling<T> {
        let [px, py, pz, rx, ry, rz, hand @ ..] = self.gains.zeta(u, error, |weighted| {
            let [fx, fy, fz, tx, ty, tz, f1, f2, f3] = *weighted;
            [fx, fy, fz, tx, ty, tz, T::ZERO, f1, f2, f3]
        });
        let pose = PoseCoupling { position: [px, py, pz], orientation: [rx, ry, rz] };
        let zeta = Coupling { poses: [pose], points: points([T::ZERO; POSTURE_ROWS], hand) };
        movement.limited_coupling(&zeta, &self.limits)
    }
}

/// Largest `K1` of a position row over the phase: straight lines between the samples.
fn largest<T: Scalar>(gains: &CouplingGains<T, COUPLED_ROWS, SENSORS, GAIN_CAPACITY>) -> T {
    let rows = gains.sensitivity().samples().iter().flat_map(|sample| sample.iter().take(3));
    rows.fold(T::ZERO, |most, k1| if *k1 > most { *k1 } else { most })
}

/// A movement with the memory of its sensors; `N` = kernel capacity.
///
/// For f32 and N = 100 about 23 kB: keep it in a static or behind a reference on a small stack, and fill it there with
/// [`Primitive::assign`] and the other `assign_` functions.
#[derive(Debug, PartialEq)]
pub struct Primitive<T: Scalar, const N: usize> {
    movement: Movement<T, N>,
    // An empty table stands for one that is not there: an `Option` of kilobytes would be moved through the stack.
    feedback: Feedback<T>,
    expected: ExpectedWrench<T>,
    statistics: SensorStatistics<T>,
}

/// A copy into an existing primitive ([`Clone::clone_from`]) needs no second one on the stack.
impl<T: Scalar, const N: usize> Clone for Primitive<T, N> {
    fn clone(&self) -> Self {
        let mut copy = Self::PLACEHOLDER;
        copy.clone_from(self);
        copy
    }

    fn clone_from(&mut self, source: &Self) {
        self.movement.clone_from(&source.movement);
        self.set_feedback(source.feedback());
        self.set_expected(source.expected());
        self.set_statistics(source.statistics());
    }
}

impl<T: Scalar, const N: usize> Primitive<T, N> {
    /// A place to [`assign`](Primitive::assign) to, for statics: rests at the origin for a second. No movement of use.
    pub const PLACEHOLDER: Self = Self {
        movement: Movement::PLACEHOLDER,
        feedback: Feedback::EMPTY,
        expected: ExpectedWrench::EMPTY,
        statistics: SensorStatistics::EMPTY,
    };

    /// Checks the tables and builds the primitive, without memory: it runs open loop and nothing is compared.
    ///
    /// # Errors
    /// The first [`PrimitiveError`] found.
    pub fn new(tables: &MovementTables<'_, T>) -> Result<Self, PrimitiveError> {
        let mut primitive = Self::PLACEHOLDER;
        primitive.assign(tables)?;
        Ok(primitive)
    }

    /// Checks the tables and, if they are good, makes this primitive theirs, in place and without memory.
    ///
    /// # Errors
    /// The first [`PrimitiveError`] found; then nothing has been changed.
    pub fn assign(&mut self, tables: &MovementTables<'_, T>) -> Result<(), PrimitiveError> {
        self.movement.assign(tables)?;
        self.set_feedback(None);
        self.set_expected(None);
        self.set_statistics(None);
        Ok(())
    }

    /// The movement.
    #[inline]
    pub fn movement(&self) -> &Movement<T, N> {
        &self.movement
    }

    /// Gains of the sensory feedback; `None` runs open loop.
    #[inline]
    pub fn feedback(&self) -> Option<&Feedback<T>> {
        (!self.feedback.gains.is_empty()).then_some(&self.feedback)
    }

    /// Expected sensor values; `None` (not recorded yet) runs open loop.
    #[inline]
    pub fn expected(&self) -> Option<&ExpectedWrench<T>> {
        (!self.expected.is_empty()).then_some(&self.expected)
    }

    /// Statistics of successful runs; `None` (not recorded yet): nothing is compared.
    #[inline]
    pub fn statistics(&self) -> Option<&SensorStatistics<T>> {
        (!self.statistics.is_empty()).then_some(&self.statistics)
    }

    /// Replaces the feedback; `None` runs open loop.
    pub fn set_feedback(&mut self, feedback: Option<&Feedback<T>>) {
        match feedback {
            Some(feedback) => {
                self.feedback.gains.copy_from(&feedback.gains);
                (self.feedback.limits, self.feedback.largest) = (feedback.limits, feedback.largest);
            }
            None => {
                self.feedback.gains.clear();
                (self.feedback.limits, self.feedback.largest) = (Limits::NONE, T::ZERO);
            }
        }
    }

    /// Replaces the expectation, e.g. after the open-loop run that recorded it; `None` runs open loop.
    pub fn set_expected(&mut self, expected: Option<&ExpectedWrench<T>>) {
        match expected {
            Some(expected) => self.expected.copy_from(expected),
            None => self.expected.clear(),
        }
    }

    /// Replaces the statistics; without them nothing is compared.
    pub fn set_statistics(&mut self, statistics: Option<&SensorStatistics<T>>) {
        match statistics {
            Some(statistics) => self.statistics.copy_from(statistics),
            None => self.statistics.clear(),
        }
    }

    /// Replaces the feedback by values that come one by one, as from a stored image: `K1` and `K2` by phase, point
    /// after point, and the limits.
    ///
    /// # Errors
    /// As [`Feedback::new`], [`TableError::Shape`] for a point that is cut short; the primitive then runs open loop.
    pub fn assign_feedback(
        &mut self,
        sensitivity: impl IntoIterator<Item = T>,
        weight: impl IntoIterator<Item = T>,
        limits: Limits<T>,
    ) -> Result<(), TableError> {
        self.set_feedback(None);
        limits.check()?;
        self.feedback.gains.assign(sensitivity, weight)?;
        (self.feedback.limits, self.feedback.largest) = (limits, largest(&self.feedback.gains));
        Ok(())
    }

    /// Replaces the expectation by values that come one by one, point after point; recorded at the duration
    /// `recorded_duration` (s).
    ///
    /// # Errors
    /// As [`dmp::ExpectedSensors::assign`]; the primitive then runs open loop.
    pub fn assign_expected(
        &mut self,
        samples: impl IntoIterator<Item = T>,
        recorded_duration: T,
    ) -> Result<(), TableError> {
        self.expected.assign(samples, recorded_duration)
    }

    /// Replaces the statistics by values that come one by one, point after point.
    ///
    /// # Errors
    /// As [`dmp::SensorStatistics::assign`]; nothing is compared then.
    pub fn assign_statistics(
        &mut self,
        mean: impl IntoIterator<Item = T>,
        spread: impl IntoIterator<Item = T>,
        trials: u16,
    ) -> Result<(), TableError> {
        self.statistics.assign(mean, spread, trials)
    }

    /// Returns how far the expectation can be believed in this run, 1 to 0; 1 without one. It loses effect when the
    /// speed differs from that of the recording, see [`dmp::ExpectedSensors::trust`].
    #[inline]
    pub fn trust(&self, rollout: &Rollout<T, N>) -> T {
        self.expected().map_or(T::ONE, |expected| {
            expected.trust(expected.recorded_duration() * self.movement.rate() * rollout.speed())
        })
    }

    /// `zeta` of Eq (8) for this tick from the error `F - F_expected` (environment on the robot); none if the primitive
    /// has no gains or no expectation.
    ///
    /// # Errors
    /// [`RolloutError::OtherPrimitive`].
    pub fn coupling(&self, rollout: &Rollout<T, N>, error: &[T; SENSORS]) -> Result<Coupling<T>, RolloutError> {
        rollout.check(&self.movement)?;
        let (Some(feedback), Some(_)) = (self.feedback(), self.expected()) else {
            return Ok(Coupling::NONE);
        };
        let trust = self.trust(rollout);
        Ok(feedback.coupling(&self.movement, rollout.progress(), &error.map(|error| error * trust)))
    }
}
