//! From recordings to mean and spread, weights of sensors, and statistics of successful runs.

use dmp::TableError;
use dmp::fit::{WEIGHT_RANGE, phase_statistics, sensor_statistics, weights_from_spread};

/// Sensors, and channels of statistics, of the tests.
const SENSORS: usize = 9;
const CHANNELS: usize = 12;
type Statistics = dmp::SensorStatistics<f64, CHANNELS, 64>;
/// The last three channels are angles of fingers.
const ONE_SIDED: [bool; CHANNELS] = [false, false, false, false, false, false, false, false, false, true, true, true];

fn statistics(
    trials: &[&[(f64, [f64; CHANNELS])]],
    count: usize,
    floor: &[f64; CHANNELS],
) -> Result<Statistics, TableError> {
    sensor_statistics(trials, count, floor, &ONE_SIDED)
}

type Trial<const CHANNELS: usize> = Vec<(f64, [f64; CHANNELS])>;

/// A run of 3600 samples whose channels are `mean(u)` plus `offset` plus alternating noise of size `noise`.
fn trial<const C: usize>(offset: f64, noise: f64, mean: impl Fn(f64) -> f64) -> Trial<C> {
    (0..3600)
        .map(|k| {
            let u = f64::from(k) / 3599.0;
            let shake = if k % 2 == 0 { noise } else { -noise };
            (u, [mean(u) + offset + shake; C])
        })
        .collect()
}

fn slices<const CHANNELS: usize>(trials: &[Trial<CHANNELS>]) -> Vec<&[(f64, [f64; CHANNELS])]> {
    trials.iter().map(Vec::as_slice).collect()
}

#[test]
fn mean_and_spread_are_those_of_the_runs_and_a_slope_is_no_spread() {
    // A steep slope, 10 N over the movement, three runs 0.3 N apart, noise of 0.1 N.
    let trials: Vec<Trial<1>> = [-0.3, 0.0, 0.3].map(|offset| trial(offset, 0.1, |u| 10.0 * u)).to_vec();
    let statistics = phase_statistics(&slices(&trials), 128).unwrap();
    assert_eq!(statistics.trials, 3);
    // Between the runs 2/3 0.09 plus noise 0.01, with the correction 3/2 for the estimated mean.
    let sigma = (1.5_f64 * (0.06 + 0.01)).sqrt();
    for (i, (mean, spread)) in statistics.mean.iter().zip(&statistics.spread).enumerate().skip(1).take(126) {
        assert!((mean[0] - 10.0 * i as f64 / 127.0).abs() < 0.01, "{i}: {mean:?}");
        assert!((spread[0] / sigma - 1.0).abs() < 0.05, "{i}: {spread:?} {sigma}");
    }
    // One run alone tells its noise, nothing about the next run.
    let alone = phase_statistics(&slices(&trials[..1]), 128).unwrap();
    assert!((alone.spread[64][0] - 0.1).abs() < 0.01, "{:?}", alone.spread[64]);
}

#[test]
fn a_run_that_was_sampled_more_densely_has_no_more_weight() {
    let dense: Trial<1> = trial(1.0, 0.0, |_| 0.0);
    let sparse: Trial<1> = trial::<1>(0.0, 0.0, |_| 0.0).into_iter().step_by(10).collect();
    let statistics = phase_statistics(&[&dense, &sparse], 16).unwrap();
    for mean in &statistics.mean {
        assert!((mean[0] - 0.5).abs() < 0.02, "{mean:?}");
    }
}

#[test]
fn samples_behind_the_end_and_gaps_do_not_spoil_the_statistics() {
    let mut run: Trial<1> = trial(0.0, 0.0, |u| u);
    run.retain(|(u, _)| !(0.3..0.5).contains(u));
    run.push((1.7, [1e6]));
    let statistics = phase_statistics(&[&run], 101).unwrap();
    for (i, mean) in statistics.mean.iter().enumerate() {
        assert!((mean[0] - i as f64 / 100.0).abs() < 0.01, "{i} {mean:?}");
    }
    assert_eq!(phase_statistics::<1>(&[], 16).unwrap_err(), TableError::Empty);
    assert_eq!(phase_statistics(&[&run], 0).unwrap_err(), TableError::Empty);
    assert_eq!(phase_statistics(&[&[(0.5, [f64::NAN])]], 16).unwrap_err(), TableError::NotFinite);
}

