//! Friction from passes both ways: what the torques of arms of other friction, weight and cables tell, what is refused.

use control::Payload;
use control::model::WeightCorrection;
use lab::friction::{FrictionError, JointFriction, POSTURES, measure};
use lab::weigh::{Crossing, HALF_WAY, Sample};
use sim::{FreeJoints, Noise};

const COULOMB: [f64; 7] = [1.5, 2.0, 1.0, 0.8, 0.2, 0.2, 0.1];
const VISCOUS: [f64; 7] = [1.27, 1.15, 0.41, 0.23, 0.016, 0.016, 0.0027];
const SPEEDS: [f64; 3] = [0.15, 0.25, 0.4];

/// An arm that is not the model: weight, friction, and cables that bend under the torque they carry.
struct Arm {
    links: [f64; 7],
    coulomb: [f64; 7],
    viscous: [f64; 7],
    stiffness: [f64; 7],
}

impl Arm {
    const MODEL: Self = Self { links: [1.0; 7], coulomb: COULOMB, viscous: VISCOUS, stiffness: [f64::INFINITY; 7] };

    fn drawn(seed: u64) -> Self {
        let mut noise = Noise::new(seed, 78);
        let mut around = |middle: f64, share: f64| middle * noise.uniform(1.0 - share, 1.0 + share);
        Self {
            links: [1.0; 7].map(|factor| around(factor, 0.1)),
            coulomb: COULOMB.map(|friction| around(friction, 0.3)),
            viscous: VISCOUS.map(|friction| around(friction, 0.3)),
            stiffness: [4000.0, 4000.0, 2500.0, 2000.0, 350.0, 350.0, 120.0].map(|stiffness| around(stiffness, 0.2)),
        }
    }

    /// Gravity at a posture where the links are bent away from the motors by what the cables carry.
    fn gravity(&self, q: [f64; 7]) -> [f64; 7] {
        let at = |q| FreeJoints::new(q).with_factors(self.links, 1.0, [1.0; 7]).holding_torques();
        let mut torque = at(q);
        for _ in 0..5 {
            torque = at(std::array::from_fn(|joint| q[joint] - torque[joint] / self.stiffness[joint]));
        }
        torque
    }

    fn pass(&self, posture: [f32; 7], speed: f64, direction: f64) -> Vec<Sample> {
        let at = |step: i32| {
            // The window of a pass lags behind its posture: up and down do not see the same angles.
            let shift = direction * (f64::from(step) / 5.0 * 0.5 * f64::from(HALF_WAY) - 0.02 * speed);
            let q = posture.map(|q| f64::from(q) + shift);
            let gravity = self.gravity(q);
            let friction = |joint: usize| self.coulomb[joint] + self.viscous[joint] * speed;
            let torque = std::array::from_fn(|joint| gravity[joint] + direction * friction(joint));
            Sample { time: 0.1 * f64::from(step), q, torque, speed: [direction * speed; 7], ..Sample::default() }
        };
        (-5..=5).map(at).collect()
    }

    fn passes(&self) -> Vec<Crossing> {
        let speeds = POSTURES.iter().flat_map(|posture| SPEEDS.map(|speed| (*posture, speed)));
        let both =
            |(posture, speed)| Crossing { up: self.pass(posture, speed, 1.0), down: self.pass(posture, speed, -1.0) };
        speeds.map(both).collect()
    }

    fn measured(&self) -> Result<[JointFriction; 7], FrictionError> {
        measure(&WeightCorrection::none(Payload::SensorAndHand), &self.passes())
    }
}

#[test]
fn the_friction_of_the_model_is_found_to_a_hundredth() {
    // Not to the digit: these arms have no torques that grow with the square of the speed, and the lag of the passes
    // lets a part of the model's through.
    for (joint, found) in Arm::MODEL.measured().unwrap().iter().enumerate() {
        let coulomb = COULOMB[joint];
        assert!((found.coulomb.value - coulomb).abs() < 0.01 * coulomb, "J{}: {found:?}", joint + 1);
        let wrong = (found.viscous.value - VISCOUS[joint]).abs() * SPEEDS[2];
        let [slowest, fastest] = found.speeds;
        assert!(wrong < 0.02 * coulomb && found.left < 0.01 * coulomb, "J{}: {found:?}", joint + 1);
        assert!((slowest - 0.15).abs() + (fastest - 0.4).abs() < 1e-6, "J{}: {found:?}", joint + 1);
    }
}

