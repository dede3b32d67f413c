//! From recorded sensor values to [`ExpectedSensors`] and to the weights `K2` of Eq. (8).

use std::vec::Vec;

use super::statistics::phase_statistics;
use crate::{ExpectedSensors, TableError};

/// Fewest recordings whose spread says something about the sensors; with two, chance decides.
pub const FEWEST_TRIALS: usize = 3;

/// `K2` stays between 1 and this factor below and above 1: a sensor is trusted less where it scattered, never silenced,
/// and never trusted so much that a chance coincidence of three recordings becomes a gain.
pub const WEIGHT_RANGE: f64 = 4.0;

/// Square of a sensor value (N^2) beside which no spread counts: the reciprocal would be denormal, and its share 0/0.
const LARGEST_SQUARE: f64 = 1e100;

/// The expectation at `count` evenly spaced phases from samples at arbitrary progress `u`.
///
/// `recorded_duration` is the duration tau of the recorded run, s. How samples become entries, see
/// [`phase_statistics`].
///
/// # Errors
/// [`TableError::Empty`] without a usable sample, [`TableError::TooMany`], [`TableError::NotFinite`],
/// [`TableError::Duration`], [`TableError::TooLarge`] for a value that no sensor has.
pub fn expected_sensors<const SENSORS: usize, const CAPACITY: usize>(
    samples: &[(f64, [f64; SENSORS])],
    count: usize,
    recorded_duration: f64,
) -> Result<ExpectedSensors<f64, SENSORS, CAPACITY>, TableError> {
    if count > CAPACITY {
        return Err(TableError::TooMany);
    }
    ExpectedSensors::new(&phase_statistics(&[samples], count)?.mean, recorded_duration)
}

/// The weights `K2` of Eq. (8) at `count` evenly spaced phases from the spread of `trials` recordings.
///
/// `K2_i(u) = k_i/(sigma_i(u)^2 + sigma_min_i^2)` with `sigma_min_i` = `floor` times the root mean square of `sigma_i`
/// over the phase, but at least `resolution[i]` (N or N m): what a sensor cannot tell, or the dead band behind it
/// drops, is no reason to trust it less. `k_i` is such that the mean over the phase is 1 before it is kept within
/// [`WEIGHT_RANGE`]: a sensor counts more where it repeats itself, while `K1` keeps its meaning in every row, whatever
/// the units of the sensors. `sigma^2` is averaged around each phase first. A sensor that never moved has weight 1.
///
/// # Errors
/// [`TableError::Trials`] below [`FEWEST_TRIALS`], [`TableError::Negative`] for a floor that is not positive or a
/// negative resolution (without a floor a silent sensor would outweigh all others), [`TableError::Empty`],
/// [`TableError::NotFinite`].
pub fn weights_from_spread<const SENSORS: usize>(
    spread: &[[f64; SENSORS]],
    trials: usize,
    count: usize,
    floor: f64,
    resolution: &[f64; SENSORS],
) -> Result<Vec<[f64; SENSORS]>, TableError> {
    if trials < FEWEST_TRIALS {
        return Err(TableError::Trials);
    }
    if !(floor > 0.0 && floor.is_finite()) || resolution.iter().any(|smallest| !(*smallest >= 0.0)) {
        return Err(TableError::Negative);
    }
    if spread.is_empty() || count == 0 {
        return Err(TableError::Empty);
    }
    if !spread.iter().flatten().all(|sigma| sigma.is_finite()) {
        return Err(TableError::NotFinite);
    }
    let squares: Vec<(f64, [f64; SENSORS])> = spread
        .iter()
        .enumerate()
        .map(|(i, sigma)| (i as f64 / (spread.len() - 1).max(1) as f64, sigma.map(|sigma| sigma * sigma)))
        .collect();
    let mut weights = phase_statistics(&[squares.as_slice()], count)?.mean;
    for sensor in 0..SENSORS {
        let mean = squares.iter().map(|(_, squares)| squares[sensor]).sum::<f64>() / squares.len() as f64;
        let (share, smallest) = (floor * floor * mean, resolution[sensor] * resolution[sensor]);
        let smallest = share.max(smallest);
        if !(share > f64::MIN_POSITIVE && smallest < LARGEST_SQUARE) {
            // Nothing to divide by, or equal weights that scaling would leave a rounding error beside 1.
            weights.iter_mut().for_each(|point| point[sensor] = 1.0);
            continue;
        }
        weights.iter_mut().for_each(|point| point[sensor] = 1.0 / (point[sensor] + smallest));
        let scale = count as f64 / weights.iter().map(|point| point[sensor]).sum::<f64>();
        for point in &mut weights {
            point[sensor] = (point[sensor] * scale).clamp(1.0 / WEIGHT_RANGE, WEIGHT_RANGE);
        }
    }
    Ok(weights)
}