#[test]
fn a_sensor_counts_more_where_it_repeats_itself_and_its_mean_weight_is_one() {
    // Sensor 0 scatters ten times more in the second half, sensor 1 always the same, sensor 2 never moves.
    let spread: Vec<[f64; SENSORS]> = (0..128)
        .map(|i| {
            let mut point = [0.2; SENSORS];
            point[0] = if i < 64 { 0.1 } else { 1.0 };
            point[2] = 0.0;
            point
        })
        .collect();
    let weights = weights_from_spread(&spread, 3, 16, 0.5, &[0.0; SENSORS]).unwrap();
    assert_eq!(weights.len(), 16);
    let mean = |sensor: usize| weights.iter().map(|point| point[sensor]).sum::<f64>() / 16.0;
    assert!((mean(0) - 1.0).abs() < 0.02, "{}", mean(0));
    // sigma_min = 0.5 rms, rms^2 = 0.505: the weights would be 8.27 to 1, and the smaller one is lifted to 1/4.
    assert!((weights[2][0] - 1.88).abs() < 0.02 && weights[13][0] == 0.25, "{weights:?}");
    for point in &weights {
        assert!((point[1] - 1.0).abs() < 1e-9 && point[2] == 1.0, "{point:?}");
        assert!(point.iter().all(|weight| (1.0 / WEIGHT_RANGE..=WEIGHT_RANGE).contains(weight)));
    }
    // Scatter below the resolution of a sensor is no scatter.
    let even = weights_from_spread(&spread, 3, 16, 0.5, &[10.0; SENSORS]).unwrap();
    assert!(even.iter().flatten().all(|weight| (weight - 1.0).abs() < 0.01), "{even:?}");
    assert_eq!(weights_from_spread(&spread, 2, 16, 0.5, &[0.0; SENSORS]).unwrap_err(), TableError::Trials);
    assert_eq!(weights_from_spread(&spread, 3, 16, 0.0, &[0.0; SENSORS]).unwrap_err(), TableError::Negative);
    assert_eq!(weights_from_spread(&[], 3, 16, 0.5, &[0.0; SENSORS]).unwrap_err(), TableError::Empty);
}

#[test]
fn statistics_tell_how_many_spreads_a_run_is_away_and_never_divides_by_nothing() {
    let trials: Vec<Trial<CHANNELS>> = [-0.5, 0.0, 0.5].map(|offset| trial(offset, 0.0, |u| 4.0 * u)).to_vec();
    let floor = [0.05; CHANNELS];
    let known = statistics(&slices(&trials), 64, &floor).unwrap();
    assert_eq!((known.trials(), known.mean().len()), (3, 64));
    // The runs lie between -0.5 and 0.5 about the middle: two spreads to the outermost, and the slope between three
    // neighbours on top.
    let (middle, slope) = (known.mean_at(0.5), 4.0 / 63.0);
    assert!((middle[0] - 2.0).abs() < 0.02 && (middle[11] - 2.0).abs() < 0.02, "{middle:?}");
    assert!((known.spread_at(0.5)[0] - (0.5 + slope) / 2.0).abs() < 0.01, "{:?}", known.spread_at(0.5));
    let away = known.z_score(0.5, &[3.0; CHANNELS]);
    assert!((away[11] - 4.0).abs() < 0.05, "{away:?}");
    let below = known.z_score(0.5, &[1.0; CHANNELS]);
    assert!((below[0] + 2.0 / (0.5 + slope)).abs() < 0.1, "{below:?}");
    // Of fingers only closing too far widens the band; of everything else both sides.
    let lagging: Vec<Trial<CHANNELS>> = [-0.9, 0.0, 0.0, 0.0].map(|offset| trial(offset, 0.0, |_| 1.0)).to_vec();
    let uneven = statistics(&slices(&lagging), 8, &floor).unwrap();
    assert!((uneven.spread_at(0.5)[0] - 0.225).abs() < 1e-3 && (uneven.spread_at(0.5)[9] - 0.1125).abs() < 1e-3);
    // Runs that agree to the last digit leave the floor.
    let same: Vec<Trial<CHANNELS>> = vec![trials[0].clone(); 3];
    assert_eq!(statistics(&slices(&same), 64, &floor).unwrap().spread_at(0.3)[4], 0.05);
    assert_eq!(statistics(&slices(&same), 64, &[0.0; 12]).unwrap_err(), TableError::Spread);
    assert_eq!(statistics(&slices(&same), 65, &floor).unwrap_err(), TableError::TooMany);
    assert_eq!(statistics(&[], 64, &floor).unwrap_err(), TableError::Trials);
    let (row, zero) = ([[1.0; CHANNELS]; 2], [[0.0; CHANNELS]; 2]);
    assert_eq!(Statistics::new(&row, &zero, 3).unwrap_err(), TableError::Spread);
    assert_eq!(Statistics::new(&row, &row[..1], 3).unwrap_err(), TableError::Shape);
    assert_eq!(Statistics::new(&row, &row, 0).unwrap_err(), TableError::Trials);
    assert_eq!(Statistics::new(&row, &[[f64::NAN; 12]; 2], 3).unwrap_err(), TableError::NotFinite);
}