#[test]
fn what_accelerates_the_arm_is_no_friction() {
    // Every pass grows faster: the motors give J1 a torque for it, which points as friction does.
    let arm = Arm::MODEL;
    let mut passes = arm.passes();
    let at_rest = measure(&WeightCorrection::none(Payload::SensorAndHand), &passes).unwrap();
    let model = control::model::ArmModel::<f64>::new(Payload::SensorAndHand);
    for (pass, direction) in passes.iter_mut().flat_map(|passes| [(&mut passes.up, 1.0), (&mut passes.down, -1.0)]) {
        let acceleration = 0.1 * direction;
        for sample in pass {
            let mut wanted = control::units::JointAccelerations::zero();
            wanted.0[0] = acceleration;
            let frames = control::model::Frames::new(&model, &control::units::JointPositions::from_array(sample.q));
            let still = control::units::JointVelocities::zero();
            let needed = model.inverse_dynamics(&frames, &still, &wanted).0 - model.gravity_torque(&frames).0;
            let needed = needed + model.rotor_torque(&wanted).0;
            (0..7).for_each(|joint| sample.torque[joint] += needed[joint]);
            sample.speed[0] += acceleration * sample.time;
        }
    }
    let found = measure(&WeightCorrection::none(Payload::SensorAndHand), &passes).unwrap();
    for (joint, (found, at_rest)) in found.iter().zip(at_rest).enumerate() {
        let wrong = found.coulomb.value - at_rest.coulomb.value;
        assert!(wrong.abs() < 0.03 * COULOMB[joint], "J{}: {found:?}, {at_rest:?}", joint + 1);
    }
}

#[test]
fn ten_arms_tell_their_friction_to_a_twentieth() {
    for seed in 1..=10 {
        let arm = Arm::drawn(seed);
        let found = arm.measured().unwrap();
        println!("arm {seed}: {found:.4?}");
        for (joint, found) in found.iter().enumerate() {
            let (coulomb, viscous) = (arm.coulomb[joint], arm.viscous[joint]);
            assert!((found.coulomb.value - coulomb).abs() < 0.05 * coulomb, "arm {seed}, J{}: {found:?}", joint + 1);
            // As a torque at the fastest pass: the viscous friction of the wrist is a hundredth of the dry one.
            let wrong = (found.viscous.value - viscous).abs() * SPEEDS[2];
            assert!(wrong < 0.05 * coulomb, "arm {seed}, J{}: {found:?}", joint + 1);
        }
    }
}

#[test]
fn what_tells_no_friction_is_refused() {
    let weight = WeightCorrection::none(Payload::SensorAndHand);
    let passes = Arm::MODEL.passes();
    assert_eq!(measure(&weight, &passes[..3]), Err(FrictionError::TooFew { passes: 3 }));
    let slow: Vec<Crossing> = passes.iter().step_by(SPEEDS.len()).cloned().collect();
    assert_eq!(measure(&weight, &slow), Err(FrictionError::OneSpeed { joint: 0 }));
    let mut wrong = passes.clone();
    wrong[1].up[2].torque[4] = f64::NAN;
    assert_eq!(measure(&weight, &wrong), Err(FrictionError::NotANumber));
    // A pass of which nothing was seen does not count.
    let mut silent = passes;
    silent.iter_mut().skip(3).for_each(|crossing| crossing.down.clear());
    assert_eq!(measure(&weight, &silent), Err(FrictionError::TooFew { passes: 3 }));
}

/// A person helps the arm along, or a drive has its sign wrong: the joint seemed to drive itself, and that was told as
/// its friction.
///
/// The change that makes it fail: friction below zero is told.
#[test]
fn friction_below_zero_is_none_and_names_the_joint() {
    for joint in [0, 3, 6] {
        let mut helped = Arm::MODEL.passes();
        let sent = helped.iter_mut().flat_map(|crossing| crossing.up.iter_mut().chain(&mut crossing.down));
        sent.for_each(|sample| {
            sample.torque[joint] -= sample.speed[joint].signum() * (COULOMB[joint] + VISCOUS[joint] + 0.1);
        });
        let told = measure(&WeightCorrection::none(Payload::SensorAndHand), &helped);
        assert!(matches!(told, Err(FrictionError::Negative { joint: named, .. }) if named == joint), "{told:?}");
    }
    // Next to none is not below it.
    let smooth = Arm { coulomb: [0.0; 7], viscous: [0.0; 7], ..Arm::MODEL };
    smooth.measured().unwrap();
    let mut words = String::new();
    if let Err(error) = (Arm { coulomb: [-0.5; 7], viscous: [0.0; 7], ..Arm::MODEL }).measured() {
        words = error.to_string();
    }
    assert!(words.starts_with("J1 seems to have friction of -0."), "{words}");
}
