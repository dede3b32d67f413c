//! `ExpectedWrench`: what the sensors should feel at each phase (`F_des` of Eqs. 8 and 12).
//!
//! Recorded during a successful execution without feedback. F is the wrench of the ENVIRONMENT ON THE ROBOT. Force
//! rows are in the world frame: in the sensor frame a hand that is tilted by 20 degrees would fake newtons. Torque
//! rows are in the body frame at the controlled point, finger rows are torques of the environment on each finger.

use crate::{Entry, PhaseTable, SENSORS, Scalar, TableError, bounds};

/// Most samples an expectation can hold.
pub const EXPECTED_CAPACITY: usize = 128;

/// Expected sensor values by phase.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExpectedWrench<T> {
    table: PhaseTable<T, SENSORS, EXPECTED_CAPACITY>,
    recorded_duration: T,
}

impl<T: Scalar> ExpectedWrench<T> {
    /// Full feedback while the duration is within this fraction of the recorded one.
    const TRUSTED_DEVIATION: f64 = 0.1;
    /// No feedback from this fraction on.
    const USELESS_DEVIATION: f64 = 0.5;

    /// From samples (force N world, torque N m body, fingers N m) evenly spaced in progress from 0 to 1, recorded at
    /// the duration `recorded_duration` (s).
    ///
    /// # Errors
    /// [`TableError`], with [`TableError::Duration`] for a duration that is not a positive number up to 3600 s and
    /// [`TableError::TooLarge`] for a value that no sensor has.
    pub fn new(samples: &[[T; SENSORS]], recorded_duration: T) -> Result<Self, TableError> {
        let expected = Self { table: PhaseTable::new(samples)?, recorded_duration };
        expected.check()?;
        Ok(expected)
    }

    fn check(&self) -> Result<(), TableError> {
        if !(self.recorded_duration > T::ZERO && self.recorded_duration <= T::from_f64(bounds::LONGEST_DURATION)) {
            return Err(TableError::Duration);
        }
        match self.table.first_beyond(bounds::LARGEST_SENSOR_VALUE) {
            Some((point, column)) => Err(TableError::TooLarge(Entry::Expected { point, column })),
            None => Ok(()),
        }
    }

    /// Stands for an expectation that is not there; never leaves this crate.
    pub(crate) const EMPTY: Self = Self { table: PhaseTable::EMPTY, recorded_duration: T::ZERO };

    /// As [`ExpectedWrench::new`], in place. After an error it is empty.
    pub(crate) fn assign(
        &mut self,
        values: impl IntoIterator<Item = T>,
        recorded_duration: T,
    ) -> Result<(), TableError> {
        self.recorded_duration = recorded_duration;
        let result = self.table.assign(values).and_then(|()| self.check());
        if result.is_err() {
            self.clear();
        }
        result
    }

    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.table.copy_from(&other.table);
        self.recorded_duration = other.recorded_duration;
    }

    pub(crate) fn clear(&mut self) {
        self.table.clear();
        self.recorded_duration = T::ZERO;
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.table.samples().is_empty()
    }

    /// Expected values at progress `u`; beyond the ends the end values hold.
    #[inline]
    pub fn at(&self, u: T) -> [T; SENSORS] {
        self.table.at(u)
    }

    /// The samples.
    pub fn samples(&self) -> &[[T; SENSORS]] {
        self.table.samples()
    }

    /// Duration at which the expectation was recorded, s.
    pub fn recorded_duration(&self) -> T {
        self.recorded_duration
    }

    /// How far the expectation can be believed at another speed, 1 to 0.
    ///
    /// The inertial part of the record scales with `1/tau^2`; how large that part is, the record does not tell. Up
    /// to 10 % deviation of the duration it is used in full, from 50 % on not at all, linearly in between.
    /// `relative_speed` = recorded duration / present duration.
    pub fn trust(&self, relative_speed: T) -> T {
        let (full, none) = (T::from_f64(Self::TRUSTED_DEVIATION), T::from_f64(Self::USELESS_DEVIATION));
        // Deviation of the duration, without dividing by a speed of 0: |1/r - 1| <= k is |1 - r| <= k r.
        let deviation = (T::ONE - relative_speed).abs();
        if deviation <= full * relative_speed {
            T::ONE
        } else if deviation < none * relative_speed {
            (none - deviation / relative_speed) / (none - full)
        } else {
            T::ZERO
        }
    }
}
