//! The width of the statistics' band: the device's own watch goes over the runs that it was made from.

use control::guard::Watch;
use control::guard::watch::{FIRST_FINGER, LIMIT};
use control::plan::primitive::{
    ONE_SIDED_CHANNELS, STATISTICS_CAPACITY, STATISTICS_CHANNELS, SensorStatistics, posture_and_hand,
};
use dmp::TableError;
use dmp::fit::{FEWEST_TRIALS, sensor_statistics};

use crate::plan;
use crate::primitive_file::PrimitiveFile;

/// Share of the limit of the watch that a success may use, judged by the statistics of the others. Half, because twenty
/// or thirty runs do not hold the most unusual success.
const ROOM: f64 = 0.5;

/// Parts into which the runs are divided; each is judged by statistics of the others.
const PARTS: usize = 6;

/// An empty hand counts as told from a success by a finger if it goes this many times as far as the farthest success.
const TELLS: f64 = 1.5;

/// Control periods for which an empty hand stays closed: 0.3 s.
const CLOSED: usize = 90;

/// The samples of a run: progress and channels.
pub(super) type Run = Vec<(f64, [f64; STATISTICS_CHANNELS])>;

/// Statistics whose spreads leave successful runs room, and what they are worth.
#[derive(Debug, Clone)]
pub(super) struct Calibrated {
    /// The statistics.
    pub(super) statistics: SensorStatistics<f64>,
    /// Statistic of a hand that closes on nothing, as a share of the watch's limit: above 1 it is reported.
    pub(super) empty_hand: f64,
}

/// The statistics of `runs`, with the spread of each channel multiplied by one factor:
///
/// - the farthest success, judged by the statistics of the others, comes to half the limit ([`ROOM`]);
/// - where a finger that closes on nothing goes clearly farther than that, the limit lies halfway (geometrically)
///   between the two. How an empty hand closes is known without trying it: as planned.
///
/// Factors below 1 are only for fingers: what few runs agree in by chance is no reason for a narrow band.
pub(super) fn calibrated(
    primitive: &PrimitiveFile,
    runs: &[Run],
    floor: &[f64; STATISTICS_CHANNELS],
) -> Result<Calibrated, TableError> {
    let of = |runs: &[&[_]]| -> Result<SensorStatistics<f64>, TableError> {
        sensor_statistics(runs, STATISTICS_CAPACITY, floor, &ONE_SIDED_CHANNELS)
    };
    let all: Vec<_> = runs.iter().map(Vec::as_slice).collect();
    let gathered = of(&all)?;
    let mut farthest = [1.0; STATISTICS_CHANNELS];
    all.iter().for_each(|run| raise(&mut farthest, &reach(&gathered, run)));
    if runs.len() >= FEWEST_TRIALS {
        let parts = PARTS.min(runs.len());
        for part in 0..parts {
            let (held_out, others): (Vec<_>, Vec<_>) =
                all.iter().enumerate().partition(|(index, _)| index % parts == part);
            let others: Vec<_> = others.into_iter().map(|(_, run)| *run).collect();
            let known = of(&others)?;
            held_out.into_iter().for_each(|(_, run)| raise(&mut farthest, &reach(&known, run)));
        }
    }
    let empty = empty_hand(primitive, &gathered);
    let nothing = reach(&gathered, &empty);
    let factors: [f64; STATISTICS_CHANNELS] = std::array::from_fn(|channel| {
        let (success, nothing) = (farthest[channel], nothing[channel]);
        if channel >= FIRST_FINGER && nothing > TELLS * success {
            (success * nothing).sqrt() / LIMIT
        } else {
            (success / (ROOM * LIMIT)).max(1.0)
        }
    });
    let spread: Vec<_> = gathered
        .spread()
        .iter()
        .map(|point| std::array::from_fn(|channel| point[channel] * factors[channel]))
        .collect();
    let statistics = SensorStatistics::new(gathered.mean(), &spread, gathered.trials())?;
    let empty_hand = reach(&statistics, &empty).into_iter().fold(0.0, f64::max) / LIMIT;
    Ok(Calibrated { statistics, empty_hand })
}

/// The farthest that the watch finds a run away from the statistics, channel by channel (spreads).
fn reach(known: &SensorStatistics<f64>, run: &[(f64, [f64; STATISTICS_CHANNELS])]) -> [f64; STATISTICS_CHANNELS] {
    let mut watch = Watch::new();
    let mut farthest = [0.0; STATISTICS_CHANNELS];
    for (progress, values) in run {
        watch.step(known, *progress, values, true);
        raise(&mut farthest, &watch.sizes());
    }
    farthest
}

fn raise(largest: &mut [f64; STATISTICS_CHANNELS], values: &[f64; STATISTICS_CHANNELS]) {
    largest.iter_mut().zip(values).for_each(|(largest, value)| *largest = largest.max(*value));
}

/// A run whose fingers go as planned; everything else is as always. Empty for a primitive that cannot be played.
fn empty_hand(primitive: &PrimitiveFile, known: &SensorStatistics<f64>) -> Run {
    let played =
        primitive.to_primitive().ok().and_then(|primitive| plan::roll_out(&primitive).ok()).unwrap_or_default();
    let mut run: Run = played
        .iter()
        .map(|reference| {
            let mut values = known.mean_at(reference.progress);
            values[FIRST_FINGER..].copy_from_slice(&posture_and_hand(&reference.points.x).1[1..]);
            (reference.progress, values)
        })
        .collect();
    run.extend(run.last().copied().into_iter().flat_map(|closed| std::iter::repeat_n(closed, CLOSED)));
    run
}
