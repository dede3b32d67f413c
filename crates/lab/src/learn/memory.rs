//! From recordings of runs to what a primitive remembers of them: the expectation (and the weights K2) from rehearsals,
//! the statistics from runs that succeeded.

use std::path::PathBuf;

use control::flags;
use control::plan::primitive::{EXPECTED_CAPACITY, SENSORS, STATISTICS_CHANNELS};
use dmp::TableError;
use dmp::fit::{FEWEST_TRIALS, phase_statistics, weights_from_spread};
use serde::Serialize;
use thiserror::Error;

use super::calibration::calibrated;
use crate::demonstration::{Played, Recording};
use crate::primitive_file::{ExpectationTable, PrimitiveFile, StatisticsTable};

/// Points of the weights K2: coarse, because the spread of a few runs is itself uncertain.
const WEIGHT_POINTS: usize = 16;

/// `sigma_min` of K2 relative to the mean spread of a sensor. With a half, the most repeatable phase counts at most
/// five times as much as one of ordinary spread.
const SPREAD_FLOOR: f64 = 0.5;

/// Resolution of the sensors: the controller's dead band on force and torque, and the same for the gauges. The
/// stick-slip of the joints scatters by a tenth of a newton where a movement is slow; without this floor K2 would make
/// the arm four times deafer there than at its end.
const RESOLUTION: [f64; SENSORS] = {
    let (f, n) = (control::sense::deviation::FORCE_DEAD_BAND, control::sense::deviation::TORQUE_DEAD_BAND);
    [f, f, f, n, n, n, 0.05, 0.05, 0.05]
};

/// Smallest spread of each channel: what objects and grasps that are all good differ by, however alike
/// the gathered runs were. Force 0.5 N, torque 0.06 N m (that force at the distance of the fingers), gauges 0.15 N m (a
/// finger that happens to carry the object alone), fingers 0.025 rad.
const STATISTICS_FLOOR: [f64; STATISTICS_CHANNELS] =
    [0.5, 0.5, 0.5, 0.06, 0.06, 0.06, 0.15, 0.15, 0.15, 0.025, 0.025, 0.025];

/// A recording must cover the movement from this progress at the latest to one minus this at the earliest.
const MARGIN: f64 = 0.02;

/// Largest deviation of the duration within the recordings that are averaged.
const SAME_DURATION: f64 = 0.03;

/// Durations that a success may have, relative to the taught one: speeds from 0.1 to 2, and what heat or contact
/// delays. Another one is a time in other units, or none of this movement.
const FASTEST: f64 = 2.2;
const SLOWEST: f64 = 20.0;

/// Largest share of samples without a fresh wrench.
const MOST_STALE: f64 = 0.02;

/// Why recordings cannot be remembered.
#[derive(Debug, Error)]
pub enum MemoryError {
    /// There are none.
    #[error("no recordings are given")]
    None,
    /// Two recordings are of one run: it would count as two that are alike.
    #[error("{again} holds the same run as {file}, sample by sample", again = again.display(), file = file.display())]
    Twice {
        /// The earlier recording.
        file: PathBuf,
        /// The later one.
        again: PathBuf,
    },
    /// A recording lacks columns.
    #[error("{file}: line {line}: the columns {columns} are needed", file = file.display())]
    Columns {
        /// The recording.
        file: PathBuf,
        /// Line of its header.
        line: u64,
        /// The missing columns.
        columns: &'static str,
    },
    /// A recording does not cover the movement.
    #[error("{file}: the run is recorded from {from:.0} % to {to:.0} % of the movement only", file = file.display())]
    Incomplete {
        /// The recording.
        file: PathBuf,
        /// Where it begins, percent.
        from: f64,
        /// Where it ends, percent.
        to: f64,
    },
    /// A recording holds more than one run: their mean is neither.
    #[error("{file}: line {line}: another run begins here", file = file.display())]
    Several {
        /// The recording.
        file: PathBuf,
        /// Line of the first sample of the second run.
        line: u64,
    },
    /// The force sensor was saturated: its values are not the forces.
    #[error("{file}: the force sensor was saturated in {samples} samples", file = file.display())]
    Saturated {
        /// The recording.
        file: PathBuf,
        /// Samples.
        samples: usize,
    },
    /// Too many samples hold an old wrench.
    #[error("{file}: the force sensor was silent in {samples} samples", file = file.display())]
    Stale {
        /// The recording.
        file: PathBuf,
        /// Samples.
        samples: usize,
    },
    /// The device held the run back for so long that it is not of the speed that was asked for.
    #[error(
        "{file}: the run was held to half of the taught speed in {samples} samples, because the pendant warned or a \
         motor was hot", file = file.display()
    )]
    HeldBack {
        /// The recording.
        file: PathBuf,
        /// Samples.
        samples: usize,
    },
    /// The recordings were not made at one speed, or not of this movement.
    #[error("{file}: the movement took {found:.2} s, {expected:.2} s were expected", file = file.display())]
    Duration {
        /// The recording.
        file: PathBuf,
        /// Duration of the movement in it, s.
        found: f64,
        /// Duration expected, s.
        expected: f64,
    },
    /// A recording says that it shows another movement.
    #[error("{file}: shows the movement {found}, the primitive is {expected}", file = file.display())]
    Others {
        /// The recording.
        file: PathBuf,
        /// The movement in it.
        found: Played,
        /// The movement of the primitive.
        expected: Played,
    },
    /// The statistics refuse.
    #[error("the recordings cannot be averaged: {0}")]
    Table(#[from] TableError),
}

