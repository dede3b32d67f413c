//! `PhaseTable`: values over the progress u in [0, 1], linearly interpolated.
//!
//! Tables are indexed by phase and not by time, so that they survive a change of the duration. Samples sit at
//! `u = 0, 1/(n-1), ..., 1`; outside that interval the end values hold. One sample means a constant.

use core::fmt;

use crate::vector::all_finite;
use crate::{Scalar, bounds};

/// `COLUMNS` values at up to `CAPACITY` evenly spaced phases.
#[derive(Clone, Debug)]
pub struct PhaseTable<T, const COLUMNS: usize, const CAPACITY: usize> {
    count: usize,
    samples: [[T; COLUMNS]; CAPACITY],
}

/// Equal if the samples in use are: what an earlier table left behind them does not count.
impl<T: PartialEq, const COLUMNS: usize, const CAPACITY: usize> PartialEq for PhaseTable<T, COLUMNS, CAPACITY> {
    fn eq(&self, other: &Self) -> bool {
        self.samples.get(..self.count) == other.samples.get(..other.count)
    }
}

/// Why a table is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum TableError {
    /// No sample at all.
    Empty,
    /// More samples than the table can hold.
    TooMany,
    /// A value is NaN or infinite.
    NotFinite,
    /// A gain or limit is negative.
    Negative,
    /// The duration of the recording is not a positive number up to 3600 s.
    Duration,
    /// A spread is below 1e-6: that sensor would never be allowed to differ from its mean.
    Spread,
    /// The number of values is no multiple of the columns, or two tables that belong together differ in length.
    Shape,
    /// Fewer recordings than it takes to tell a spread.
    Trials,
    /// A value is larger than anything real, see [`bounds`](crate::bounds).
    TooLarge(Entry),
}

/// A value of coupling gains, expectation or statistics; points by phase and columns count from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Entry {
    /// Limit of the displacement, m.
    Displacement,
    /// Limit of the rotation, rad.
    Rotation,
    /// Limit of a point row, in its unit.
    PointDisplacement,
    /// Sensitivity `K1`.
    Sensitivity {
        /// Point by phase.
        point: u8,
        /// Coupled row.
        column: u8,
    },
    /// Weight `K2`.
    SensorWeight {
        /// Point by phase.
        point: u8,
        /// Sensor.
        column: u8,
    },
    /// Expected sensor value.
    Expected {
        /// Point by phase.
        point: u8,
        /// Sensor.
        column: u8,
    },
    /// Mean of sensor statistics.
    Mean {
        /// Point by phase.
        point: u8,
        /// Channel.
        column: u8,
    },
    /// Spread of sensor statistics.
    Spread {
        /// Point by phase.
        point: u8,
        /// Channel.
        column: u8,
    },
}

impl fmt::Display for Entry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, point, column) = match *self {
            Self::Displacement => return f.write_str("the limit of the displacement"),
            Self::Rotation => return f.write_str("the limit of the rotation"),
            Self::PointDisplacement => return f.write_str("the limit of a point row"),
            Self::Sensitivity { point, column } => ("sensitivity", point, column),
            Self::SensorWeight { point, column } => ("sensor weight", point, column),
            Self::Expected { point, column } => ("expected value", point, column),
            Self::Mean { point, column } => ("mean of the statistics", point, column),
            Self::Spread { point, column } => ("spread of the statistics", point, column),
        };
        write!(f, "the {name} at point {point}, column {column} (from 0)")
    }
}

impl fmt::Display for TableError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TooLarge(entry) => return write!(f, "{entry} is larger than anything real"),
            Self::Empty => "the table has no samples",
            Self::TooMany => "the table has more samples than fit",
            Self::NotFinite => "the table holds a value that is not a number",
            Self::Negative => "a gain or limit is negative",
            Self::Duration => "the duration of the recording is not a positive number up to 3600 s",
            Self::Spread => "a spread is not at least 1e-6",
            Self::Shape => "the tables do not have the sizes that belong together",
            Self::Trials => "more recordings are needed",
        })
    }
}

impl core::error::Error for TableError {}

