//! The load on the wrist: what sensor and joints of other arms than the model tell of it, and what is refused.

use control::Payload;
use control::model::{ArmModel, Frames, GRAVITY, HAND_CENTRE, HAND_MASS, WeightCorrection};
use control::units::JointPositions;
use lab::load::{Body, Contradiction, Finding, Load, LoadError, POSTURES, measure};
use lab::weigh::{Crossing, HALF_WAY, Sample, TOUR, is_held_out, weigh};
use nalgebra::Vector3;
use sim::{FreeJoints, Noise};

const PAYLOAD: Payload = Payload::SensorAndHand;

/// An arm with something in its hand; nothing of it is the model's.
struct Arm {
    links: [f64; 7],
    /// Factor on the mass of the hand; its centre stays.
    hand: f64,
    friction: [f64; 7],
    stiffness: [f64; 7],
    /// The body in the hand, its centre from the sensor's origin.
    held: Body,
    /// Wrench that the tare left in the sensor, N and N m, sensor axes: as large as a whole hand and more.
    tare: [f64; 6],
    /// Error of a sample of the sensor, N; thirty times less in N m.
    sensor_noise: f64,
    noise: Noise,
}

impl Arm {
    fn model(held: Body) -> Self {
        Self {
            links: [1.0; 7],
            hand: 1.0,
            friction: [0.0; 7],
            stiffness: [f64::INFINITY; 7],
            held,
            tare: [1.0, -9.0, 4.0, 0.3, -0.2, 0.1],
            sensor_noise: 0.0,
            noise: Noise::new(1, 79),
        }
    }

    /// Links within 10 %, the hand within 3 %, friction within 30 %, cables within 20 % of what is assumed; 0.3 to 1 kg
    /// are held somewhere in the hand.
    fn drawn(seed: u64) -> Self {
        let mut noise = Noise::new(seed, 79);
        let mut around = |middle: f64, share: f64| middle * noise.uniform(1.0 - share, 1.0 + share);
        let links = [1.0; 7].map(|factor| around(factor, 0.1));
        let hand = around(1.0, 0.03);
        let friction = [1.5, 2.0, 1.0, 0.8, 0.2, 0.2, 0.1].map(|friction| around(friction, 0.3));
        let stiffness = [4000.0, 4000.0, 2500.0, 2000.0, 350.0, 350.0, 120.0].map(|stiffness| around(stiffness, 0.2));
        let centre = [noise.uniform(-0.04, 0.04), noise.uniform(-0.04, 0.04), noise.uniform(0.1, 0.2)];
        let held = Body { mass: noise.uniform(0.3, 1.0), centre };
        let tare = [8.0, 8.0, 8.0, 0.5, 0.5, 0.5].map(|size| noise.uniform(-size, size));
        Self { links, hand, friction, stiffness, held, tare, sensor_noise: 0.05, noise }
    }

    /// All that hangs on the sensor.
    fn hanging(&self) -> Body {
        let hand = HAND_MASS * self.hand;
        let mass = hand + self.held.mass;
        let centre = |axis: usize| (hand * HAND_CENTRE[axis] + self.held.mass * self.held.centre[axis]) / mass;
        Body { mass, centre: std::array::from_fn(centre) }
    }

    fn frames(q: [f64; 7]) -> Frames<f64> {
        Frames::new(&ArmModel::new(PAYLOAD), &JointPositions::from_array(q))
    }

    /// Torques that hold links, hand and what is held, computed by the virtual work of a weight on a link of its own.
    fn holding(&self, q: [f64; 7], holds: bool) -> [f64; 7] {
        let mut world = FreeJoints::new(q).with_factors(self.links, self.hand, [1.0; 7]);
        if holds {
            let frames = Self::frames(q);
            let weight = Vector3::from(GRAVITY) * self.held.mass;
            let place = frames.sensor_to_world() * Vector3::from(self.held.centre) + frames.tool_to_sensor();
            sim::World::push(&mut world, weight.into(), place.cross(&weight).into());
        }
        world.holding_torques()
    }