/// Values of one run, each with the progress at which it was measured.
type Samples<const CHANNELS: usize> = Vec<(f64, [f64; CHANNELS])>;

/// A load that the hand carries from the beginning of a rehearsal.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Payload {
    /// Mass beyond the hand, kg.
    pub mass: f64,
    /// Its centre in the tool frame, m.
    pub centre: [f64; 3],
}

/// Summary of an expectation.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct MemorySummary {
    /// Runs that were averaged.
    pub trials: u32,
    /// Duration of the runs, s.
    pub duration_s: f64,
    /// Points by phase.
    pub points: usize,
    /// Largest mean of each channel by magnitude, with its sign.
    pub extremes: Vec<f64>,
    /// Root mean square spread of each channel over the phase.
    pub spread: Vec<f64>,
    /// Of the statistics: how far a hand that closes on nothing goes, as a share of the watch's limit; above 1 it is
    /// told.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub empty_hand: Option<f64>,
}

/// Puts the expectation of these rehearsals into a primitive, and K2 if there are enough of them and `weigh`. The
/// statistics of earlier runs are dropped: they were gathered with another expectation.
///
/// `duration` is that of the runs, s.
///
/// # Errors
/// [`MemoryError`]; the primitive is then unchanged.
pub fn remember_rehearsals(
    primitive: &mut PrimitiveFile,
    recordings: &[Recording],
    duration: f64,
    payload: Payload,
    weigh: bool,
) -> Result<MemorySummary, MemoryError> {
    let runs = runs::<SENSORS>(primitive, recordings, duration, sensors)?;
    let trials: Vec<_> = runs.iter().map(Vec::as_slice).collect();
    let statistics = phase_statistics(&trials, EXPECTED_CAPACITY)?;
    let weights = if weigh && statistics.trials >= FEWEST_TRIALS {
        Some(weights_from_spread(&statistics.spread, statistics.trials, WEIGHT_POINTS, SPREAD_FLOOR, &RESOLUTION)?)
    } else {
        None
    };
    if let Some(feedback) = &mut primitive.feedback {
        feedback.k2 = match weights {
            Some(weights) => rows(&weights),
            None => vec![vec![1.0; SENSORS]],
        };
    }
    let trials = u32::try_from(statistics.trials).unwrap_or(u32::MAX);
    primitive.expectation = Some(ExpectationTable {
        model_hash: primitive.model_hash,
        recorded_duration: duration,
        payload_mass: payload.mass,
        payload_centre: payload.centre,
        filter_cutoff: control::sense::wrench::WRENCH_CUT_OFF,
        trials,
        spread_floor: SPREAD_FLOOR,
        mean: rows(&statistics.mean),
        spread: rows(&statistics.spread),
    });
    primitive.statistics = None;
    Ok(summary(trials, duration, &statistics.mean, &statistics.spread))
}

