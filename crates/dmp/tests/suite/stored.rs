//! Feature `serde`: plain types read back as they were, and what a file holds is checked where it is used.

use dmp::{
    Configuration, Coupling, DisplacementLimits, Gain, GainError, Gains, Group, Hemisphere, OrientationError, Pose,
    PoseCoupling, PoseGains, PoseLimits, Primitive, PrimitiveError, PrimitiveTables, Quaternion, Rollout, RolloutError,
    Scalar, StartState, TableError, Twist, Velocity,
};
use serde::{Serialize, de::DeserializeOwned};

fn read<T: DeserializeOwned>(text: &str) -> T {
    serde_json::from_str(text).unwrap_or_else(|error| panic!("{text}: {error}"))
}

fn round_trip<T: Serialize + DeserializeOwned + PartialEq + core::fmt::Debug>(value: T) {
    let text = serde_json::to_string(&value).unwrap();
    assert_eq!(read::<T>(&text), value, "{text}");
}

fn check_round_trips<T: Scalar + Serialize + DeserializeOwned>() {
    let [a, b, c, d] = [0.1, -0.75, 1e-5, 7e5].map(T::from_f64);
    let orientation = Quaternion::new(a, b, c, d);
    let gain = Gain { stiffness: a, damping: d };
    round_trip(orientation);
    round_trip(Pose { position: [a, b, c], orientation });
    round_trip(Twist { linear: [a, b, c], angular: [d, c, b] });
    round_trip(gain);
    round_trip(PoseGains { position: gain, orientation: Gain { stiffness: b, damping: c } });
    round_trip(PoseLimits { displacement: a, rotation: b });
}

#[test]
fn every_plain_type_reads_back_as_it_was() {
    check_round_trips::<f64>();
    check_round_trips::<f32>();
    for error in [OrientationError::Quaternion, OrientationError::RotationVector] {
        round_trip(error);
    }
    for hemisphere in [Hemisphere::Demonstrated, Hemisphere::Nearest] {
        round_trip(hemisphere);
    }
    assert_eq!(read::<OrientationError>("\"rotation-vector\""), OrientationError::RotationVector);
    assert!(serde_json::from_str::<OrientationError>("\"euler\"").is_err());
    assert!(serde_json::from_str::<Quaternion<f64>>(r#"{"w":1,"x":0,"y":0}"#).is_err());
    assert!(serde_json::from_str::<Gain<f64>>(r#"{"stiffness":null,"damping":1}"#).is_err());
}

/// Tables with one pose whose goal, gain of the position and start can be damaged.
fn build(goal: Quaternion<f64>, position: Gain<f64>) -> Result<Primitive<f64, 0, 1, 2>, PrimitiveError> {
    let orientation = Gain { stiffness: 200.0, damping: 20.0 };
    Primitive::new(&PrimitiveTables {
        control_period: 0.002,
        duration: 1.0,
        alpha: 4.6,
        activation: 0.7,
        kernel_count: 2,
        weights: &[0.0; 12],
        gains: Gains { poses: [PoseGains { position, orientation }], points: [] },
        orientation_error: OrientationError::Quaternion,
        hemisphere: Hemisphere::Nearest,
        start: Configuration::ORIGIN,
        goal: Configuration { poses: [Pose { position: [0.0; 3], orientation: goal }], points: [] },
        start_velocity: Velocity::ZERO,
    })
}

#[test]
fn what_a_damaged_file_holds_is_refused_where_it_is_used() {
    let sound = read(r#"{"stiffness":200,"damping":28}"#);
    let twisted: Quaternion<f64> = read(r#"{"w":0.5,"x":9,"y":0,"z":0}"#);
    assert_eq!(build(twisted, sound).unwrap_err(), PrimitiveError::GoalNotUnit);
    let error = GainError::Stiffness;
    let gains = PrimitiveError::Gains { group: Group::Position, index: 0, error };
    assert_eq!(build(Quaternion::IDENTITY, read(r#"{"stiffness":-1,"damping":1}"#)).unwrap_err(), gains);

    let primitive = build(Quaternion::IDENTITY, sound).unwrap();
    let mut start = StartState::demonstrated(&primitive);
    start.configuration.poses = [Pose { orientation: twisted, ..Pose::IDENTITY }];
    assert_eq!(Rollout::start(&primitive, &start).unwrap_err(), RolloutError::NotUnit);
    start = StartState::demonstrated(&primitive);
    start.velocity.poses = [read(r#"{"linear":[1e9,0,0],"angular":[0,0,0]}"#)];
    assert_eq!(Rollout::start(&primitive, &start).unwrap_err(), RolloutError::TooLarge);

    let limits = DisplacementLimits { poses: [read(r#"{"displacement":-1,"rotation":1}"#)], points: [] };
    assert_eq!(limits.check(), Err(TableError::Negative));
    let zeta = Coupling { poses: [PoseCoupling { position: [5.0; 3], ..PoseCoupling::NONE }], points: [] };
    assert_eq!(primitive.limited_coupling(&zeta, &limits), Coupling::NONE);
}
