//! `Experience`: how successful runs felt and where the fingers stood, by phase.
//!
//! Mean `m(u)` and spread `sigma(u)` of twelve channels: the middle of what successful runs felt, and the unit in which a
//! distance from it is judged; `fit::experience` says how they come from recordings. A run whose values leave the band for longer
//! than noise would explain is not going as it should: the object was missed, something blocks the way, what was held is lost. Two tables
//! are kept apart on purpose: [`crate::ExpectedWrench`] bends the plan and is best recorded without the object (with it,
//! the inner forces of the grasp would drag the hand away whenever the object is not there); this one only watches, and
//! comes from runs that met the object.

use crate::{Entry, PhaseTable, Scalar, TableError, bounds};

/// Channels: force x, y, z (N, world axes), torque x, y, z (N m, tool axes at the grasp point), torque of the environment on
/// finger F1, F2, F3 (N m), angle of finger F1, F2, F3 (rad).
pub const EXPERIENCE_CHANNELS: usize = 12;
/// Most points of an experience.
pub const EXPERIENCE_CAPACITY: usize = 64;

/// Mean and spread by phase of what successful runs felt.
///
/// For f32 6.2 kB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Experience<T> {
    mean: PhaseTable<T, EXPERIENCE_CHANNELS, EXPERIENCE_CAPACITY>,
    spread: PhaseTable<T, EXPERIENCE_CHANNELS, EXPERIENCE_CAPACITY>,
    trials: u16,
}

impl<T: Scalar> Experience<T> {
    /// From points evenly spaced in progress from 0 to 1: middle and spread of each channel over `trials`
    /// successful runs.
    ///
    /// # Errors
    /// [`TableError::Spread`] for a spread below 1e-6 (the floor belongs into the table, so that no reader can
    /// forget it), [`TableError::Shape`] for tables of different length, [`TableError::Trials`] for no run at all,
    /// [`TableError::TooLarge`] for a value that no sensor has, otherwise as [`PhaseTable::new`].
    pub fn new(
        mean: &[[T; EXPERIENCE_CHANNELS]],
        spread: &[[T; EXPERIENCE_CHANNELS]],
        trials: u16,
    ) -> Result<Self, TableError> {
        let experience = Self { mean: PhaseTable::new(mean)?, spread: PhaseTable::new(spread)?, trials };
        experience.check()?;
        Ok(experience)
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

    /// Stands for an experience that is not there; never leaves this crate.
    pub(crate) const EMPTY: Self = Self { mean: PhaseTable::EMPTY, spread: PhaseTable::EMPTY, trials: 0 };

    /// As [`Experience::new`], in place, point after point. After an error it is empty.
    pub(crate) fn assign(
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

    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.mean.copy_from(&other.mean);
        self.spread.copy_from(&other.spread);
        self.trials = other.trials;
    }

    pub(crate) fn clear(&mut self) {
        self.mean.clear();
        self.spread.clear();
        self.trials = 0;
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.mean.samples().is_empty()
    }

    /// Middle of each channel at progress `u`; beyond the ends the end values hold.
    #[inline]
    pub fn mean_at(&self, u: T) -> [T; EXPERIENCE_CHANNELS] {
        self.mean.at(u)
    }

    /// Spread (always positive) of each channel at progress `u`.
    #[inline]
    pub fn spread_at(&self, u: T) -> [T; EXPERIENCE_CHANNELS] {
        self.spread.at(u)
    }

    /// How many spreads the values `x` are away from the mean at progress `u`, with sign, channel by channel.
    #[inline]
    pub fn deviation(&self, u: T, x: &[T; EXPERIENCE_CHANNELS]) -> [T; EXPERIENCE_CHANNELS] {
        let (mean, spread) = (self.mean.at(u), self.spread.at(u));
        core::array::from_fn(|i| (x[i] - mean[i]) / spread[i])
    }

    /// Successful runs it was made from.
    pub fn trials(&self) -> u16 {
        self.trials
    }

    /// The points of the mean.
    pub fn mean(&self) -> &[[T; EXPERIENCE_CHANNELS]] {
        self.mean.samples()
    }

    /// The points of the spread.
    pub fn spread(&self) -> &[[T; EXPERIENCE_CHANNELS]] {
        self.spread.samples()
    }
}
