//! From recorded sensor values to an [`ExpectedWrench`].

use std::vec::Vec;

use crate::{ExpectedWrench, SENSORS, TableError};

/// The expectation at `count` evenly spaced phases from samples at arbitrary progress `u`.
///
/// Every sample is shared between the two neighbouring entries by its distance, and each entry is the weighted mean: a
/// triangular average, which does not shift the record in phase. Entries without any sample are interpolated. Samples
/// outside 0..=1 are left out. `recorded_duration` is the duration tau of the recorded run, s.
///
/// # Errors
/// [`TableError::Empty`] without a usable sample, [`TableError::TooMany`], [`TableError::NotFinite`],
/// [`TableError::Duration`].
pub fn expected_wrench(
    samples: &[(f64, [f64; SENSORS])],
    count: usize,
    recorded_duration: f64,
) -> Result<ExpectedWrench<f64>, TableError> {
    let Some(last) = count.checked_sub(1) else {
        return Err(TableError::Empty);
    };
    if count > crate::EXPECTED_CAPACITY {
        return Err(TableError::TooMany);
    }
    let mut sums = std::vec![([0.0; SENSORS], 0.0); count];
    for (u, values) in samples {
        if !u.is_finite() || !values.iter().all(|value| value.is_finite()) {
            return Err(TableError::NotFinite);
        }
        if !(0.0..=1.0).contains(u) {
            continue;
        }
        let place = u * last as f64;
        let left = (place as usize).min(last.saturating_sub(1));
        let share = place - left as f64;
        for (entry, weight) in [(left, 1.0 - share), ((left + 1).min(last), share)] {
            let (sum, total) = &mut sums[entry];
            *total += weight;
            for (sum, value) in sum.iter_mut().zip(values) {
                *sum += weight * value;
            }
        }
    }
    let known: Vec<(usize, [f64; SENSORS])> = sums
        .iter()
        .enumerate()
        .filter(|(_, (_, total))| *total > 1e-9)
        .map(|(i, (sum, total))| (i, sum.map(|sum| sum / total)))
        .collect();
    let (Some(first), Some(end)) = (known.first(), known.last()) else {
        return Err(TableError::Empty);
    };
    let table: Vec<[f64; SENSORS]> = (0..count)
        .map(|i| {
            let after = known.partition_point(|(k, _)| *k < i);
            match (after.checked_sub(1).map(|b| &known[b]), known.get(after)) {
                (_, Some((k, values))) if *k == i => *values,
                (Some((a, low)), Some((b, high))) => {
                    let share = (i - a) as f64 / (b - a) as f64;
                    core::array::from_fn(|c| low[c] + (high[c] - low[c]) * share)
                }
                (None, _) => first.1,
                (_, None) => end.1,
            }
        })
        .collect();
    ExpectedWrench::new(&table, recorded_duration)
}