impl<T: Scalar, const COLUMNS: usize, const CAPACITY: usize> PhaseTable<T, COLUMNS, CAPACITY> {
    /// The same values at every phase.
    ///
    /// # Errors
    /// [`TableError::NotFinite`], or [`TableError::TooMany`] if the capacity is 0.
    pub fn constant(values: [T; COLUMNS]) -> Result<Self, TableError> {
        Self::new(&[values])
    }

    /// Samples at evenly spaced progress from 0 to 1.
    ///
    /// # Errors
    /// [`TableError::Empty`], [`TableError::TooMany`], [`TableError::NotFinite`].
    pub fn new(samples: &[[T; COLUMNS]]) -> Result<Self, TableError> {
        if samples.is_empty() {
            return Err(TableError::Empty);
        }
        let mut table = Self { count: samples.len(), samples: [[T::ZERO; COLUMNS]; CAPACITY] };
        let Some(target) = table.samples.get_mut(..samples.len()) else {
            return Err(TableError::TooMany);
        };
        if !samples.iter().all(|sample| all_finite(sample)) {
            return Err(TableError::NotFinite);
        }
        target.copy_from_slice(samples);
        Ok(table)
    }

    /// No samples, for statics that are filled by [`assign`](Self::assign). It reads as 0 everywhere.
    pub const EMPTY: Self = Self { count: 0, samples: [[T::ZERO; COLUMNS]; CAPACITY] };

    /// Replaces the samples by `values`, point after point, without a second table on the stack.
    ///
    /// # Errors
    /// As [`PhaseTable::new`], and [`TableError::Shape`] for a point that is cut short. The table is then empty.
    pub fn assign(&mut self, values: impl IntoIterator<Item = T>) -> Result<(), TableError> {
        self.count = 0;
        let mut values = values.into_iter();
        let mut count = 0;
        while let Some(first) = values.next() {
            let place = self.samples.get_mut(count).ok_or(TableError::TooMany)?;
            for (column, entry) in place.iter_mut().enumerate() {
                let value = if column == 0 { first } else { values.next().ok_or(TableError::Shape)? };
                if !value.is_finite() {
                    return Err(TableError::NotFinite);
                }
                *entry = value;
            }
            count += 1;
        }
        if count == 0 {
            return Err(TableError::Empty);
        }
        self.count = count;
        Ok(())
    }

    /// Point and column of the first value whose magnitude is not at most `largest`.
    pub(crate) fn first_beyond(&self, largest: f64) -> Option<(u8, u8)> {
        let beyond = |sample: &[T; COLUMNS]| bounds::first_beyond(sample, T::from_f64(largest));
        let (point, column) =
            self.samples().iter().enumerate().find_map(|(point, sample)| Some((point, beyond(sample)?)))?;
        let number = |place: usize| u8::try_from(place).unwrap_or(u8::MAX);
        Some((number(point), number(column)))
    }

    /// Takes over the samples of another table, and only those in use.
    pub fn copy_from(&mut self, other: &Self) {
        let samples = other.samples();
        if let Some(target) = self.samples.get_mut(..samples.len()) {
            target.copy_from_slice(samples);
            self.count = samples.len();
        }
    }

    /// Without samples.
    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// The samples.
    #[inline]
    pub fn samples(&self) -> &[[T; COLUMNS]] {
        self.samples.get(..self.count).unwrap_or(&self.samples)
    }

    /// The values at progress `u`.
    #[inline]
    pub fn at(&self, u: T) -> [T; COLUMNS] {
        let samples = self.samples();
        let (Some(first), Some(last)) = (samples.first(), samples.last()) else {
            return [T::ZERO; COLUMNS];
        };
        if !(u > T::ZERO) {
            return *first;
        }
        if u >= T::ONE {
            return *last;
        }
        let intervals = samples.len() - 1;
        let place = u * T::from_index(intervals);
        let left = place.to_index().min(intervals.saturating_sub(1));
        let weight = place - T::from_index(left);
        // One sample alone is a constant.
        let (Some(from), Some(to)) = (samples.get(left), samples.get(left + 1)) else { return *first };
        let mut values = *from;
        values.iter_mut().zip(to).for_each(|(value, to)| *value = *value + (*to - *value) * weight);
        values
    }
}
