//! The MuJoCo world obeys the arm's data and the conventions: frames, signs, units, friction, stops, determinism.
#![cfg(feature = "mujoco")]

use sim::teacher::{DEMONSTRATION_GOAL, DEMONSTRATION_START};
use sim::world::mujoco::{
    Cables, Imperfections, Kinematics, MujocoOptions, MujocoWorld, ObjectKind, ObjectSpec, Scene, WorldError,
};
use sim::{HOME, Noise, Pose, STEP_SECONDS, World};
use std::collections::HashMap;

/// Weight of hand and fingers beyond the sensor, N (1.201308 kg).
const HAND_WEIGHT: f64 = 1.201308 * 9.81;

/// Distance from the sensor's middle to the grasp point, m.
const SENSOR_TO_GRASP: f64 = 0.126;

fn world(options: MujocoOptions) -> MujocoWorld {
    MujocoWorld::new(&options).expect("the scene loads")
}

fn torch_at(position: [f64; 2]) -> Scene {
    Scene::with(ObjectSpec::new(ObjectKind::SmallTorch).at(position))
}

fn steps(seconds: f64) -> usize {
    (seconds / STEP_SECONDS) as usize
}

/// Lets the world run under ideal gravity compensation.
fn float(world: &mut MujocoWorld, seconds: f64) {
    for _ in 0..steps(seconds) {
        let torques = world.bias_torques();
        world.step(&torques);
    }
}

/// Columns of the matrix of a unit quaternion.
fn axes([w, x, y, z]: [f64; 4]) -> [[f64; 3]; 3] {
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)],
        [2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)],
        [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

/// Force and torque of a wrist wrench in world axes. The sensor's axes are the grasp frame's, turned by pi about z.
fn wrench_in_world(world: &MujocoWorld) -> [[f64; 3]; 2] {
    let [x, y, z] = axes(world.grasp_pose().quaternion);
    let w = world.wrist_wrench();
    [0, 3].map(|k| std::array::from_fn(|i| -x[i] * w[k] - y[i] * w[k + 1] + z[i] * w[k + 2]))
}

/// Rows of the golden vectors of the arm with sensor and hand, by column name.
fn golden_rows() -> Vec<HashMap<String, f64>> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/vectors/dyn_wam7_bh280_ft.csv");
    let text = std::fs::read_to_string(path).expect("the golden vectors are in the repository");
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let names: Vec<_> = lines.next().expect("a header").split(',').map(str::to_owned).collect();
    lines
        .map(|line| names.iter().cloned().zip(line.split(',').map(|x| x.parse().expect("a number"))).collect())
        .collect()
}

fn column(row: &HashMap<String, f64>, name: &str) -> [f64; 7] {
    std::array::from_fn(|i| row[&format!("{name}{}", i + 1)])
}

/// The posture of the hand for which the golden vectors were computed.
fn golden_hand() -> MujocoOptions {
    MujocoOptions { fingers: 1.0, ..MujocoOptions::default() }
}

#[test]
fn gravity_equals_the_golden_vectors() {
    let mut rows = 0;
    for row in golden_rows() {
        let posture = column(&row, "q");
        let gravity = column(&row, "g");
        // Some golden postures lie beyond the stops: a world cannot start there.
        let Ok(world) = MujocoWorld::new(&MujocoOptions { posture, ..golden_hand() }) else {
            continue;
        };
        for (mujoco, golden) in world.bias_torques().iter().zip(gravity) {
            assert!((mujoco - golden).abs() < 1e-9, "{mujoco} is not {golden} at {posture:?}");
        }
        rows += 1;
    }
    assert!(rows >= 50, "only {rows} postures compared");
}

#[test]
fn grasp_pose_and_jacobian_equal_the_golden_vectors() {
    let mut kinematics = Kinematics::new(&golden_hand()).expect("the scene loads");
    for row in golden_rows() {
        let q = column(&row, "q");
        let pose = kinematics.grasp_pose(&q);
        let position = ["px", "py", "pz"].map(|name| row[name]);
        let quaternion = ["qw", "qx", "qy", "qz"].map(|name| row[name]);
        for (x, golden) in pose.position.iter().zip(position) {
            assert!((x - golden).abs() < 1e-10, "{q:?}");
        }
        let cosine: f64 = (0..4).map(|i| pose.quaternion[i] * quaternion[i]).sum();
        assert!((cosine.abs() - 1.0).abs() < 1e-10, "{q:?}");
        for (i, line) in kinematics.jacobian(&q).iter().enumerate() {
            for (j, x) in line.iter().enumerate() {
                assert!((x - row[&format!("J{}{}", i + 1, j + 1)]).abs() < 1e-10, "row {i} column {j} at {q:?}");
            }
        }
    }
}

