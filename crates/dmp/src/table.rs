//! `PhaseTable`: values over the progress u in [0, 1], linearly interpolated.
//!
//! Tables are indexed by phase and not by time, so that they survive a change of the duration. Samples sit at
//! `u = 0, 1/(n-1), ..., 1`; outside that interval the end values hold. One sample means a constant.

use core::fmt;

use crate::Scalar;
use crate::vector::all_finite;

/// `COLUMNS` values at up to `CAPACITY` evenly spaced phases.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseTable<T, const COLUMNS: usize, const CAPACITY: usize> {
    count: usize,
    samples: [[T; COLUMNS]; CAPACITY],
}

/// Why a table is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
    /// The duration of the recording is not a positive number.
    Duration,
}

impl fmt::Display for TableError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Empty => "the table has no samples",
            Self::TooMany => "the table has more samples than fit",
            Self::NotFinite => "the table holds a value that is not a number",
            Self::Negative => "a gain or limit is negative",
            Self::Duration => "the duration of the recording is not a positive number",
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

    /// The samples.
    #[inline]
    pub fn samples(&self) -> &[[T; COLUMNS]] {
        self.samples.get(..self.count).unwrap_or(&self.samples)
    }

    /// The values at progress `u`.
    #[inline]
    pub fn at(&self, u: T) -> [T; COLUMNS] {
        let samples = self.samples();
        let Some(last) = samples.len().checked_sub(1) else {
            return [T::ZERO; COLUMNS];
        };
        if last == 0 || !(u > T::ZERO) {
            return samples[0];
        }
        if u >= T::ONE {
            return samples[last];
        }
        let place = u * T::from_index(last);
        let left = place.to_index().min(last - 1);
        let weight = place - T::from_index(left);
        let (a, b) = (&samples[left], &samples[left + 1]);
        core::array::from_fn(|i| a[i] + (b[i] - a[i]) * weight)
    }
}