/// Puts the statistics of these successful runs into a primitive; they must have been made at one speed. The more they
/// differ (in place of the object, arm and mode), the less will be told of a run that is only unusual.
///
/// # Errors
/// [`MemoryError`]; the primitive is then unchanged.
pub fn remember_successes(
    primitive: &mut PrimitiveFile,
    recordings: &[Recording],
) -> Result<MemorySummary, MemoryError> {
    let first = recordings.first().ok_or(MemoryError::None)?;
    for (index, again) in recordings.iter().enumerate() {
        if let Some(earlier) = recordings[..index].iter().find(|earlier| is_same_run(earlier, again)) {
            return Err(MemoryError::Twice { file: earlier.file.clone(), again: again.file.clone() });
        }
    }
    let (_, duration) = progress(first, primitive.movement.alpha)?;
    let taught = primitive.movement.duration;
    if !(taught / FASTEST..=taught * SLOWEST).contains(&duration) {
        return Err(MemoryError::Duration { file: first.file.clone(), found: duration, expected: taught });
    }
    let runs = runs::<STATISTICS_CHANNELS>(primitive, recordings, duration, channels)?;
    let calibrated = calibrated(primitive, &runs, &STATISTICS_FLOOR)?;
    let gathered = &calibrated.statistics;
    let trials = u32::from(gathered.trials());
    primitive.statistics =
        Some(StatisticsTable { trials, mean: rows(gathered.mean()), spread: rows(gathered.spread()) });
    let empty_hand = Some(calibrated.empty_hand);
    Ok(MemorySummary { empty_hand, ..summary(trials, duration, gathered.mean(), gathered.spread()) })
}

/// Two files hold one run: their bytes are the same, or their samples are and only the notes above them differ. Two
/// runs never measure the same to the last digit.
fn is_same_run(one: &Recording, other: &Recording) -> bool {
    one.checksum == other.checksum
        || (&one.time, &one.q, &one.wrench, &one.gauges, &one.hand)
            == (&other.time, &other.q, &other.wrench, &other.gauges, &other.hand)
}

/// A progress in percent of the movement: neither below zero nor beyond its end, and zero has no sign.
fn percent(progress: f64) -> f64 {
    100.0 * progress.clamp(0.0, 1.0) + 0.0
}

/// Progress of every sample of the movement itself with its index, and the duration of the movement that follows from
/// it, s.
fn progress(recording: &Recording, alpha: f64) -> Result<(Vec<(usize, f64)>, f64), MemoryError> {
    let phase = recording.phase.as_ref().ok_or_else(|| columns(recording, "phase"))?;
    let samples: Vec<(usize, f64)> =
        phase.iter().enumerate().filter(|(_, s)| **s > 0.0).map(|(index, s)| (index, -s.ln() / alpha)).collect();
    // Progress never goes back but where a movement is begun anew.
    if let Some(pair) = samples.windows(2).find(|pair| pair[1].1 < pair[0].1 - MARGIN) {
        let line = recording.lines.get(pair[1].0).copied().unwrap_or_default();
        return Err(MemoryError::Several { file: recording.file.clone(), line });
    }
    let incomplete = |from: f64, to: f64| MemoryError::Incomplete {
        file: recording.file.clone(),
        from: percent(from),
        to: percent(to),
    };
    let (Some(first), Some(last)) = (samples.first(), samples.iter().rev().find(|(_, u)| *u <= 1.0)) else {
        return Err(incomplete(0.0, 0.0));
    };
    if first.1 > MARGIN || last.1 < 1.0 - MARGIN {
        return Err(incomplete(first.1, last.1));
    }
    let duration = (recording.time[last.0] - recording.time[first.0]) / (last.1 - first.1);
    Ok((samples, duration))
}

