//! The imperfect arm differs from the nominal one as it says, and in nothing else.
#![cfg(feature = "mujoco")]

use sim::teacher::{DEMONSTRATION_GOAL, DEMONSTRATION_START};
use sim::world::mujoco::{Cables, Imperfections, MujocoOptions, MujocoWorld, Scene};
use sim::{Noise, STEP_SECONDS, World};

fn steps(seconds: f64) -> usize {
    (seconds / STEP_SECONDS) as usize
}

fn world(imperfections: Imperfections) -> MujocoWorld {
    let options = MujocoOptions { imperfections, posture: DEMONSTRATION_START, ..MujocoOptions::default() };
    MujocoWorld::new(&options).expect("it loads")
}

const ELASTIC: Imperfections = Imperfections { cables: Some(Cables::WAM), ..Imperfections::NONE };

#[test]
fn drawn_arms_differ_from_seed_to_seed_within_what_is_said() {
    assert_eq!(Imperfections::drawn(3), Imperfections::drawn(3));
    assert_ne!(Imperfections::drawn(3), Imperfections::drawn(4));
    for seed in 0..50 {
        let drawn = Imperfections::drawn(seed);
        assert!(drawn.links.iter().all(|x| (x - 1.0).abs() <= 0.1) && (drawn.hand - 1.0).abs() <= 0.03);
        assert!(drawn.friction.iter().all(|x| (x - 1.0).abs() <= 0.3));
        let stiffness = drawn.cables.expect("cables").stiffness;
        assert!(stiffness.iter().zip(Cables::WAM.stiffness).all(|(k, nominal)| (k / nominal - 1.0).abs() <= 0.2));
    }
}

#[test]
fn heavier_links_weigh_more_in_proportion() {
    let gravity = |imperfections| world(imperfections).bias_torques();
    let nominal = gravity(Imperfections::NONE);
    let heavy = gravity(Imperfections { links: [1.1; 7], hand: 1.1, ..Imperfections::NONE });
    let hand = gravity(Imperfections { hand: 1.1, ..Imperfections::NONE });
    for joint in [1, 3] {
        // The sensor's 136 g stay as they are: a little less than 10 %.
        let share = heavy[joint] / nominal[joint] - 1.0;
        assert!((0.09..0.1).contains(&share), "joint {}: {share}", joint + 1);
        let share = hand[joint] / nominal[joint] - 1.0;
        assert!((0.005..0.06).contains(&share), "joint {} with a heavy hand: {share}", joint + 1);
    }
    // Both ways to write "nothing changes" are the same world to the bit.
    assert_eq!(nominal, gravity(Imperfections { cables: None, ..Imperfections::NONE }));
}

#[test]
fn more_friction_holds_against_more_torque() {
    let turned = |friction: f64, torque: f64| {
        let options = MujocoOptions {
            imperfections: Imperfections { friction: [friction; 7], ..Imperfections::NONE },
            gravity: 0.0,
            ..MujocoOptions::default()
        };
        let mut world = MujocoWorld::new(&options).expect("it loads");
        for _ in 0..steps(0.5) {
            world.step(&[torque, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        }
        world.joint_positions()[0]
    };
    // Nominal dry friction of joint 1: 1.5 N m.
    assert!(turned(1.0, 1.3) < 1e-3 && turned(1.0, 1.7) > 1e-3);
    assert!(turned(1.3, 1.8) < 1e-3 && turned(0.7, 1.2) > 1e-3);
}

#[test]
fn under_load_the_motors_lead_the_joints_by_torque_over_stiffness() {
    let mut world = world(ELASTIC);
    let start = world.motor_positions();
    for _ in 0..steps(4.0) {
        let (theta, omega, bias) = (world.motor_positions(), world.motor_velocities(), world.bias_torques());
        let gain = [300.0, 300.0, 100.0, 100.0, 15.0, 15.0, 5.0];
        world.step(&std::array::from_fn(|i| bias[i] + gain[i] * (start[i] - theta[i] - 0.1 * omega[i])));
    }
    let (q, theta, bias) = (world.joint_positions(), world.motor_positions(), world.bias_torques());
    for i in 0..7 {
        // The joint's own share of dry friction may carry a part of the load.
        let slack = 0.3 * [1.5, 2.0, 1.0, 0.8, 0.2, 0.2, 0.1][i] / Cables::WAM.stiffness[i] + 1e-6;
        let lead = bias[i] / Cables::WAM.stiffness[i];
        assert!((theta[i] - q[i] - lead).abs() <= slack, "joint {}: {} for {lead} rad", i + 1, theta[i] - q[i]);
    }
    assert!((theta[1] - q[1]).abs() > 2e-3, "gravity bends the shoulder by {} rad", theta[1] - q[1]);
}

#[test]
fn very_stiff_cables_make_the_rigid_arm() {
    let stiff = Cables { stiffness: [2e4, 2e4, 2e4, 2e4, 1e3, 1e3, 1e3], damping_ratio: 0.3 };
    let run = |cables| {
        let options = MujocoOptions {
            imperfections: Imperfections { cables, ..Imperfections::NONE },
            posture: DEMONSTRATION_START,
            joint_friction: false,
            scene: Scene::EMPTY,
            ..MujocoOptions::default()
        };
        let mut world = MujocoWorld::new(&options).expect("it loads");
        for step in 0..steps(0.5) {
            let bias = world.bias_torques();
            let wave = (step as f64 * STEP_SECONDS * 12.0).sin();
            let push = [6.0, -6.0, 3.0, 3.0, 0.4, -0.4, 0.05];
            world.step(&std::array::from_fn(|i| bias[i] + push[i] * wave));
        }
        world.joint_positions()
    };
    let (rigid, elastic) = (run(None), run(Some(stiff)));
    for i in 0..7 {
        let way = (rigid[i] - DEMONSTRATION_START[i]).abs();
        assert!(way > 0.004, "joint {} moved by {way} only", i + 1);
        assert!((elastic[i] - rigid[i]).abs() < 0.05 * way + 1e-3, "joint {}: {} and {}", i + 1, rigid[i], elastic[i]);
    }
}

#[test]
fn an_imperfect_arm_shaken_at_random_keeps_its_motors_and_joints_together() {
    for seed in 0..3 {
        let options = MujocoOptions {
            imperfections: Imperfections::drawn(seed),
            posture: DEMONSTRATION_GOAL,
            ..MujocoOptions::default()
        };
        let mut world = MujocoWorld::new(&options).expect("it loads");
        let mut noise = Noise::new(seed, 0);
        for _ in 0..steps(10.0) {
            let bias = world.bias_torques();
            let dq = world.motor_velocities();
            world.step(&std::array::from_fn(|i| {
                bias[i] - 0.5 * dq[i] * [1.0, 1.0, 1.0, 1.0, 0.1, 0.1, 0.01][i]
                    + noise.gaussian([8.0, 8.0, 4.0, 4.0, 1.0, 1.0, 0.2][i])
            }));
            let (q, theta) = (world.joint_positions(), world.motor_positions());
            assert!((0..7).all(|i| (q[i] - theta[i]).abs() < 0.05), "{q:?} {theta:?}");
        }
        assert_eq!(world.warnings(), 0);
    }
}
