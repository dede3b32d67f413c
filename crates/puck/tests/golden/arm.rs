//! Joint, motor, count and torque conversions against the golden vectors, and what they must conserve.

use crate::vectors::rows;
use proptest::prelude::*;
use puck::{
    Counts, Drives, Group, NotFinite, PropertyId, PuckTorque, Ratios, Transmission, TransmissionError, packed_torques,
};

/// The example set of the vectors.
fn drives() -> Drives {
    Drives::new([4096; 7], [2700, 2700, 2700, 2700, 6500, 6500, 17474]).expect("positive")
}

fn transmission() -> Transmission<f64> {
    Transmission::new(&Ratios::WAM7).expect("positive")
}

#[test]
fn the_transformation_equals_the_vectors() {
    let (transmission, drives) = (transmission(), drives());
    for row in rows("wam7_transform") {
        let q: [f64; 7] = row.numbers("q", 1);
        let counts = drives.counts(&transmission.motor_from_joint(&q)).expect("finite");
        assert_eq!(counts.map(|count| count.0), row.numbers::<i32, 7>("p", 1), "{}", row.at());

        let back = transmission.joint_from_motor(&drives.motor_angles(&counts));
        let motor = transmission.motor_torques_from_joint(&row.numbers("t", 1));
        for (got, expected) in back.iter().zip(row.numbers::<f64, 7>("b", 1)) {
            assert!((got - expected).abs() <= 1e-12, "{}: {got} is not {expected}", row.at());
        }
        for (got, expected) in motor.iter().zip(row.numbers::<f64, 7>("m", 1)) {
            assert!((got - expected).abs() <= 1e-12, "{}: {got} is not {expected}", row.at());
        }
        for (got, expected) in transmission.joint_torques_from_motor(&motor).iter().zip(row.numbers::<f64, 7>("t", 1)) {
            assert!((got - expected).abs() <= 1e-12, "{}: {got} is not {expected}", row.at());
        }

        let [t1, t2, t3, t4, t5, t6, t7] = drives.torques(&motor).expect("finite");
        let lower = packed_torques(Group::ARM_TORQUES, PropertyId::TORQUE, [t1, t2, t3, t4]);
        let wrist = packed_torques(Group::WRIST_TORQUES, PropertyId::TORQUE, [t5, t6, t7, PuckTorque::ZERO]);
        assert_eq!(lower.payload(), row.payload("g1_hex"), "{}", row.at());
        assert_eq!(wrist.payload(), row.payload("g2_hex"), "{}", row.at());
    }
}

#[test]
fn single_precision_stays_within_a_few_counts_of_the_vectors() {
    let transmission = Transmission::<f32>::new(&Ratios::WAM7).expect("positive");
    for row in rows("wam7_transform") {
        let counts = row.numbers::<i32, 7>("p", 1).map(Counts);
        let back = transmission.joint_from_motor(&drives().motor_angles(&counts));
        for (got, expected) in back.iter().zip(row.numbers::<f64, 7>("b", 1)) {
            // One motor count is 3.7e-5 rad at J1 and more everywhere else: f32 must stay far below it.
            assert!((*got as f64 - expected).abs() <= 3e-6, "{}: {got} is not {expected}", row.at());
        }
    }
}

#[test]
fn unusable_ratios_and_drives_are_refused() {
    let mut ratios = Ratios::WAM7;
    ratios.coefficients[4] = f64::NAN;
    assert_eq!(Transmission::<f64>::new(&ratios), Err(TransmissionError::Ratio));
    let ratios = Ratios::from_gears([42.0, 28.25, 28.25, 18.0, 9.7, 9.7, 14.93], 0.0, 1.0);
    assert_eq!(Transmission::<f64>::new(&ratios), Err(TransmissionError::Ratio));
    let mut counts = [4096; 7];
    counts[2] = 0;
    assert_eq!(Drives::new(counts, [1; 7]), Err(TransmissionError::CountsPerRevolution { motor: 2 }));
    assert_eq!(
        Drives::new([4096; 7], [1, 1, 1, 1, 1, 1, -1]),
        Err(TransmissionError::UnitsPerNewtonMetre { motor: 6 })
    );
}

/// A ratio of f64 that the other number type does not hold, or whose inverse it does not.
#[test]
fn ratios_that_are_none_in_the_number_type_are_refused() {
    for (ratio, single, double) in
        [(1e-60, false, true), (1e39, false, true), (1e-310, false, false), (1e-30, true, true)]
    {
        let mut ratios = Ratios::WAM7;
        ratios.coefficients[3] = ratio;
        assert_eq!(Transmission::<f32>::new(&ratios).is_ok(), single, "{ratio:e}");
        assert_eq!(Transmission::<f64>::new(&ratios).is_ok(), double, "{ratio:e}");
    }
}

#[test]
fn single_precision_saturates_and_rounds_as_double_precision_does() {
    for (units, expected) in [(0.75, 0), (-0.25, -1), (8190.5, 8190), (8191.5, 8191), (-8190.5, -8191), (-9e3, -8191)] {
        assert_eq!(PuckTorque::from_units(units).map(PuckTorque::units), Ok(expected), "{units}");
        assert_eq!(PuckTorque::from_units(units as f32).map(PuckTorque::units), Ok(expected), "{units}");
    }
}

