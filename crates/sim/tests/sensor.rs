//! Errors of the force/torque sensor: hysteresis, bias, drift, noise, silence.

use puck::{Node, PropertyId, Reply, force_torque};
use sim::{ForceTorqueConfig, FreeJoints, PlantConfig, TICKS_PER_MILLISECOND};

use crate::common::Master;

/// A started arm in a weightless world, so that the sensor feels pushes alone.
fn master(force_torque: ForceTorqueConfig) -> Master {
    let config = PlantConfig { started: true, force_torque, ..PlantConfig::default() };
    Master::with_world(config, FreeJoints::weightless([0.0; 7]))
}

fn noiseless() -> ForceTorqueConfig {
    ForceTorqueConfig { noise_scale: 0.0, ..ForceTorqueConfig::default() }
}

/// Force and torque, N and N m; `None` if the sensor is silent.
fn measured(master: &mut Master) -> Option<[f64; 6]> {
    match master.ask(force_torque::get_wrench())[..] {
        [] => None,
        [Reply::Force { counts: force, .. }, Reply::Torque { counts: torque, .. }] => {
            let [fx, fy, fz] = force.map(|counts| f64::from(counts) / 256.0);
            let [tx, ty, tz] = torque.map(|counts| f64::from(counts) / 4096.0);
            Some([fx, fy, fz, tx, ty, tz])
        }
        ref other => panic!("{other:?}"),
    }
}

fn tare(master: &mut Master) {
    master.ask(force_torque::tare());
    master.wait_ms(5);
}

/// Returns the measured force along z while the hand is pushed there with each of these forces in turn; the sensor's z
/// is the world's.
fn pushed_through(master: &mut Master, forces: impl Iterator<Item = f64>) -> Vec<(f64, f64)> {
    forces
        .map(|force| {
            master.plant.world().push([0.0, 0.0, force], [0.0; 3]);
            master.wait_ms(2);
            (force, measured(master).expect("the sensor answers")[2])
        })
        .collect()
}

#[test]
fn hysteresis_is_a_loop_of_the_width_that_was_asked_for() {
    let mut master = master(ForceTorqueConfig { force_hysteresis: 0.25, ..noiseless() });
    tare(&mut master);
    let up = pushed_through(&mut master, (0..=20).map(f64::from));
    let down = pushed_through(&mut master, (0..=40).map(|step| 20.0 - f64::from(step)));
    let again = pushed_through(&mut master, (0..=40).map(|step| -20.0 + f64::from(step)));
    // After half a newton of the way the output follows at the half-width behind the input, whichever way it goes.
    for (force, measured) in &up[2..] {
        assert!((measured - (force - 0.25)).abs() < 0.005, "up {force}: {measured}");
    }
    for (force, measured) in &down[2..] {
        assert!((measured - (force + 0.25)).abs() < 0.005, "down {force}: {measured}");
    }
    for (force, measured) in &again[2..] {
        assert!((measured - (force - 0.25)).abs() < 0.005, "again {force}: {measured}");
    }
    let turn = pushed_through(&mut master, [20.0, 19.8, 19.6].into_iter());
    assert!(turn.iter().all(|(_, measured)| (measured - 19.75).abs() < 0.005), "the output waits at a turn: {turn:?}");
}

#[test]
fn hysteresis_remembers_what_happens_between_two_samples() {
    let mut master = master(ForceTorqueConfig { force_hysteresis: 0.25, ..noiseless() });
    tare(&mut master);
    master.plant.world().push([0.0, 0.0, 10.0], [0.0; 3]);
    master.wait_ms(5);
    master.plant.world().push([0.0; 3], [0.0; 3]);
    master.wait_ms(5);
    let measured = measured(&mut master).expect("the sensor answers");
    assert!((measured[2] - 0.25).abs() < 0.005, "it came from above: {measured:?}");
}

#[test]
fn bias_is_what_the_tare_leaves() {
    let bias = [0.1, -0.2, 0.3, 0.01, 0.0, -0.02];
    let mut master = master(ForceTorqueConfig { bias, ..noiseless() });
    for _ in 0..2 {
        let measured = measured(&mut master).expect("the sensor answers");
        for (value, bias) in measured.iter().zip(bias) {
            assert!((value - bias).abs() < 1.0 / 256.0, "one count: {measured:?}");
        }
        tare(&mut master);
    }
}

#[test]
fn drift_grows_from_the_last_tare() {
    let mut master = master(ForceTorqueConfig { drift: [0.5, 0.0, 0.0, 0.0, 0.0, 0.0], ..noiseless() });
    tare(&mut master);
    master.wait_ms(2000);
    let before = measured(&mut master).expect("the sensor answers")[0];
    assert!((before - 1.0).abs() < 0.01, "{before}");
    tare(&mut master);
    assert!(measured(&mut master).expect("the sensor answers")[0] < 0.01);
}

#[test]
fn noise_scales_with_its_factor() {
    let sigma = |noise_scale: f64| {
        let mut master = master(ForceTorqueConfig { noise_scale, ..ForceTorqueConfig::default() });
        let samples: Vec<f64> = (0..400).map(|_| measured(&mut master).expect("the sensor answers")[0]).collect();
        let mean = samples.iter().sum::<f64>() / samples.len() as f64;
        (samples.iter().map(|sample| (sample - mean).powi(2)).sum::<f64>() / samples.len() as f64).sqrt()
    };
    assert!((sigma(1.0) - 0.05).abs() < 0.007, "{}", sigma(1.0));
    assert!((sigma(3.0) / sigma(1.0) - 3.0).abs() < 0.1, "the same draws, three times as large");
}

#[test]
fn a_sensor_that_falls_silent_answers_nothing_more() {
    let silent_from = Some(100 * TICKS_PER_MILLISECOND);
    let mut master = master(ForceTorqueConfig { silent_from, ..noiseless() });
    master.wait_ms(90);
    assert!(measured(&mut master).is_some());
    master.wait_ms(10);
    assert!(measured(&mut master).is_none());
    assert_eq!(master.value(Node::FORCE_TORQUE, PropertyId::STAT), None);
}

#[test]
fn an_error_that_creeps_in_after_the_tare_is_all_there_in_the_end_and_stays() {
    let mut master = master(noiseless());
    master.wait_ms(100);
    tare(&mut master);
    master.plant.creep_force_torque([0.2, 0.0, -0.1, 0.0, 0.05, 0.0], 200 * TICKS_PER_MILLISECOND);
    let at_first = measured(&mut master).expect("the sensor answers");
    assert!(at_first.iter().all(|value| value.abs() < 0.01), "{at_first:?}");
    master.wait_ms(100);
    let half = measured(&mut master).expect("the sensor answers");
    assert!((half[0] - 0.1).abs() < 0.02 && (half[4] - 0.025).abs() < 0.005, "{half:?}");
    for _ in 0..2 {
        master.wait_ms(200);
        let whole = measured(&mut master).expect("the sensor answers");
        assert!((whole[0] - 0.2).abs() < 0.005 && (whole[2] + 0.1).abs() < 0.005, "{whole:?}");
    }
}
