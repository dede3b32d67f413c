//! Objects obey the physics that their figures promise: toppling, sliding, contact forces, and grasps by the hand.
#![cfg(feature = "mujoco")]

use sim::teacher::TaughtMovement;
use sim::world::mujoco::{ContactForces, MujocoOptions, MujocoWorld, ObjectKind, ObjectSpec, Scene, TABLE_TOP};
use sim::{HandTargets, STEP_SECONDS, World};

fn steps(seconds: f64) -> usize {
    (seconds / STEP_SECONDS) as usize
}

fn world_with(object: ObjectSpec) -> MujocoWorld {
    MujocoWorld::new(&MujocoOptions { scene: Scene::with(object), ..MujocoOptions::default() }).expect("it loads")
}

fn tilt(world: &MujocoWorld) -> f64 {
    world.object_tilt().expect("an object").to_degrees()
}

fn position(world: &MujocoWorld) -> [f64; 3] {
    world.object_pose().expect("an object").position
}

/// Pushes at a height over the table, harder and harder, in a direction, until the object leans or has moved.
/// Gives the force, the tilt (degrees) and the way (m) by then.
fn push_until_it_moves(object: ObjectSpec, height: f64, direction: f64) -> (f64, f64, f64) {
    let mut world = world_with(object);
    let start = position(&world);
    for step in 0..steps(12.0) {
        let force = step as f64 / steps(1.0) as f64 * 0.5;
        let [x, y, _] = position(&world);
        world.push_object([force * direction.cos(), force * direction.sin(), 0.0], [x, y, TABLE_TOP + height]);
        world.step(&[0.0; 7]);
        let [x, y, _] = position(&world);
        let way = (x - start[0]).hypot(y - start[1]);
        if tilt(&world) > 1.0 || way > 0.005 {
            return (force, tilt(&world), way);
        }
    }
    panic!("{object:?} withstands 6 N");
}

#[test]
fn every_object_rests_where_it_was_put() {
    for kind in ObjectKind::ALL {
        let object = ObjectSpec { yaw: 0.3, ..ObjectSpec::new(kind) };
        let mut world = world_with(object);
        let start = position(&world);
        for _ in 0..steps(5.0) {
            world.step(&[0.0; 7]);
        }
        let end = position(&world);
        assert!(tilt(&world) < 0.2, "{kind:?} leans by {} degrees", tilt(&world));
        assert!((0..3).all(|i| (end[i] - start[i]).abs() < 1e-3), "{kind:?}: {start:?} to {end:?}");
        assert_eq!(world.warnings(), 0);
    }
}

#[test]
fn the_flashlight_topples_when_pushed_at_12_cm_with_its_weight_times_radius_over_height() {
    let object = ObjectSpec::new(ObjectKind::Flashlight);
    assert!((object.toppling_force(0.12) - 1.97).abs() < 0.01);
    for direction in [0.0, 0.7, 2.0, 4.0] {
        let (force, tilt, way) = push_until_it_moves(object, 0.12, direction);
        println!("{force:.3} N, {tilt:.2} degrees, {way:.4} m towards {direction}");
        assert!(tilt > 1.0, "it slides by {way} m instead");
        assert!((force / object.toppling_force(0.12) - 1.0).abs() < 0.1, "topples at {force} N");
    }
}

#[test]
fn below_the_radius_over_friction_it_slides_at_the_force_of_friction() {
    let object = ObjectSpec::new(ObjectKind::Flashlight);
    for (table_friction, direction) in [(0.4, 0.0), (0.4, 0.7), (0.3, 2.5)] {
        // Whatever the fingers' friction is, it must not matter on the table.
        let object = ObjectSpec { table_friction, finger_friction: 1.5, ..object };
        let height = 0.7 * object.foot_radius() / table_friction;
        let (force, tilt, way) = push_until_it_moves(object, height, direction);
        println!("{force:.3} N, {tilt:.2} degrees, {way:.4} m at {height:.3} m");
        assert!(way > 0.005 && tilt < 0.5, "it leans by {tilt} degrees");
        let friction = table_friction * object.mass * 9.81;
        assert!((force / friction - 1.0).abs() < 0.1, "slides at {force} N, friction is {friction} N");
    }
}

#[test]
fn a_push_below_friction_does_not_make_it_creep_away() {
    let object = ObjectSpec::new(ObjectKind::Flashlight);
    let mut world = world_with(object);
    let start = position(&world);
    for _ in 0..steps(5.0) {
        let [x, y, _] = position(&world);
        // 60 % of the force of friction.
        world.push_object([0.6 * 0.4 * 0.86 * 9.81, 0.0, 0.0], [x, y, TABLE_TOP + 0.02]);
        world.step(&[0.0; 7]);
    }
    let way = position(&world)[0] - start[0];
    println!("crept by {way} m in 5 s");
    assert!(way < 0.005, "it crept by {way} m in 5 s");
}

#[test]
fn a_lying_bottle_rolls_across_its_axis_and_slides_along_it() {
    let object = ObjectSpec::new(ObjectKind::Bottle);
    let (along, ..) = push_until_it_moves(object, object.radius, 0.0);
    let (across, ..) = push_until_it_moves(object, object.radius, std::f64::consts::FRAC_PI_2);
    assert!((along / (0.5 * 0.5 * 9.81) - 1.0).abs() < 0.15, "slides at {along} N");
    assert!(across < 0.3, "rolls at {across} N");
}

