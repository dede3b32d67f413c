//! Every movement is reachable, and a teacher can teach it to an arm under gravity compensation.
#![cfg(feature = "mujoco")]

use sim::teacher::{GuidedWorld, Stage, TaughtMovement, Teacher, TeacherConfig};
use sim::world::mujoco::{
    Imperfections, Kinematics, MujocoOptions, MujocoWorld, ObjectKind, ObjectSpec, Scene, TABLE_TOP,
};
use sim::{HOME, Pose, STEP_SECONDS, World};

/// Stations at which paths are examined.
const STATIONS: u32 = 200;

/// The movements that `teaching.rs` does not examine already.
const MOVEMENTS: [TaughtMovement; 4] =
    [TaughtMovement::Flashlight, TaughtMovement::Cup, TaughtMovement::Bottle, TaughtMovement::Lift];

/// The grasp from above ends where open fingertips meet the table: up to this height above its end it touches nothing,
/// m.
const BOTTLE_CLEARANCE: f64 = 1e-3;

/// The object that is meant.
fn object(movement: TaughtMovement) -> ObjectSpec {
    ObjectSpec::new(match movement {
        TaughtMovement::SmallTorch => ObjectKind::SmallTorch,
        TaughtMovement::Flashlight => ObjectKind::Flashlight,
        TaughtMovement::Cup => ObjectKind::Cup,
        TaughtMovement::Bottle => ObjectKind::Bottle,
        TaughtMovement::Lift => ObjectKind::Weight,
    })
}

/// The surroundings that a movement must not touch on its way. For the grasp from above that is the bottle alone: where
/// it ends, the table is in the way on purpose.
fn surroundings(movement: TaughtMovement) -> Scene {
    Scene { table: movement != TaughtMovement::Bottle, ..Scene::with(object(movement)) }
}

fn kinematics(scene: Scene) -> Kinematics {
    Kinematics::new(&MujocoOptions { scene, ..MujocoOptions::default() }).expect("the scene loads")
}

/// Distance (m) and turn (rad) between two poses.
fn apart(a: &Pose, b: &Pose) -> (f64, f64) {
    let distance = (0..3).map(|i| (a.position[i] - b.position[i]).powi(2)).sum::<f64>().sqrt();
    let cosine = (0..4).map(|i| a.quaternion[i] * b.quaternion[i]).sum::<f64>().abs().min(1.0);
    (distance, 2.0 * cosine.acos())
}

/// Smallest distance to a mechanical stop, rad.
fn margin(q: &[f64; 7], ranges: &[[f64; 2]; 7]) -> f64 {
    q.iter().zip(ranges).map(|(q, [low, high])| (q - low).min(high - q)).fold(f64::INFINITY, f64::min)
}