#[test]
fn the_sensor_feels_the_weight_of_the_hand_whatever_its_attitude() {
    for posture in [[0.0; 7], DEMONSTRATION_START, DEMONSTRATION_GOAL, [0.3, 0.5, -0.4, 1.2, 0.6, 0.9, -1.1]] {
        let mut world = world(MujocoOptions { posture, ..MujocoOptions::default() });
        float(&mut world, 0.5);
        let [force, _] = wrench_in_world(&world);
        for (f, expected) in force.iter().zip([0.0, 0.0, -HAND_WEIGHT]) {
            assert!((f - expected).abs() < 0.02, "{force:?} at {posture:?}");
        }
    }
}

#[test]
fn a_push_appears_in_the_sensor_with_its_own_sign_and_its_lever_arm() {
    for force in [[0.3, 0.0, 0.0], [0.0, 0.3, 0.0], [0.0, 0.0, 0.3]] {
        let mut world = world(MujocoOptions { posture: DEMONSTRATION_GOAL, ..MujocoOptions::default() });
        float(&mut world, 0.5);
        let before = wrench_in_world(&world);
        world.push(force, [0.0, 0.0, 0.02]);
        float(&mut world, 0.5);
        let after = wrench_in_world(&world);
        // Torque about the sensor: the teacher's own, plus lever arm (along the hand's z) times force.
        let arm = axes(world.grasp_pose().quaternion)[2].map(|x| SENSOR_TO_GRASP * x);
        let torque = [
            arm[1] * force[2] - arm[2] * force[1],
            arm[2] * force[0] - arm[0] * force[2],
            0.02 + arm[0] * force[1] - arm[1] * force[0],
        ];
        for i in 0..3 {
            assert!((after[0][i] - before[0][i] - force[i]).abs() < 0.02, "force {force:?}: {before:?} to {after:?}");
            assert!((after[1][i] - before[1][i] - torque[i]).abs() < 0.005, "force {force:?}: {before:?} to {after:?}");
        }
    }
}

#[test]
fn without_friction_a_push_moves_the_hand_its_way_and_with_friction_the_arm_stands() {
    let shift = |joint_friction, force: [f64; 3]| {
        let mut world =
            world(MujocoOptions { posture: DEMONSTRATION_GOAL, joint_friction, ..MujocoOptions::default() });
        let before = world.grasp_pose().position;
        world.push(force, [0.0; 3]);
        float(&mut world, 0.4);
        let after = world.grasp_pose().position;
        (0..3).map(|i| (after[i] - before[i]) * force[i] / 0.5).sum::<f64>()
    };
    for force in [[0.5, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, -0.5]] {
        let (free, stuck) = (shift(false, force), shift(true, force));
        assert!(free > 4e-4, "{force:?} moves the hand by {free} m without friction");
        assert!(stuck.abs() < 1e-4, "{force:?}: {stuck} m with friction, {free} m without");
    }
}

#[test]
fn a_torque_accelerates_its_own_joint_in_its_own_direction() {
    for joint in 0..7 {
        for sign in [1.0, -1.0] {
            let options = MujocoOptions {
                posture: DEMONSTRATION_START,
                joint_friction: false,
                gravity: 0.0,
                ..MujocoOptions::default()
            };
            let mut world = world(options);
            let mut torques = [0.0; 7];
            torques[joint] = sign * 0.5;
            world.step(&torques);
            let (q, dq) =
                (world.joint_positions()[joint] - DEMONSTRATION_START[joint], world.joint_velocities()[joint]);
            assert!(sign * dq > 1e-5, "joint {} runs at {dq} rad/s", joint + 1);
            // Semi-implicit: the position moves with the new velocity, by one step of the schedule.
            assert!((q - dq * STEP_SECONDS).abs() < 1e-12, "joint {} moved by {q} rad", joint + 1);
        }
    }
}

#[test]
fn the_pose_between_two_steps_belongs_to_the_joint_angles_at_the_same_instant() {
    let options = MujocoOptions { posture: DEMONSTRATION_START, ..MujocoOptions::default() };
    let mut world = world(options.clone());
    let mut kinematics = Kinematics::new(&options).expect("the scene loads");
    for _ in 0..steps(0.3) {
        world.step(&[5.0, 10.0, 2.0, -2.0, 1.0, 1.0, 0.5]);
        let pose = kinematics.grasp_pose(&world.joint_positions());
        for (x, y) in world.grasp_pose().position.iter().zip(pose.position) {
            assert!((x - y).abs() < 1e-12, "the hand is at {x} m, its joints say {y} m");
        }
    }
}

#[test]
fn an_arm_without_power_falls_and_comes_to_rest_within_its_stops() {
    for posture in [HOME, DEMONSTRATION_START, [1.0, -0.5, 0.5, 1.0, -2.0, 0.5, 0.0]] {
        let mut world = world(MujocoOptions { posture, ..MujocoOptions::default() });
        for _ in 0..steps(5.0) {
            world.step(&[0.0; 7]);
        }
        assert_eq!(world.warnings(), 0);
        let (q, dq) = (world.joint_positions(), world.joint_velocities());
        for (i, [low, high]) in world.joint_ranges().into_iter().enumerate() {
            assert!((low - 0.05..high + 0.05).contains(&q[i]), "joint {} at {}", i + 1, q[i]);
            assert!(dq[i].abs() < 0.05, "joint {} still runs at {} rad/s", i + 1, dq[i]);
        }
    }
}