#[test]
fn what_the_object_exerts_on_the_table_balances_its_weight_and_the_push() {
    let mut world = world_with(ObjectSpec::new(ObjectKind::Flashlight));
    for _ in 0..steps(0.5) {
        let [x, y, _] = position(&world);
        world.push_object([1.0, -0.5, 0.0], [x, y, TABLE_TOP + 0.02]);
        world.step(&[0.0; 7]);
    }
    let force = world.mean_contact_forces().object_on_table;
    for (f, expected) in force.iter().zip([1.0, -0.5, -0.86 * 9.81]) {
        assert!((f - expected).abs() < 0.05, "{force:?}");
    }
}

/// The arm held stiffly at a posture, the fingers closed at 2 rad/s until they press, then the hand raised by 5 cm.
/// Gives the mean contact forces at the end, how far the object rose, and the world.
fn grasp_and_lift(object: ObjectSpec, fingers: f64) -> (ContactForces, f64, MujocoWorld) {
    let movement = TaughtMovement::Lift;
    let scene = Scene::with(object);
    let options = MujocoOptions { scene, posture: movement.goal(), ..MujocoOptions::default() };
    let mut mechanism = sim::world::mujoco::Kinematics::new(&options).expect("it loads");
    let top = mechanism.grasp_pose(&movement.goal());
    let mut low = top;
    low.position[2] -= 0.10;
    let mut raised = low;
    raised.position[2] += 0.05;
    let below = mechanism.inverse(&low, &movement.goal()).expect("reachable");
    let above = mechanism.inverse(&raised, &below).expect("reachable");
    let mut world = MujocoWorld::new(&MujocoOptions { posture: below, ..options }).expect("it loads");
    let start = position(&world)[2];
    for step in 0..steps(5.0) {
        let time = step as f64 * STEP_SECONDS;
        let close = (0.25 + 2.0 * time).min(fingers);
        // The clutch: the outer link goes on when the inner one is stopped.
        let hand = world.hand();
        let inner = std::array::from_fn(|i| close.min(hand.inner[i] + 0.012));
        let outer = std::array::from_fn(|i| (close / 3.0).min(hand.outer[i] + 0.008));
        world.drive_hand(&HandTargets { inner, outer, spread: 0.0 });
        let share = ((time - 2.0) / 2.0).clamp(0.0, 1.0);
        let (q, dq, bias) = (world.joint_positions(), world.joint_velocities(), world.bias_torques());
        let gain = [1500.0, 1500.0, 500.0, 500.0, 60.0, 60.0, 20.0];
        world.step(&std::array::from_fn(|i| {
            bias[i] + gain[i] * (below[i] + share * (above[i] - below[i]) - q[i] - 0.1 * dq[i])
        }));
    }
    (world.mean_contact_forces(), position(&world)[2] - start, world)
}

#[test]
fn fingers_that_close_lift_the_weight_and_a_slippery_one_stays() {
    let object = ObjectSpec::new(ObjectKind::Weight);
    let (forces, rise, world) = grasp_and_lift(object, 2.4);
    println!("{forces:.2?} rise {rise:.4} hand {:.3?}", world.hand());
    assert!((rise - 0.05).abs() < 0.01, "it rose by {rise} m");
    assert!((forces.hand_on_object[2] - object.mass * 9.81).abs() < 0.3, "{forces:?}");
    assert!(forces.hand_on_object[0].abs() < 0.3 && forces.hand_on_object[1].abs() < 0.3, "{forces:?}");
    assert!(forces.fingers_on_object.iter().all(|f| *f > 1.0), "{forces:?}");
    assert_eq!(forces.object_on_table, [0.0; 3]);
    // What presses on the object opens the finger: the drive must close.
    assert!(world.hand().inner_load.iter().zip(world.hand().outer_load).any(|(i, o)| *i > 0.3 && o > 0.1));

    let (_, rise, _) = grasp_and_lift(ObjectSpec { finger_friction: 0.02, table_friction: 1.0, ..object }, 2.4);
    assert!(rise < 0.02, "a slippery weight rose by {rise} m");
}

#[test]
fn a_paper_cup_is_crushed_by_a_hard_grasp_only() {
    let cup = ObjectSpec::new(ObjectKind::PaperCup);
    let (forces, _, hard) = grasp_and_lift(cup, 2.4);
    assert!(hard.object_crushed(), "{forces:?}");
    let (forces, _, open) = grasp_and_lift(cup, 0.8);
    assert!(!open.object_crushed(), "{forces:?}");
}

#[test]
fn the_hand_stays_where_it_is_held_and_goes_where_it_is_driven() {
    let mut world = MujocoWorld::new(&MujocoOptions { scene: Scene::NOTHING, fingers: 0.6, ..Default::default() })
        .expect("it loads");
    let run = |world: &mut MujocoWorld, seconds: f64| {
        for _ in 0..steps(seconds) {
            let torques = world.bias_torques();
            world.step(&torques);
        }
        world.hand()
    };
    let held = run(&mut world, 1.0);
    for finger in 0..3 {
        assert!((held.inner[finger] - 0.6).abs() < 2e-3 && (held.outer[finger] - 0.2).abs() < 2e-3, "{held:?}");
    }
    let targets = HandTargets { inner: [1.0, 1.4, 0.2], outer: [0.1, 0.4, 0.7], spread: 1.2 };
    world.drive_hand(&targets);
    let driven = run(&mut world, 2.0);
    for finger in 0..3 {
        assert!((driven.inner[finger] - targets.inner[finger]).abs() < 3e-3, "{driven:?}");
        assert!((driven.outer[finger] - targets.outer[finger]).abs() < 3e-3, "{driven:?}");
        assert!(driven.inner_load[finger].abs() < 0.2 && driven.outer_load[finger].abs() < 0.1, "{driven:?}");
    }
    assert!((driven.spread - 1.2).abs() < 0.02, "{driven:?}");
    assert_eq!(world.object_pose(), None);
    assert_eq!(world.object_tilt(), None);
    assert_eq!(world.contact_forces(), ContactForces::default());
}