#[test]
fn torques_go_to_the_pucks_and_back_in_steps_of_one_unit() {
    let torques = [0.5, -0.25, 1.0, -1.5, 0.125, -0.75, 0.0625];
    let units = drives().torques(&torques).expect("finite");
    assert_eq!(units.map(PuckTorque::units), [1350, -675, 2700, -4050, 812, -4875, 1092]);
    let expected = [0.5, -0.25, 1.0, -1.5, 812.0 / 6500.0, -0.75, 1092.0 / 17474.0];
    assert_eq!(drives().motor_torques::<f64>(&units), expected);
    assert_eq!(drives().motor_torques::<f32>(&units), expected.map(|torque| torque as f32));
}

#[test]
fn not_a_number_never_becomes_counts_or_torque() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(drives().counts(&[0.0, 0.0, bad, 0.0, 0.0, 0.0, 0.0]), Err(NotFinite));
        assert_eq!(drives().torques(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, bad]), Err(NotFinite));
        assert_eq!(PuckTorque::from_units(bad), Err(NotFinite));
        assert_eq!(PuckTorque::from_units(bad as f32), Err(NotFinite));
    }
}

fn seven() -> impl Strategy<Value = [f64; 7]> {
    prop::array::uniform7(-3.0..3.0_f64)
}

proptest! {
    /// Mechanical power is the same at joints and motors: catches a torque mapped by the inverse instead of the
    /// transpose.
    #[test]
    fn power_is_conserved(velocity in seven(), torque in seven(), n5 in 9.0..11.0_f64, n6 in 0.8..1.2_f64) {
        let ratios = Ratios::from_gears([42.0, 28.25, 28.25, 18.0, n5, n5, 14.93], 1.68, n6);
        let transmission = Transmission::<f64>::new(&ratios).expect("positive");
        let dot = |a: [f64; 7], b: [f64; 7]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let motor = transmission.motor_torques_from_joint(&torque);
        let at_motors = dot(motor, transmission.motor_from_joint(&velocity));
        prop_assert!((at_motors - dot(torque, velocity)).abs() < 1e-10);
        for (back, torque) in transmission.joint_torques_from_motor(&motor).iter().zip(torque) {
            prop_assert!((back - torque).abs() < 1e-12);
        }
        for (back, velocity) in
            transmission.joint_from_motor(&transmission.motor_from_joint(&velocity)).iter().zip(velocity)
        {
            prop_assert!((back - velocity).abs() < 1e-12);
        }
    }

    /// A9: a motor that turns through the end of the 22 bits is followed exactly, in both directions.
    #[test]
    fn a9_unwrapping_follows_a_motor_through_the_counter_wrap(
        start in -(1 << 28)..(1 << 28_i32),
        steps in prop::collection::vec(-2_097_151..=2_097_151_i32, 1..50),
    ) {
        let mut truth = Counts(start);
        let mut followed = truth;
        for step in steps {
            truth = Counts((truth.0 + step).clamp(-(1 << 29), 1 << 29));
            followed = truth.wrapped().unwrapped_near(followed);
            prop_assert_eq!(followed, truth);
        }
    }
}

#[test]
fn a9_both_ends_of_the_counter_are_exact() {
    const HALF: i32 = 1 << 21;
    assert_eq!(Counts(HALF).wrapped(), Counts(-HALF));
    assert_eq!(Counts(-HALF - 1).wrapped(), Counts(HALF - 1));
    assert_eq!(Counts(-HALF).unwrapped_near(Counts(HALF - 1)), Counts(HALF));
    assert_eq!(Counts(HALF - 1).unwrapped_near(Counts(-HALF)), Counts(-HALF - 1));
}

/// The manual lists gears and differentials; the configuration of 2018 lists their products, rounded.
#[test]
fn the_gears_of_the_manual_are_the_coefficients_of_the_configuration() {
    let ratios = Ratios::from_gears([42.0, 28.25, 28.25, 18.0, 9.7, 9.7, 14.93], 1.68, 1.0);
    for (found, expected) in ratios.coefficients.iter().zip(Ratios::WAM7.coefficients) {
        assert!((found - expected).abs() < 5e-5, "{found} {expected}");
    }
    let ratios = Ratios::from_gears([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0], 0.5, 0.25);
    assert_eq!(ratios.coefficients, [1.0, 2.0, 6.0, 4.0, 5.0, 1.5, 7.0]);
}

#[test]
fn an_arm_without_a_transmission_is_told_which_motor_is_wrong() {
    for (error, words) in [
        (TransmissionError::Ratio, "gear ratio is not a positive number"),
        (TransmissionError::CountsPerRevolution { motor: 0 }, "motor 1 reports a CTS that is not positive"),
        (TransmissionError::UnitsPerNewtonMetre { motor: 6 }, "motor 7 reports an IPNM that is not positive"),
    ] {
        assert_eq!(error.to_string(), words);
    }
    assert_eq!(NotFinite.to_string(), "value is NaN or infinite");
}