#[test]
fn the_flashlight_stands_still_for_twenty_seconds() {
    let mut world = world(MujocoOptions::default());
    let start = world.object_pose().expect("an object").position;
    let mut tilt: f64 = 0.0;
    for _ in 0..steps(20.0) {
        world.step(&[0.0; 7]);
        tilt = tilt.max(world.object_tilt().expect("an object"));
    }
    let end = world.object_pose().expect("an object").position;
    assert!((start[2] + 0.025).abs() < 1e-9 && (end[2] - start[2]).abs() < 5e-4, "it stands at {end:?}");
    assert!(tilt.to_degrees() < 0.1, "{} degrees", tilt.to_degrees());
    assert!((end[0] - start[0]).hypot(end[1] - start[1]) < 2e-4, "{start:?} to {end:?}");
}

#[test]
fn the_same_inputs_give_the_same_bits_and_others_give_others() {
    let run = |seed: u64| {
        let mut world = world(MujocoOptions { posture: DEMONSTRATION_START, ..MujocoOptions::default() });
        let mut noise = Noise::new(seed, 0);
        let mut bits: Vec<u64> = Vec::new();
        for step in 0..4000 {
            if step % 200 == 0 {
                world.push(std::array::from_fn(|_| noise.gaussian(10.0)), std::array::from_fn(|_| noise.gaussian(0.5)));
            }
            let bias = world.bias_torques();
            world.step(&bias.map(|x| x + noise.gaussian(0.5)));
            if step % 100 == 0 {
                let Pose { position, quaternion } = world.grasp_pose();
                let numbers = world.configuration().iter().chain(&position).chain(&quaternion).copied();
                bits.extend(numbers.chain(world.wrist_wrench()).map(f64::to_bits));
            }
        }
        bits
    };
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2));
}

#[test]
fn a_flashlight_where_the_hand_goes_is_hit() {
    let mut world = world(MujocoOptions {
        posture: DEMONSTRATION_START,
        scene: torch_at([0.74, -0.08]),
        ..MujocoOptions::default()
    });
    let mut contacts = 0;
    for step in 0..steps(3.0) {
        let share = (step as f64 / steps(2.0) as f64).min(1.0);
        let (q, dq, bias) = (world.joint_positions(), world.joint_velocities(), world.bias_torques());
        let gain = [300.0, 300.0, 100.0, 100.0, 15.0, 15.0, 5.0];
        world.step(&std::array::from_fn(|i| {
            let q_d = DEMONSTRATION_START[i] + share * (DEMONSTRATION_GOAL[i] - DEMONSTRATION_START[i]);
            bias[i] + gain[i] * (q_d - q[i] - 0.1 * dq[i])
        }));
        contacts += world.robot_contacts();
    }
    assert!(contacts > 0 && world.object_tilt().expect("an object").to_degrees() > 10.0, "{contacts} contacts");
    assert_eq!(world.warnings(), 0);
}

#[test]
fn options_that_make_no_sense_are_refused_with_the_reason() {
    let refused = |options: MujocoOptions| MujocoWorld::new(&options).err().expect("refused");
    let mut posture = HOME;
    posture[5] = 1.6;
    let error = refused(MujocoOptions { posture, ..MujocoOptions::default() });
    assert_eq!(error.to_string(), "joint 6 cannot start at 1.6 rad: its range is -1.57 .. 1.57 rad");
    posture[5] = f64::NAN;
    assert!(matches!(refused(MujocoOptions { posture, ..Default::default() }), WorldError::Posture { joint: 6, .. }));
    for position in [[0.3, 0.0], [0.8, 0.6], [f64::NAN, 0.0]] {
        let scene = torch_at(position);
        assert!(matches!(refused(MujocoOptions { scene, ..Default::default() }), WorldError::OffTable { .. }));
    }
    let hollow = Scene::with(ObjectSpec { mass: 0.0, ..ObjectSpec::new(ObjectKind::Cup) });
    let torn = Imperfections { cables: Some(Cables { stiffness: [0.0; 7], ..Cables::WAM }), ..Imperfections::NONE };
    for options in [
        MujocoOptions { fingers: -0.1, ..Default::default() },
        MujocoOptions { spread: 4.0, ..Default::default() },
        MujocoOptions { gravity: f64::INFINITY, ..Default::default() },
        MujocoOptions { scene: hollow, ..Default::default() },
        MujocoOptions { imperfections: torn, ..Default::default() },
        MujocoOptions {
            imperfections: Imperfections { friction: [f64::NAN; 7], ..Imperfections::NONE },
            ..Default::default()
        },
    ] {
        assert!(matches!(refused(options), WorldError::OutOfRange { .. }));
    }
}
