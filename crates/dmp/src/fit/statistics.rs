//! `PhaseStatistics`: mean and spread by phase of the recordings of several runs, and [`SensorStatistics`] from them.

use std::vec::Vec;

use crate::{SensorStatistics, TableError};

/// Mean and spread at evenly spaced phases.
#[derive(Clone, Debug, PartialEq)]
pub struct PhaseStatistics<const CHANNELS: usize> {
    /// Mean over the runs.
    pub mean: Vec<[f64; CHANNELS]>,
    /// Standard deviation of a single sample from that mean, over the runs.
    pub spread: Vec<[f64; CHANNELS]>,
    /// Number of runs.
    pub trials: usize,
}

/// Samples at one entry: sum of the values, of their squared distances from the mean, and of the weights.
#[derive(Clone, Copy)]
struct Entry<const CHANNELS: usize> {
    values: [f64; CHANNELS],
    squares: [f64; CHANNELS],
    weight: f64,
}

/// Mean and spread at `count` evenly spaced phases of runs that were sampled at arbitrary progress `u`.
///
/// Every sample is shared between the two neighbouring entries by its distance, and each entry is the weighted mean: a
/// triangular average, which does not shift the record in phase. Every run has the same weight, however densely it was
/// sampled. The spread is that of the samples about the interpolated mean, so that a steep but repeatable slope is not
/// taken for scatter; it holds the noise of the sensor and the differences between runs (with `n/(n-1)` for the mean
/// that was estimated from the same `n` runs; of one run it is the noise alone). Entries without any sample are
/// interpolated. Samples outside 0..=1 are left out.
///
/// # Errors
/// [`TableError::Empty`] without a usable sample or for `count` = 0, [`TableError::NotFinite`].
pub fn phase_statistics<const CHANNELS: usize>(
    trials: &[&[(f64, [f64; CHANNELS])]],
    count: usize,
) -> Result<PhaseStatistics<CHANNELS>, TableError> {
    let Some(last) = count.checked_sub(1) else {
        return Err(TableError::Empty);
    };
    let samples = || trials.iter().flat_map(|trial| trial.iter());
    if samples().any(|(u, values)| !u.is_finite() || !values.iter().all(|value| value.is_finite())) {
        return Err(TableError::NotFinite);
    }
    let nothing = Entry { values: [0.0; CHANNELS], squares: [0.0; CHANNELS], weight: 0.0 };
    let mut entries = std::vec![nothing; count];
    // A run without a sample within the movement has nothing to share out: dividing by their number would be 0/0.
    let counted: Vec<_> = trials
        .iter()
        .map(|trial| (trial.iter().filter(|(u, _)| (0.0..=1.0).contains(u)).count(), trial))
        .filter(|(within, _)| *within > 0)
        .collect();
    for (within, trial) in &counted {
        for (u, values) in trial.iter() {
            for (entry, share) in places(*u, last) {
                let share = share / *within as f64;
                entries[entry].weight += share;
                for (sum, value) in entries[entry].values.iter_mut().zip(values) {
                    *sum += share * value;
                }
            }
        }
    }
    let mean = fill(&entries, |entry| entry.values.map(|sum| sum / entry.weight))?;
    for (within, trial) in &counted {
        for (u, values) in trial.iter() {
            let between: [(usize, f64); 2] = places(*u, last);
            for (entry, share) in between {
                let weight = share / *within as f64;
                for (channel, value) in values.iter().enumerate() {
                    let expected: f64 = between.iter().map(|(i, share)| share * mean[*i][channel]).sum();
                    entries[entry].squares[channel] += weight * (value - expected) * (value - expected);
                }
            }
        }
    }
    let runs = counted.len();
    let correction = if runs > 1 { runs as f64 / (runs - 1) as f64 } else { 1.0 };
    let spread = fill(&entries, |entry| entry.squares.map(|sum| libm::sqrt(correction * sum / entry.weight)))?;
    Ok(PhaseStatistics { mean, spread, trials: runs })
}

