//! `SensorStatistics`: mean and spread of the sensor values of successful runs, by phase.
//!
//! Mean `m(u)` is the middle of the successful runs, spread `sigma(u)` the unit in which a distance from it is judged;
//! `fit::sensor_statistics` makes both from recordings. A run whose values leave the band for longer than noise would
//! explain is not going as it should: the object was missed, something blocks the way, what was held is lost. Two
//! tables are kept apart on purpose: [`crate::ExpectedSensors`] bends the plan and is best recorded without the object
//! (with it, the inner forces of the grasp would drag the hand away whenever the object is not there); this one is only
//! compared with, and comes from runs that met the object.

use crate::{Entry, PhaseTable, Scalar, TableError, bounds};

/// Mean and spread of `CHANNELS` values by phase, in up to `CAPACITY` points.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorStatistics<T, const CHANNELS: usize, const CAPACITY: usize> {
    mean: PhaseTable<T, CHANNELS, CAPACITY>,
    spread: PhaseTable<T, CHANNELS, CAPACITY>,
    trials: u16,
}

impl<T: Scalar, const CHANNELS: usize, const CAPACITY: usize> SensorStatistics<T, CHANNELS, CAPACITY> {
    /// From points evenly spaced in progress from 0 to 1: middle and spread of each channel over `trials`
    /// successful runs.
    ///
    /// # Errors
    /// [`TableError::Spread`] for a spread below 1e-6 (the floor belongs into the table, so that no reader can
    /// forget it), [`TableError::Shape`] for tables of different length, [`TableError::Trials`] for no run at all,
    /// [`TableError::TooLarge`] for a value that no sensor has, otherwise as [`PhaseTable::new`].
    pub fn new(mean: &[[T; CHANNELS]], spread: &[[T; CHANNELS]], trials: u16) -> Result<Self, TableError> {
        let statistics = Self { mean: PhaseTable::new(mean)?, spread: PhaseTable::new(spread)?, trials };
        statistics.check()?;
        Ok(statistics)
    }

    fn check(&self) -> Result<(), TableError> {
        if self.mean.samples().len() != self.spread.samples().len() {
            Err(TableError::Shape)
        } else if self
            .spread
            .samples()
            .iter()
            .flatten()
            .any(|spread| !(*spread >= T::from_f64(bounds::SMALLEST_SPREAD)))
        {
            Err(TableError::Spread)
        } else if let Some((point, column)) = self.mean.first_beyond(bounds::LARGEST_SENSOR_VALUE) {
            Err(TableError::TooLarge(Entry::Mean { point, column }))
        } else if let Some((point, column)) = self.spread.first_beyond(bounds::LARGEST_SENSOR_VALUE) {
            Err(TableError::TooLarge(Entry::Spread { point, column }))
        } else if self.trials == 0 {
            Err(TableError::Trials)
        } else {
            Ok(())
        }
    }

    /// No points, for statics that are filled by [`assign`](Self::assign).
    pub const EMPTY: Self = Self { mean: PhaseTable::EMPTY, spread: PhaseTable::EMPTY, trials: 0 };

    /// As [`SensorStatistics::new`], in place, point after point.
    ///
    /// # Errors
    /// As [`SensorStatistics::new`] and [`PhaseTable::assign`]; the statistics are then empty.
    pub fn assign(
        &mut self,
        mean: impl IntoIterator<Item = T>,
        spread: impl IntoIterator<Item = T>,
        trials: u16,
    ) -> Result<(), TableError> {
        self.trials = trials;
        let filled = self.mean.assign(mean).and_then(|()| self.spread.assign(spread));
        let result = filled.and_then(|()| self.check());
        if result.is_err() {
            self.clear();
        }
        result
    }

    /// Takes over the points of others.
    pub fn copy_from(&mut self, other: &Self) {
        self.mean.copy_from(&other.mean);
        self.spread.copy_from(&other.spread);
        self.trials = other.trials;
    }

    /// Forgets all points.
    pub fn clear(&mut self) {
        self.mean.clear();
        self.spread.clear();
        self.trials = 0;
    }

    /// True without points.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.mean.samples().is_empty()
    }

    /// Middle of each channel at progress `u`; beyond the ends the end values hold.
    #[inline]
    pub fn mean_at(&self, u: T) -> [T; CHANNELS] {
        self.mean.at(u)
    }

    /// Spread of each channel at progress `u`: positive, but 0 without points.
    #[inline]
    pub fn spread_at(&self, u: T) -> [T; CHANNELS] {
        self.spread.at(u)
    }

    /// Returns the z-score of each value of `x` at progress `u`: its distance from the mean in spreads, with sign.
    /// Without points there is nothing to divide by: ask [`is_empty`](Self::is_empty) first.
    #[inline]
    pub fn z_score(&self, u: T, x: &[T; CHANNELS]) -> [T; CHANNELS] {
        let (mean, spread) = (self.mean.at(u), self.spread.at(u));
        core::array::from_fn(|i| (x[i] - mean[i]) / spread[i])
    }

    /// Successful runs it was made from.
    pub fn trials(&self) -> u16 {
        self.trials
    }

    /// The points of the mean.
    pub fn mean(&self) -> &[[T; CHANNELS]] {
        self.mean.samples()
    }

    /// The points of the spread.
    pub fn spread(&self) -> &[[T; CHANNELS]] {
        self.spread.samples()
    }
}