/// The samples of every recording by progress, after the recordings have been found fit.
fn runs<const CHANNELS: usize>(
    primitive: &PrimitiveFile,
    recordings: &[Recording],
    duration: f64,
    pick: fn(&Recording) -> Result<Vec<[f64; CHANNELS]>, MemoryError>,
) -> Result<Vec<Samples<CHANNELS>>, MemoryError> {
    if recordings.is_empty() {
        return Err(MemoryError::None);
    }
    let expected = Played { name: primitive.name.clone(), movement: primitive.movement_checksum() };
    recordings
        .iter()
        .map(|recording| {
            if let Some(found) = recording.origin.primitive.clone().filter(|found| found.movement != expected.movement)
            {
                return Err(MemoryError::Others { file: recording.file.clone(), found, expected: expected.clone() });
            }
            if let Some(second) = recording.runs().get(1) {
                let line = recording.lines.get(second.start).copied().unwrap_or_default();
                return Err(MemoryError::Several { file: recording.file.clone(), line });
            }
            let run = recording.running();
            let count = |mask: u32| run.flags.iter().flatten().filter(|flags| **flags & mask != 0).count();
            let (samples, found) = progress(&run, primitive.movement.alpha)?;
            if (found - duration).abs() > SAME_DURATION * duration || !found.is_finite() {
                let held_back = count(flags::SLOWED);
                if held_back > 0 {
                    return Err(MemoryError::HeldBack { file: recording.file.clone(), samples: held_back });
                }
                return Err(MemoryError::Duration { file: recording.file.clone(), found, expected: duration });
            }
            if let Some(marks) = &run.flags {
                let (saturated, stale) = (count(flags::SENSOR_SATURATED), count(flags::WRENCH_STALE));
                if saturated > 0 {
                    return Err(MemoryError::Saturated { file: recording.file.clone(), samples: saturated });
                }
                if stale as f64 > MOST_STALE * marks.len() as f64 {
                    return Err(MemoryError::Stale { file: recording.file.clone(), samples: stale });
                }
            }
            let values = pick(&run)?;
            Ok(samples.into_iter().map(|(index, u)| (u, values[index])).collect())
        })
        .collect()
}

/// The sensor values of a recording: wrench and gauges.
fn sensors(recording: &Recording) -> Result<Vec<[f64; SENSORS]>, MemoryError> {
    let wrench = recording.wrench.as_ref().ok_or_else(|| columns(recording, "fx_N to tz_Nm"))?;
    let gauges = recording.gauges.as_ref().ok_or_else(|| columns(recording, "gauge1_Nm to gauge3_Nm"))?;
    Ok(wrench
        .iter()
        .zip(gauges)
        .map(|([fx, fy, fz, tx, ty, tz], [g1, g2, g3])| [*fx, *fy, *fz, *tx, *ty, *tz, *g1, *g2, *g3])
        .collect())
}

/// The channels of the statistics: the sensors, then the fingers.
fn channels(recording: &Recording) -> Result<Vec<[f64; STATISTICS_CHANNELS]>, MemoryError> {
    let hand = recording.hand.as_ref().ok_or_else(|| columns(recording, "spread_rad to finger3_rad"))?;
    let sensors = sensors(recording)?;
    Ok(sensors
        .iter()
        .zip(hand)
        .map(|(sensors, hand)| {
            let mut channels = [0.0; STATISTICS_CHANNELS];
            channels[..SENSORS].copy_from_slice(sensors);
            channels[SENSORS..].copy_from_slice(&hand[1..]);
            channels
        })
        .collect())
}

fn columns(recording: &Recording, columns: &'static str) -> MemoryError {
    MemoryError::Columns { file: recording.file.clone(), line: recording.header_line, columns }
}

fn rows<const COLUMNS: usize>(table: &[[f64; COLUMNS]]) -> Vec<Vec<f64>> {
    table.iter().map(|row| row.to_vec()).collect()
}

fn summary<const CHANNELS: usize>(
    trials: u32,
    duration: f64,
    mean: &[[f64; CHANNELS]],
    spread: &[[f64; CHANNELS]],
) -> MemorySummary {
    let extreme = |channel: usize| {
        mean.iter().map(|point| point[channel]).fold(0.0, |best: f64, x| if x.abs() > best.abs() { x } else { best })
    };
    let scatter = |channel: usize| {
        (spread.iter().map(|point| point[channel].powi(2)).sum::<f64>() / spread.len().max(1) as f64).sqrt()
    };
    MemorySummary {
        trials,
        duration_s: duration,
        points: mean.len(),
        extremes: (0..CHANNELS).map(extreme).collect(),
        spread: (0..CHANNELS).map(scatter).collect(),
        empty_hand: None,
    }
}