/// The hand's x and z axes in the world.
fn hand_axes([w, x, y, z]: [f64; 4]) -> [[f64; 3]; 2] {
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)],
        [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

#[test]
fn the_postures_of_every_movement_reach_the_ends_of_its_path() {
    let mut mechanism = kinematics(Scene::EMPTY);
    for movement in TaughtMovement::ALL {
        let path = movement.path();
        // How the constants were found, and will be found again if a path changes.
        let goal = mechanism.inverse(&path.goal(), &movement.goal()).expect("reachable");
        println!("{movement:?} goal {goal:.4?} start {:.4?}", mechanism.inverse(&path.start(), &goal));
        for (posture, pose) in [(movement.start(), path.start()), (movement.goal(), path.goal())] {
            let (distance, turn) = apart(&mechanism.grasp_pose(&posture), &pose);
            assert!(distance < 3e-4 && turn < 3e-4, "{movement:?}: {posture:?} misses by {distance} m, {turn} rad");
        }
        // The way the start was found.
        let found = mechanism.inverse(&path.start(), &movement.goal()).expect("reachable");
        assert!((0..7).all(|i| (found[i] - movement.start()[i]).abs() < 2e-3), "{movement:?}: {found:.4?}");
    }
}

#[test]
fn every_path_keeps_away_from_stops_and_from_all_but_the_object() {
    for movement in MOVEMENTS {
        let mut mechanism = kinematics(surroundings(movement));
        let ranges = mechanism.joint_ranges();
        let path = movement.path();
        let mut last: Option<[f64; 7]> = None;
        for station in 0..=STATIONS {
            let pose = path.pose(path.duration() * f64::from(station) / f64::from(STATIONS));
            let q = mechanism.inverse(&pose, &movement.goal()).expect("every pose of the path is reachable");
            assert!(margin(&q, &ranges) > 0.3, "{movement:?}: {} rad from a stop at {q:?}", margin(&q, &ranges));
            assert_eq!(mechanism.robot_contacts(&q), 0, "{movement:?}: the arm touches something at {q:?}");
            // No jump from one posture to another along the way.
            let step = last.map_or(0.0, |last| (0..7).map(|i| (q[i] - last[i]).abs()).fold(0.0, f64::max));
            assert!(step < 0.05, "{movement:?} jumps by {step} rad");
            last = Some(q);
        }
        for station in 0..=STATIONS {
            let share = f64::from(station) / f64::from(STATIONS);
            let q: [f64; 7] = std::array::from_fn(|i| HOME[i] + share * (movement.start()[i] - HOME[i]));
            assert_eq!(mechanism.robot_contacts(&q), 0, "{movement:?}: on the way from home, at {q:?}");
        }
    }
}

#[test]
fn the_grasp_from_above_meets_the_table_at_its_very_end_and_with_closing_fingers() {
    let movement = TaughtMovement::Bottle;
    let path = movement.path();
    let mut open = kinematics(Scene::EMPTY);
    for station in 0..=STATIONS {
        let pose = path.pose(path.duration() * f64::from(station) / f64::from(STATIONS));
        let q = open.inverse(&pose, &movement.goal()).expect("every pose of the path is reachable");
        let above_end = pose.position[2] - path.goal().position[2];
        assert!(above_end < BOTTLE_CLEARANCE || open.robot_contacts(&q) == 0, "touches {above_end} m above the end");
        let share = f64::from(station) / f64::from(STATIONS);
        let q: [f64; 7] = std::array::from_fn(|i| HOME[i] + share * (movement.start()[i] - HOME[i]));
        assert_eq!(open.robot_contacts(&q), 0, "on the way from home, at {q:?}");
    }
    // What the movement is for: at its end no hand closes without the table giving way, or the hand: it has to rise by
    // 4 cm.
    let touches = |above: f64, fingers: f64| {
        let options = MujocoOptions { scene: Scene::EMPTY, fingers, ..MujocoOptions::default() };
        let mut mechanism = Kinematics::new(&options).expect("the scene loads");
        let mut pose = path.goal();
        pose.position[2] += above;
        let q = mechanism.inverse(&pose, &movement.goal()).expect("reachable");
        mechanism.robot_contacts(&q)
    };
    let closing = || (0..=20).map(|step| 0.25 + 0.105 * f64::from(step));
    assert!(
        closing().any(|fingers| touches(0.035, fingers) >= 3),
        "closing fingers reach less than 3.5 cm into the table"
    );
    assert!(closing().all(|fingers| touches(0.05, fingers) == 0), "5 cm higher they still touch it");
}

#[test]
fn side_grasps_arrive_level_and_at_their_azimuth_and_the_bottle_is_grasped_from_above() {
    let half = 0.5_f64.sqrt();
    let (sine, cosine) = 60.0_f64.to_radians().sin_cos();
    for (movement, height, z_axis, x_axis) in [
        (TaughtMovement::Flashlight, 0.11, [cosine, sine, 0.0], [0.0, 0.0, -1.0]),
        (TaughtMovement::Cup, 0.06, [half, half, 0.0], [0.0, 0.0, -1.0]),
        (TaughtMovement::Bottle, 0.025, [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]),
        (TaughtMovement::Lift, 0.19, [half, half, 0.0], [0.0, 0.0, -1.0]),
    ] {
        let path = movement.path();
        let goal = path.goal();
        let [x, z] = hand_axes(goal.quaternion);
        assert!((0..3).all(|i| (x[i] - x_axis[i]).abs() < 1e-9 && (z[i] - z_axis[i]).abs() < 1e-9), "{movement:?}");
        assert!((goal.position[2] - TABLE_TOP - height).abs() < 1e-9, "{movement:?} ends at {:?}", goal.position);
        let there = object(movement).position;
        let short = movement.short_of_object();
        let aim: [f64; 2] = std::array::from_fn(|i| there[i] - short * z[i]);
        assert!((0..2).all(|i| (goal.position[i] - aim[i]).abs() < 1e-9), "{movement:?} beside its object");
        // The last centimetres before the fingers close follow the hand's z.
        let arrived = path.pose(movement.arrival()).position;
        let before = path.pose(movement.arrival() - 2.5).position;
        let along: f64 = (0..3).map(|i| (arrived[i] - before[i]) * z[i]).sum();
        let way = (0..3).map(|i| (arrived[i] - before[i]).powi(2)).sum::<f64>().sqrt();
        assert!(way > 0.01 && along / way > 0.98, "{movement:?} arrives askew: {along} of {way} m");
    }
    assert!(
        (TaughtMovement::Flashlight.path().length() - 0.42).abs() < 0.02,
        "{}",
        TaughtMovement::Flashlight.path().length()
    );
}

#[test]
fn the_lift_rests_for_the_fingers_and_then_goes_straight_up() {
    let path = TaughtMovement::Lift.path();
    let arrival = TaughtMovement::Lift.arrival();
    assert!((path.duration() - arrival - 6.0).abs() < 1e-12);
    let rest = path.pose(arrival);
    for time in [0.5, 2.0, 3.5] {
        assert!(apart(&path.pose(arrival + time), &rest).0 < 1e-12);
    }
    for step in 0..=50 {
        let pose = path.pose(arrival + 3.5 + 0.05 * f64::from(step));
        assert!((pose.position[0] - rest.position[0]).hypot(pose.position[1] - rest.position[1]) < 1e-12);
    }
    assert!((path.goal().position[2] - rest.position[2] - 0.10).abs() < 1e-12);
    // Never faster than a teacher would, never with a jump between the legs.
    for step in 0..(100.0 * path.duration()) as u32 {
        let (way, _) = apart(&path.pose(0.01 * f64::from(step)), &path.pose(0.01 * f64::from(step + 1)));
        assert!(way < 0.0012, "{way} m in 10 ms at {step}");
    }
}

/// Guides the arm through a movement under ideal gravity compensation. Gives the smallest margin to a stop on the way,
/// and the world at its end.
fn teach(
    movement: TaughtMovement,
    seed: u64,
    scene: Scene,
    imperfections: Imperfections,
) -> (f64, GuidedWorld<MujocoWorld>) {
    let options = MujocoOptions { posture: movement.start(), scene, imperfections, ..MujocoOptions::default() };
    let world = MujocoWorld::new(&options).expect("the scene loads");
    let teacher = Teacher::new(TeacherConfig { seed, ..TeacherConfig::default() }, movement.path());
    let mut guided = GuidedWorld::new(world, teacher);
    let ranges = guided.world().joint_ranges();
    guided.teacher_mut().begin();
    let mut smallest = f64::INFINITY;
    for step in 0.. {
        let bias = guided.world().bias_torques();
        guided.step(&bias);
        smallest = smallest.min(margin(&guided.joint_positions(), &ranges));
        if guided.teacher().stage() == Stage::Done {
            break;
        }
        assert!(f64::from(step) * STEP_SECONDS < 40.0, "the teacher never lets go");
    }
    (smallest, guided)
}

#[test]
fn the_teacher_teaches_every_movement_without_moving_the_object() {
    for movement in MOVEMENTS {
        for seed in 0..2 {
            // The lift is taught empty-handed: nobody closes the fingers here.
            let scene = if movement == TaughtMovement::Lift { Scene::EMPTY } else { Scene::with(object(movement)) };
            let (margin, guided) = teach(movement, seed, scene, Imperfections::NONE);
            let (distance, turn) = apart(&guided.grasp_pose(), &movement.path().goal());
            let q = guided.joint_positions();
            println!(
                "{movement:?} {seed}: {distance:.4} m, {:.2} degrees, margin {margin:.2}, {q:.3?}",
                turn.to_degrees()
            );
            assert!(distance < 0.015 && turn.to_degrees() < 5.0, "{movement:?}: {distance} m, {turn} rad");
            assert!(margin > 0.15, "{movement:?}: {margin} rad from a stop");
            let forces = guided.world().mean_contact_forces();
            if movement == TaughtMovement::Flashlight {
                // A teacher brings the palm against what is slender, and no harder: the flashlight topples at 2 N.
                assert_eq!(forces.fingers_on_object, [0.0; 3], "{movement:?}: {forces:?}");
                assert!(forces.palm_on_object < 1.5, "{movement:?}: {forces:?}");
            } else {
                assert_eq!((forces.hand_on_object, forces.palm_on_object), ([0.0; 3], 0.0), "{movement:?}: {forces:?}");
            }
            if movement == TaughtMovement::Bottle {
                // Open fingertips come to rest on the table, and nothing of the arm's weight with them: what presses is
                // what dry friction keeps of the teacher's hand, 2 N m of joint 2 at 0.63 m, and a little sideways.
                let press = forces.hand_on_table.iter().map(|f| f * f).sum::<f64>().sqrt();
                assert!(press < 4.0, "{movement:?} presses on the table with {press} N");
            } else if movement != TaughtMovement::Flashlight {
                assert_eq!(guided.world().robot_contacts(), 0, "{movement:?}: {forces:?}");
            }
            assert!(guided.world().object_tilt().is_none_or(|tilt| tilt.to_degrees() < 0.5));
            assert_eq!(guided.world().warnings(), 0);
        }
    }
}

#[test]
fn the_teacher_teaches_an_imperfect_arm_in_an_empty_room_too() {
    let (margin, guided) = teach(TaughtMovement::Flashlight, 5, Scene::NOTHING, Imperfections::drawn(5));
    let (distance, turn) = apart(&guided.grasp_pose(), &TaughtMovement::Flashlight.path().goal());
    assert!(margin > 0.15 && distance < 0.02 && turn.to_degrees() < 6.0, "{margin} {distance} {turn}");
    assert_eq!(guided.hand().spread, guided.world().hand().spread);
    assert_ne!(guided.motor_positions(), guided.joint_positions(), "the motors are hidden by the teacher");
}