/// Statistics of `count` phases from the recordings of successful runs.
///
/// Runs that met their object in different places differ by far more than noise, and are not normally distributed: a
/// standard deviation would make the outermost of them a failure. So the band goes by the envelope of the runs: the
/// centre is the middle between the smallest and the largest of the runs' means at a phase and its two neighbours (the
/// moment of contact shifts), and the spread is a quarter of their distance, of which normally distributed runs, 20 to
/// 40 of them, span four. A channel marked in `one_sided` is judged upwards only (a finger that closes too far): its
/// centre is the mean, and its spread half the distance from there to the largest.
///
/// `floor` is the smallest spread of each channel: a few runs that agree by chance must not make the next one a
/// failure. Samples beyond progress 1 count at 1, since whoever compares with the statistics goes on with their end.
///
/// # Errors
/// [`TableError::Trials`] without a run, [`TableError::TooMany`] above the capacity, [`TableError::Spread`] for a floor
/// that is not positive or a spread that stays below 1e-6, [`TableError::TooLarge`] for a value that no sensor has,
/// [`TableError::Empty`], [`TableError::NotFinite`].
pub fn sensor_statistics<const CHANNELS: usize, const CAPACITY: usize>(
    trials: &[&[(f64, [f64; CHANNELS])]],
    count: usize,
    floor: &[f64; CHANNELS],
    one_sided: &[bool; CHANNELS],
) -> Result<SensorStatistics<f64, CHANNELS, CAPACITY>, TableError> {
    if trials.is_empty() {
        return Err(TableError::Trials);
    }
    if count > CAPACITY {
        return Err(TableError::TooMany);
    }
    if !floor.iter().all(|floor| *floor > 0.0 && floor.is_finite()) {
        return Err(TableError::Spread);
    }
    let means = trials
        .iter()
        .map(|trial| {
            // `min` would turn a NaN into the end.
            if trial.iter().any(|(u, _)| !u.is_finite()) {
                return Err(TableError::NotFinite);
            }
            let held: Vec<_> = trial.iter().map(|(u, values)| (u.min(1.0), *values)).collect();
            phase_statistics(&[held.as_slice()], count).map(|run| run.mean)
        })
        .collect::<Result<Vec<_>, _>>()?;
    let (mut centre, mut spread) = (Vec::with_capacity(count), Vec::with_capacity(count));
    for i in 0..count {
        let (mut middle, mut width) = ([0.0; CHANNELS], *floor);
        for channel in 0..CHANNELS {
            let is_one_sided = one_sided[channel];
            let around = if is_one_sided { i..i + 1 } else { i.saturating_sub(1)..(i + 2).min(count) };
            let values = || means.iter().flat_map(|run| &run[around.clone()]).map(|point| point[channel]);
            let (low, high) =
                values().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
            let half = if is_one_sided {
                middle[channel] = values().sum::<f64>() / means.len() as f64;
                high - middle[channel]
            } else {
                middle[channel] = 0.5 * (low + high);
                0.5 * (high - low)
            };
            width[channel] = width[channel].max(half / ENVELOPE);
        }
        centre.push(middle);
        spread.push(width);
    }
    SensorStatistics::new(&centre, &spread, u16::try_from(trials.len()).unwrap_or(u16::MAX))
}

/// Spreads from the centre of the runs to the outermost of them.
const ENVELOPE: f64 = 2.0;

/// The entries beside progress `u` and their shares; shares of 0 for a sample outside.
fn places(u: f64, last: usize) -> [(usize, f64); 2] {
    if !(0.0..=1.0).contains(&u) {
        return [(0, 0.0), (0, 0.0)];
    }
    let place = u * last as f64;
    let left = (place as usize).min(last.saturating_sub(1));
    let share = place - left as f64;
    [(left, 1.0 - share), ((left + 1).min(last), share)]
}

/// The value of each entry; entries without samples are interpolated between their neighbours that have some.
fn fill<const CHANNELS: usize>(
    entries: &[Entry<CHANNELS>],
    value: impl Fn(&Entry<CHANNELS>) -> [f64; CHANNELS],
) -> Result<Vec<[f64; CHANNELS]>, TableError> {
    let known: Vec<(usize, [f64; CHANNELS])> = entries
        .iter()
        .enumerate()
        .filter(|(_, entry)| entry.weight > 1e-12)
        .map(|(i, entry)| (i, value(entry)))
        .collect();
    let (Some(first), Some(end)) = (known.first(), known.last()) else {
        return Err(TableError::Empty);
    };
    Ok((0..entries.len())
        .map(|i| {
            let after = known.partition_point(|(k, _)| *k < i);
            match (after.checked_sub(1).map(|before| &known[before]), known.get(after)) {
                (_, Some((k, values))) if *k == i => *values,
                (Some((a, low)), Some((b, high))) => {
                    let share = (i - a) as f64 / (b - a) as f64;
                    core::array::from_fn(|c| low[c] + (high[c] - low[c]) * share)
                }
                (None, _) => first.1,
                (_, None) => end.1,
            }
        })
        .collect())
}
