//! The bundle of a movement with its feedback, expectation and statistics: which sensor bends which row, and filling
//! all of it in place.

use control::plan::primitive::{
    COUPLED_ROWS, Configuration, Coupling, ExpectedWrench, Feedback, GainSchedule, Limits, MovementTables, POINT_ROWS,
    Primitive, ROWS, Rollout, RowGroup, SENSORS, STATISTICS_CHANNELS, SensorStatistics, StartState, Velocity, gains,
    limits, posture_and_hand,
};
use dmp::{Group, Hemisphere, OrientationError, RolloutError, TableError};

const K: [f64; 4] = [100.0, 160.0, 250.0, 400.0];
const PERIOD: f64 = 1.0 / 300.0;

fn some_limits() -> Limits<f64> {
    limits(0.3, 0.5, 0.7)
}

/// The tables of a movement; `goal` is its goal along x.
fn tables(weights: &[f64], goal: f64) -> MovementTables<'_, f64> {
    let mut end = Configuration::ORIGIN;
    end.poses[0].position[0] = goal;
    MovementTables {
        control_period: PERIOD,
        duration: 4.0,
        alpha: 4.605,
        activation: 0.7,
        kernel_count: weights.len() / ROWS,
        weights,
        gains: gains(K, [21.0, 17.0, 33.0, 47.0]),
        orientation_error: OrientationError::Quaternion,
        hemisphere: Hemisphere::Demonstrated,
        start: Configuration::ORIGIN,
        goal: end,
        start_velocity: Velocity::ZERO,
    }
}

/// K1 2 to 11 by row, K2 3, everything expected at 0.5, recorded at the duration.
fn rich() -> Primitive<f64, 30> {
    let mut primitive = Primitive::new(&tables(&[0.0; ROWS * 30], 0.5)).unwrap();
    let k1 = core::array::from_fn(|row| 2.0 + row as f64);
    let (k1, k2) = (GainSchedule::constant(k1).unwrap(), GainSchedule::constant([3.0; SENSORS]).unwrap());
    primitive.set_feedback(Some(&Feedback::new(k1, k2, some_limits()).unwrap()));
    primitive.set_expected(Some(&ExpectedWrench::new(&[[0.5; SENSORS]], 4.0).unwrap()));
    let point = [1.0; STATISTICS_CHANNELS];
    primitive.set_statistics(Some(&SensorStatistics::new(&[point], &[point], 5).unwrap()));
    primitive
}

fn started(primitive: &Primitive<f64, 30>) -> Rollout<f64, 30> {
    let mut rollout = Rollout::start(primitive.movement(), &StartState::demonstrated(primitive.movement())).unwrap();
    rollout.set_speed_slew(None).unwrap();
    rollout
}

/// Position 3, orientation 3, spread, F1, F2, F3; the posture apart.
fn coupled(zeta: &Coupling<f64>) -> ([f64; COUPLED_ROWS], [f64; 7]) {
    let ([pose], (posture, hand)) = (&zeta.poses, posture_and_hand(&zeta.points));
    let rows = pose.position.iter().chain(&pose.orientation).chain(&hand);
    (rows.copied().collect::<Vec<_>>().try_into().unwrap(), posture)
}

#[test]
fn each_sensor_bends_its_own_row_and_the_spread_and_the_posture_have_none() {
    let primitive = rich();
    let rollout = started(&primitive);
    let gains = [2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0].map(|k1| 3.0 * k1);
    for sensor in 0..SENSORS {
        let mut error = [0.0; SENSORS];
        error[sensor] = 0.5;
        let (rows, posture) = coupled(&primitive.coupling(&rollout, &error).unwrap());
        let row = if sensor < 6 { sensor } else { sensor + 1 };
        for (index, zeta) in rows.into_iter().enumerate() {
            assert_eq!(zeta, if index == row { 0.5 * gains[row] } else { 0.0 }, "sensor {sensor}, row {index}");
        }
        assert_eq!(posture, [0.0; 7]);
    }
    // A blow is cut to the limit of each group.
    let (rows, _) = coupled(&primitive.coupling(&rollout, &[1e4; SENSORS]).unwrap());
    let length = |rows: &[f64]| rows.iter().map(|x| x * x).sum::<f64>().sqrt();
    assert!((length(&rows[..3]) / (K[0] * 0.3) - 1.0).abs() < 1e-12);
    assert!((length(&rows[3..6]) / (K[1] * 0.25_f64.sin()) - 1.0).abs() < 1e-12);
    assert_eq!(rows[6..], [0.0, K[3] * 0.7, K[3] * 0.7, K[3] * 0.7]);
}