    /// The wrench that the device tells: at the grasp point, without the model's hand, with what the tare left.
    fn wrench(&mut self, q: [f64; 7]) -> [f64; 6] {
        let frames = Self::frames(q);
        let gravity = frames.sensor_to_world().tr_mul(&Vector3::from(GRAVITY));
        let of = |body: Body| (gravity * body.mass, Vector3::from(body.centre).cross(&(gravity * body.mass)));
        let (hanging, model) = (of(self.hanging()), of(Body { mass: HAND_MASS, centre: HAND_CENTRE }));
        let size = self.sensor_noise;
        let mut error = |tare: f64, size: f64| tare + size * self.noise.uniform(-1.7, 1.7);
        let [fx, fy, fz, nx, ny, nz] = self.tare;
        let force = hanging.0 - model.0 + Vector3::new(error(fx, size), error(fy, size), error(fz, size));
        let size = size / 30.0;
        let torque = hanging.1 - model.1 + Vector3::new(error(nx, size), error(ny, size), error(nz, size));
        let (force, torque) = (frames.sensor_to_world() * force, frames.sensor_to_world() * torque);
        let torque = frames.tool_to_world().tr_mul(&(torque + frames.tool_to_sensor().cross(&force)));
        [force.x, force.y, force.z, torque.x, torque.y, torque.z]
    }

    fn cross(&mut self, posture: [f32; 7], holds: bool) -> Crossing {
        let mut pass = |direction: f64| -> Vec<Sample> {
            let at = |step: i32| direction * f64::from(step) / 5.0 * 0.5 * f64::from(HALF_WAY);
            (-5..=5).map(|step| self.sample(posture.map(|q| f64::from(q) + at(step)), direction, holds)).collect()
        };
        Crossing { up: pass(1.0), down: pass(-1.0) }
    }

    /// A sample with the motors at `motors`, sliding in this direction; the cables bend, and the device sees motors.
    fn sample(&mut self, motors: [f64; 7], direction: f64, holds: bool) -> Sample {
        let mut torque = self.holding(motors, holds);
        let mut q = motors;
        for _ in 0..5 {
            q = std::array::from_fn(|joint| motors[joint] - torque[joint] / self.stiffness[joint]);
            torque = self.holding(q, holds);
        }
        let torque = std::array::from_fn(|joint| torque[joint] + direction * self.friction[joint]);
        // The wrench is that of the true posture, turned by the device as it believes the arm to stand.
        let (truly, believed) = (self.wrench(q), Self::frames(motors));
        let frames = Self::frames(q);
        let [fx, fy, fz, nx, ny, nz] = truly;
        let in_sensor = |to_world: &nalgebra::Matrix3<f64>, part: Vector3<f64>| to_world.tr_mul(&part);
        let force = believed.sensor_to_world() * in_sensor(frames.sensor_to_world(), Vector3::new(fx, fy, fz));
        // Tool and sensor turn together: in tool axes nothing changes.
        Sample { q: motors, torque, wrench: [force.x, force.y, force.z, nx, ny, nz], ..Sample::default() }
    }

    fn passes(&mut self) -> Vec<Crossing> {
        POSTURES.iter().map(|posture| self.cross(*posture, true)).collect()
    }

    /// The weight of the empty arm, as `calibrate gravity` finds it.
    fn weighed(&mut self) -> WeightCorrection {
        let mut parts = [Vec::new(), Vec::new()];
        for (index, posture) in TOUR.into_iter().enumerate() {
            parts[usize::from(is_held_out(index))].push(self.cross(posture, false));
        }
        let none = WeightCorrection::none(PAYLOAD);
        weigh(&none, PAYLOAD, &parts[0], &parts[1]).unwrap().correction
    }

    fn measured(&mut self, weight: &WeightCorrection) -> Result<Load, LoadError> {
        measure(weight, &self.passes())
    }
}

