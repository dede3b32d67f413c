//! `ExpectedSensors`: the sensor values that a successful run would measure at each phase (`F_des` of Eqs. 8 and 12).
//!
//! Recorded during a successful execution without coupling. F is the wrench of the ENVIRONMENT ON THE ROBOT. Forces
//! belong in the world frame: in the sensor frame a hand that is tilted by 20 degrees would fake newtons.

use crate::{Entry, PhaseTable, Scalar, TableError, bounds};

/// Expected values of `SENSORS` sensors by phase, in up to `CAPACITY` samples.
#[derive(Clone, Debug, PartialEq)]
pub struct ExpectedSensors<T, const SENSORS: usize, const CAPACITY: usize> {
    table: PhaseTable<T, SENSORS, CAPACITY>,
    recorded_duration: T,
}

impl<T: Scalar, const SENSORS: usize, const CAPACITY: usize> ExpectedSensors<T, SENSORS, CAPACITY> {
    /// Full coupling while the duration is within this fraction of the recorded one.
    const TRUSTED_DEVIATION: f64 = 0.1;
    /// No coupling from this fraction on.
    const USELESS_DEVIATION: f64 = 0.5;

    /// From samples evenly spaced in progress from 0 to 1, recorded at
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

    /// No samples, for statics that are filled by [`assign`](Self::assign).
    pub const EMPTY: Self = Self { table: PhaseTable::EMPTY, recorded_duration: T::ZERO };

    /// As [`ExpectedSensors::new`], in place, point after point.
    ///
    /// # Errors
    /// As [`ExpectedSensors::new`] and [`PhaseTable::assign`]; the expectation is then empty.
    pub fn assign(&mut self, values: impl IntoIterator<Item = T>, recorded_duration: T) -> Result<(), TableError> {
        self.recorded_duration = recorded_duration;
        let result = self.table.assign(values).and_then(|()| self.check());
        if result.is_err() {
            self.clear();
        }
        result
    }

    /// Takes over the samples of another one.
    pub fn copy_from(&mut self, other: &Self) {
        self.table.copy_from(&other.table);
        self.recorded_duration = other.recorded_duration;
    }

    /// Forgets all samples.
    pub fn clear(&mut self) {
        self.table.clear();
        self.recorded_duration = T::ZERO;
    }

    /// True without samples.
    #[must_use]
    pub fn is_empty(&self) -> bool {
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

    /// Returns how far the expectation can be believed at another speed, 1 to 0.
    ///
    /// The inertial part of the record scales with `1/tau^2`; how large that part is, the record does not tell. Up
    /// to 10 % deviation of the duration it is used in full, from 50 % on not at all, linearly in between; a speed that
    /// is no number is not believed. `relative_speed` = recorded duration / present duration.
    pub fn trust(&self, relative_speed: T) -> T {
        let (full, none) = (T::from_f64(Self::TRUSTED_DEVIATION), T::from_f64(Self::USELESS_DEVIATION));
        // Deviation of the duration, without dividing by a speed of 0: |1/r - 1| <= k is |1 - r| <= k r.
        let deviation = (T::ONE - relative_speed).abs();
        if !relative_speed.is_finite() {
            // Of infinity the deviation is not larger than a tenth.
            T::ZERO
        } else if deviation <= full * relative_speed {
            T::ONE
        } else if deviation < none * relative_speed {
            (none - deviation / relative_speed) / (none - full)
        } else {
            T::ZERO
        }
    }
}