#[test]
fn the_coupling_fades_where_the_speed_is_not_that_of_the_recording() {
    let primitive = rich();
    let mut rollout = started(&primitive);
    for (speed, trust) in [(1.0, 1.0), (1.0 / 1.05, 1.0), (1.0 / 1.3, 0.5), (1.0 / 1.4, 0.25), (0.5, 0.0), (0.0, 0.0)] {
        rollout.set_speed(primitive.movement(), speed).unwrap();
        assert!((primitive.trust(&rollout) - trust).abs() < 1e-9, "speed {speed}");
        let (rows, _) = coupled(&primitive.coupling(&rollout, &[1.0; SENSORS]).unwrap());
        assert!((rows[0] - 6.0 * trust).abs() < 1e-9, "speed {speed}: {rows:?}");
    }
}

#[test]
fn without_gains_or_expectation_a_primitive_runs_open_loop() {
    let primitive = rich();
    let rollout = started(&primitive);
    for has_feedback in [true, false] {
        let mut poorer = primitive.clone();
        if has_feedback {
            poorer.set_expected(None);
        } else {
            poorer.set_feedback(None);
        }
        assert_eq!(poorer.coupling(&rollout, &[1.0; SENSORS]).unwrap(), Coupling::NONE);
        assert!(!poorer.trust(&rollout).is_nan());
    }
    let other = Primitive::new(&tables(&[0.1; ROWS * 30], 0.5)).unwrap();
    assert_eq!(other.coupling(&rollout, &[1.0; SENSORS]), Err(RolloutError::OtherPrimitive));
}

#[test]
fn a_primitive_filled_in_place_is_the_same_as_a_new_one_whatever_it_was_before() {
    let rich = rich();
    let mut streamed = Primitive::<f64, 30>::PLACEHOLDER;
    streamed.assign(&tables(&[0.0; ROWS * 30], 0.5)).unwrap();
    let k1 = (0..COUPLED_ROWS).map(|row| 2.0 + row as f64);
    streamed.assign_feedback(k1, [3.0; SENSORS], some_limits()).unwrap();
    streamed.assign_expected([0.5; SENSORS], 4.0).unwrap();
    streamed.assign_statistics([1.0; STATISTICS_CHANNELS], [1.0; STATISTICS_CHANNELS], 5).unwrap();
    assert_eq!(streamed, rich);
    let mut copy = Primitive::<f64, 30>::PLACEHOLDER;
    copy.clone_from(&streamed);
    assert_eq!(copy, rich);

    // A poorer movement afterwards: nothing of the rich one is left in it.
    let few = [0.3; ROWS * 10];
    let poor = Primitive::new(&tables(&few, 0.1)).unwrap();
    streamed.assign(&tables(&few, 0.1)).unwrap();
    copy.clone_from(&poor);
    assert_eq!((&streamed, &copy), (&poor, &poor));
    assert!(streamed.feedback().is_none() && streamed.expected().is_none() && streamed.statistics().is_none());
}

#[test]
fn a_refused_movement_changes_nothing_and_a_refused_table_is_gone() {
    let mut primitive = rich();
    let before = primitive.clone();
    let mut bad = [0.1; ROWS * 10];
    bad[ROWS * 10 - 1] = f64::NAN;
    assert!(primitive.assign(&tables(&bad, 0.1)).is_err());
    assert_eq!(primitive, before);
    assert_eq!(primitive.assign_expected([0.5; SENSORS * 2 - 1], 2.5), Err(TableError::Shape));
    assert!(primitive.expected().is_none(), "half an expectation must not be believed");
    assert_eq!(primitive.assign_expected([0.5; SENSORS * 129], 2.5), Err(TableError::TooMany));
    assert_eq!(primitive.assign_expected([0.5; SENSORS], 0.0), Err(TableError::Duration));
    assert_eq!(
        primitive.assign_feedback([-1.0; COUPLED_ROWS], [1.0; SENSORS], some_limits()),
        Err(TableError::Negative)
    );
    let wide = limits(0.3, 4.0, 0.7);
    let refused = primitive.assign_feedback([1.0; COUPLED_ROWS], [1.0; SENSORS], wide);
    assert!(matches!(refused, Err(TableError::TooLarge(_))), "{refused:?}");
    assert!(primitive.feedback().is_none());
    let (mean, narrow) = ([0.5; STATISTICS_CHANNELS], [0.0; STATISTICS_CHANNELS]);
    assert_eq!(primitive.assign_statistics(mean, narrow, 3), Err(TableError::Spread));
    assert!(primitive.statistics().is_none());
}

#[test]
fn every_row_of_a_movement_has_its_name() {
    let points = (0..POINT_ROWS as u8).map(|index| (Group::Points, index));
    let rows = (0..3).map(|i| (Group::Position, i)).chain((0..3).map(|i| (Group::Orientation, i))).chain(points);
    let mut names = Vec::new();
    for (group, index) in rows {
        let (part, place) = RowGroup::of(group, index);
        assert_eq!(part.row(place), (group, index));
        names.push(format!("{part}{place}"));
    }
    let wanted = "position0 position1 position2 orientation0 orientation1 orientation2 posture0 posture1 posture2 \
                  posture3 posture4 posture5 posture6 hand0 hand1 hand2 hand3";
    assert_eq!(names.join(" "), wanted);
}