const TORCH: Body = Body { mass: 0.4, centre: [0.01, -0.02, 0.15] };
const NOTHING: Body = Body { mass: 0.0, centre: [0.0; 3] };

fn none() -> WeightCorrection {
    WeightCorrection::none(PAYLOAD)
}

#[test]
fn what_the_hand_of_the_model_holds_is_told_by_sensor_and_joints_alike() {
    let load = Arm::model(TORCH).measured(&none()).unwrap();
    for extra in [load.sensor, load.joints] {
        let (mass, apart) = extra.held().unwrap().beside(&TORCH);
        assert!(mass.abs() < 1e-6 && apart < 1e-6, "{extra:?}");
    }
    assert!(load.sensor_left.iter().chain(&load.joints_left).all(|left| *left < 1e-6), "{load:?}");
}

#[test]
fn an_empty_hand_of_the_model_is_what_hangs_there() {
    let load = Arm::model(NOTHING).measured(&none()).unwrap();
    assert!(load.sensor.mass.abs() < 1e-6 && load.sensor.held().is_none(), "{load:?}");
    let (mass, apart) = load.joints.hanging().beside(&Body { mass: HAND_MASS, centre: HAND_CENTRE });
    assert!(mass.abs() < 1e-6 && apart < 1e-6, "{load:?}");
}

#[test]
fn ten_arms_tell_what_hangs_on_them_within_two_per_cent_and_four_millimetres() {
    for seed in 1..=10 {
        let mut arm = Arm::drawn(seed);
        let weight = arm.weighed();
        let load = arm.measured(&weight).unwrap();
        let truth = arm.hanging();
        let (mass, apart) = load.sensor.hanging().beside(&truth);
        let (mass, apart) = (100.0 * mass / truth.mass, apart * 1e3);
        // The joints know what was taken up since the arm was weighed, with its own hand.
        let (joints, joints_apart) = load.since_weighed.unwrap().held().unwrap().beside(&arm.held);
        let joints = 100.0 * joints / arm.held.mass;
        println!(
            "arm {seed}: {:.3} kg, sensor {mass:+.2} % {apart:.2} mm; held {:.3} kg, joints {joints:+.2} % {:.1} mm",
            truth.mass,
            arm.held.mass,
            joints_apart * 1e3
        );
        assert!(mass.abs() <= 2.0 && apart <= 4.0, "arm {seed}: {mass} %, {apart} mm");
        assert!(joints.abs() <= 10.0, "arm {seed}: {joints} %");
        load.judge().unwrap();
    }
}

#[test]
fn what_does_not_tell_a_load_is_refused() {
    let mut arm = Arm::model(TORCH);
    let passes = arm.passes();
    assert_eq!(measure(&none(), &passes[..4]), Err(LoadError::TooFew { postures: 4 }));
    assert_eq!(measure(&WeightCorrection::none(Payload::None), &passes), Err(LoadError::NoSensor));
    let mut wrong = passes.clone();
    wrong[3].down[1].wrench[2] = f64::NAN;
    assert_eq!(measure(&none(), &wrong), Err(LoadError::NotANumber));
    // The same posture over and over: the weight cannot be told from the tare.
    assert_eq!(measure(&none(), &vec![passes[0].clone(); 8]), Err(LoadError::Undetermined));
}

#[test]
fn ten_arms_that_were_never_weighed_tell_what_they_took_up_and_how_little_their_joints_know_of_the_rest() {
    for seed in 1..=10 {
        let mut arm = Arm::drawn(seed);
        let full = arm.measured(&none()).unwrap();
        full.judge().unwrap();
        let (mass, apart) = full.joints.hanging().beside(&arm.hanging());
        assert!(mass.abs() < 3.0 * full.joints.mass_error, "arm {seed}: {mass} kg, {apart} m");
        let (held, hanging) = (arm.held, arm.hanging());
        arm.held = NOTHING;
        let empty = arm.measured(&none()).unwrap();
        for (name, full, empty, bar) in
            [("sensor", full.sensor, empty.sensor, (2.0, 4.0)), ("joints", full.joints, empty.joints, (5.0, 10.0))]
        {
            let told = full.beyond(&empty);
            let (mass, apart) = told.held().unwrap().beside(&held);
            let (mass, apart) = (100.0 * mass / held.mass, 1e3 * apart);
            println!("arm {seed}: {:.3} of {:.3} kg, {name} {mass:+.2} % {apart:.2} mm", held.mass, hanging.mass);
            assert!(mass.abs() <= bar.0 && apart <= bar.1, "arm {seed}, {name}: {mass} %, {apart} mm");
        }
        full.sensor.beyond(&empty.sensor).agree(&full.joints.beyond(&empty.joints)).unwrap();
    }
}

#[test]
fn what_contradicts_itself_is_named() {
    let mut arm = Arm::drawn(3);
    let (weight, passes) = (arm.weighed(), arm.passes());
    let judged = |spoil: &dyn Fn(&mut Sample)| {
        let mut passes = passes.clone();
        let all = passes.iter_mut().flat_map(|crossing| crossing.up.iter_mut().chain(&mut crossing.down));
        all.for_each(spoil);
        measure(&weight, &passes).unwrap().judge()
    };
    assert_eq!(judged(&|_| ()), Ok(()));
    // The device has taken the hand off already: this is the gain of what is held.
    let gain = judged(&|sample| sample.wrench[..3].iter_mut().for_each(|force| *force *= 3.0));
    assert!(matches!(gain, Err(Contradiction::Mass { .. })), "{gain:?}");
    let turned = judged(&|sample| sample.wrench.swap(3, 4));
    assert!(matches!(turned, Err(Contradiction::Sensor { .. })), "{turned:?}");
    let pulled = judged(&|sample| sample.torque[1] += 3.0 * sample.q[0]);
    assert!(matches!(pulled, Err(Contradiction::Joints { joint: 1, .. })), "{pulled:?}");
    let mut off = measure(&weight, &passes).unwrap();
    off.sensor.moment[2] += 0.05;
    let off = off.judge();
    assert!(matches!(off, Err(Contradiction::Moment { axis: 'z', .. })), "{off:?}");
    let nothing = judged(&|sample| sample.torque[6] += f64::MAX);
    assert!(nothing.is_err(), "what is not a number agrees with nothing: {nothing:?}");
}

#[test]
fn what_hangs_there_is_named_beside_the_hand_of_the_model() {
    let found = |hand: f64, held: Body| Arm { hand, ..Arm::model(held) }.measured(&none()).unwrap().finding();
    assert_eq!(found(1.02, NOTHING), Finding::Hand);
    assert!(matches!(found(1.0, TORCH), Finding::More(body) if (body.mass - 0.4).abs() < 1e-6));
    assert!(matches!(found(0.9, NOTHING), Finding::Less(mass) if (mass - 0.1 * HAND_MASS).abs() < 1e-6));
    let aside = Body { mass: 0.05, centre: [0.4, 0.0, 0.1] };
    assert!(matches!(found(1.0, aside), Finding::Elsewhere(distance) if distance > 0.015));
}

#[test]
fn what_was_mounted_when_the_arm_was_weighed_is_no_contradiction() {
    let mut arm = Arm::model(TORCH);
    let mut parts = [Vec::new(), Vec::new()];
    for (index, posture) in TOUR.into_iter().enumerate() {
        parts[usize::from(is_held_out(index))].push(arm.cross(posture, true));
    }
    let weight = weigh(&none(), PAYLOAD, &parts[0], &parts[1]).unwrap().correction;
    let load = arm.measured(&weight).unwrap();
    let since = load.since_weighed.unwrap();
    assert!(load.sensor.mass > 0.39 && since.mass.abs() < 0.03, "{load:?}");
    assert!(
        (load.joints.mass - 0.4).abs() < 0.03,
        "what the links may weigh is beside the model's, not beside that: {load:?}"
    );
    load.judge().unwrap();
    assert!(load.is_carried());
}
