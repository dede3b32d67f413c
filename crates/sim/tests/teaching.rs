//! A teacher teaches the simulated arm: the path is reachable, and guiding the arm under gravity compensation works.
#![cfg(feature = "mujoco")]

use sim::teacher::{
    DEMONSTRATION_GOAL, DEMONSTRATION_START, GuidedWorld, Stage, Teacher, TeacherConfig, side_grasp_path,
};
use sim::world::mujoco::{Kinematics, MujocoOptions, MujocoWorld};
use sim::{HOME, Pose, STEP_SECONDS, World};

/// Stations at which paths are examined.
const STATIONS: usize = 200;

fn kinematics() -> Kinematics {
    Kinematics::new(&MujocoOptions::default()).expect("the default scene loads")
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

/// Smallest singular value of a 6 x 7 matrix: the root of the smallest eigenvalue of J J^T, by Jacobi rotations.
fn smallest_singular_value(jacobian: &[[f64; 7]; 6]) -> f64 {
    let mut a = [[0.0_f64; 6]; 6];
    for (i, row) in a.iter_mut().enumerate() {
        for (j, x) in row.iter_mut().enumerate() {
            *x = (0..7).map(|k| jacobian[i][k] * jacobian[j][k]).sum();
        }
    }
    for _ in 0..30 {
        for p in 0..6 {
            for q in p + 1..6 {
                let angle = 0.5 * (2.0 * a[p][q]).atan2(a[q][q] - a[p][p]);
                let (s, c) = angle.sin_cos();
                for row in &mut a {
                    (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                }
                let (above, below) = a.split_at_mut(q);
                for (x, y) in above[p].iter_mut().zip(&mut below[0]) {
                    (*x, *y) = (c * *x - s * *y, s * *x + c * *y);
                }
            }
        }
    }
    (0..6).map(|i| a[i][i]).fold(f64::INFINITY, f64::min).sqrt()
}

/// Postures along the path, from the goal back to the start, each near the goal posture.
fn postures_along_the_path(kinematics: &mut Kinematics) -> Vec<[f64; 7]> {
    let path = side_grasp_path();
    (0..=STATIONS)
        .map(|i| {
            let time = path.duration() * (STATIONS - i) as f64 / STATIONS as f64;
            kinematics.inverse(&path.pose(time), &DEMONSTRATION_GOAL).expect("every pose of the path is reachable")
        })
        .collect()
}

#[test]
fn the_demonstration_postures_reach_the_ends_of_the_path() {
    let mut kinematics = kinematics();
    let path = side_grasp_path();
    // The way the constants were found: a posture for the goal, then for the start as near to it as possible.
    let goal = kinematics.inverse(&path.goal(), &DEMONSTRATION_GOAL).expect("the goal is reachable");
    let start = kinematics.inverse(&path.start(), &DEMONSTRATION_GOAL).expect("the start is reachable");
    println!("goal {goal:.4?}\nstart {start:.4?}");
    for (constant, pose) in [(DEMONSTRATION_START, path.start()), (DEMONSTRATION_GOAL, path.goal())] {
        let (distance, turn) = apart(&kinematics.grasp_pose(&constant), &pose);
        assert!(distance < 2e-4 && turn < 2e-4, "{constant:?} misses by {distance} m, {turn} rad");
    }
    for (found, constant) in [(goal, DEMONSTRATION_GOAL), (start, DEMONSTRATION_START)] {
        for i in 0..7 {
            assert!((found[i] - constant[i]).abs() < 1e-3, "{found:?} is not {constant:?}");
        }
    }
}

#[test]
fn the_path_is_a_real_movement_in_position_and_about_several_axes() {
    let path = side_grasp_path();
    assert!((0.35..0.45).contains(&path.length()), "{} m", path.length());
    assert!((6.0..=8.0).contains(&path.duration()));
    let (_, turn) = apart(&path.start(), &path.goal());
    assert!((30.0..60.0).contains(&turn.to_degrees()), "{} degrees", turn.to_degrees());
    // Start and goal differ by a turn with a share about each axis of the hand.
    let (a, b) = (path.goal().quaternion, path.start().quaternion);
    let vector = [
        a[0] * b[1] - a[1] * b[0] - a[2] * b[3] + a[3] * b[2],
        a[0] * b[2] + a[1] * b[3] - a[2] * b[0] - a[3] * b[1],
        a[0] * b[3] - a[1] * b[2] + a[2] * b[1] - a[3] * b[0],
    ];
    for x in vector {
        assert!(2.0 * x.abs() > 0.2, "the turn {vector:?} is about two axes only");
    }
    // At rest at the ends, continuous between: no step longer than the peak speed of the minimum jerk allows.
    for i in 0..700 {
        let (distance, turn) = apart(&path.pose(f64::from(i) * 0.01), &path.pose(f64::from(i + 1) * 0.01));
        assert!(distance < 0.002 && turn < 0.005, "jumps by {distance} m, {turn} rad at {i}");
    }
    assert!(apart(&path.pose(-1.0), &path.start()).0 == 0.0 && apart(&path.pose(9.0), &path.goal()).0 < 1e-12);
}

#[test]
fn the_path_keeps_away_from_singularities_stops_and_obstacles() {
    let mut kinematics = kinematics();
    let ranges = kinematics.joint_ranges();
    for q in postures_along_the_path(&mut kinematics) {
        let singular = smallest_singular_value(&kinematics.jacobian(&q));
        assert!(singular >= 0.12, "smallest singular value {singular} at {q:?}");
        assert!(margin(&q, &ranges) >= 0.25, "{} rad from a stop at {q:?}", margin(&q, &ranges));
        assert_eq!(kinematics.robot_contacts(&q), 0, "the arm touches something at {q:?}");
    }
}

#[test]
fn the_straight_way_from_home_to_the_start_touches_nothing() {
    let mut kinematics = kinematics();
    for i in 0..=400 {
        let share = f64::from(i) / 400.0;
        let q: [f64; 7] = std::array::from_fn(|j| HOME[j] + share * (DEMONSTRATION_START[j] - HOME[j]));
        assert_eq!(kinematics.robot_contacts(&q), 0, "the arm touches something at {q:?}");
    }
}

/// Record of a demonstration.
#[derive(Debug)]
struct Demonstration {
    distance: f64,
    turn: f64,
    tilt: f64,
    moved: f64,
    contacts: usize,
    margin: f64,
    force: f64,
    torque: f64,
    singular: f64,
    departure: f64,
    speed: f64,
    end: [f64; 7],
    seconds: f64,
}

/// Guides the arm along the path under ideal gravity compensation.
fn demonstrate(seed: u64) -> Demonstration {
    let options = MujocoOptions { posture: DEMONSTRATION_START, ..MujocoOptions::default() };
    let world = MujocoWorld::new(&options).expect("the scene loads");
    let flashlight = world.object_pose().expect("a torch").position;
    let teacher = Teacher::new(TeacherConfig { seed, ..TeacherConfig::default() }, side_grasp_path());
    let mut guided = GuidedWorld::new(world, teacher);
    let mut mechanism = kinematics();
    let ranges = mechanism.joint_ranges();
    guided.teacher_mut().begin();
    let mut d = Demonstration {
        distance: 0.0,
        turn: 0.0,
        tilt: 0.0,
        moved: 0.0,
        contacts: 0,
        margin: f64::INFINITY,
        force: 0.0,
        torque: 0.0,
        singular: f64::INFINITY,
        departure: 0.0,
        speed: 0.0,
        end: [0.0; 7],
        seconds: 0.0,
    };
    let mut steps = 0_u32;
    while guided.teacher().stage() != Stage::Done {
        // What the teacher is about to pull: the same teacher, one step ahead of the world.
        let (force, torque) = guided.teacher().clone().pull(&guided.grasp_pose());
        let length = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
        d.force = d.force.max(length(force));
        d.torque = d.torque.max(length(torque));
        let bias = guided.world().bias_torques();
        guided.step(&bias);
        steps += 1;
        d.tilt = d.tilt.max(guided.world().object_tilt().expect("a torch").to_degrees());
        d.contacts += guided.world().robot_contacts();
        let q = guided.joint_positions();
        d.margin = d.margin.min(margin(&q, &ranges));
        d.speed = guided.joint_velocities().iter().fold(d.speed, |a, x| a.max(x.abs()));
        if steps.is_multiple_of(180) {
            d.singular = d.singular.min(smallest_singular_value(&mechanism.jacobian(&q)));
            let time = f64::from(steps) * STEP_SECONDS - 1.5;
            d.departure = d.departure.max(apart(&guided.grasp_pose(), &side_grasp_path().pose(time)).0);
        }
        assert!(steps < 40_000, "the teacher never lets go");
    }
    let (distance, turn) = apart(&guided.grasp_pose(), &side_grasp_path().goal());
    (d.distance, d.turn) = (distance, turn.to_degrees());
    let moved = guided.world().object_pose().expect("a torch").position;
    d.moved = (moved[0] - flashlight[0]).hypot(moved[1] - flashlight[1]);
    d.end = guided.joint_positions();
    d.seconds = f64::from(steps) * STEP_SECONDS;
    assert_eq!(guided.world().warnings(), 0);
    d
}

#[test]
fn the_teacher_guides_the_arm_to_the_grasp_under_gravity_compensation() {
    for seed in 0..5 {
        let d = demonstrate(seed);
        println!("{seed} {d:.4?}");
        assert!(d.distance < 0.015 && d.turn < 5.0, "{d:?}");
        assert!(d.tilt < 2.0 && d.moved < 0.002 && d.contacts == 0, "{d:?}");
        assert!(d.margin > 0.2 && d.singular > 0.12, "{d:?}");
        assert!(d.force <= 30.0 && d.torque <= 5.0, "{d:?}");
        assert!(d.speed < 1.0 && d.departure < 0.05, "{d:?}");
        assert!(d.seconds < 12.0, "{d:?}");
    }
}

#[test]
fn the_same_seed_gives_the_same_demonstration_to_the_bit_and_another_seed_another() {
    let end = |seed| demonstrate(seed).end.map(f64::to_bits);
    assert_eq!(end(3), end(3));
    assert_ne!(end(3), end(4));
}

#[test]
fn a_teacher_who_was_not_told_to_begin_does_not_touch_the_arm() {
    let mut teacher = Teacher::new(TeacherConfig::default(), side_grasp_path());
    let hand = side_grasp_path().goal();
    for _ in 0..100 {
        assert_eq!(teacher.pull(&hand), ([0.0; 3], [0.0; 3]));
    }
    assert_eq!(teacher.stage(), Stage::Watching);
}

#[test]
fn the_teacher_pulls_harder_at_what_stays_wrong_but_only_after_their_reaction_time() {
    let config = TeacherConfig {
        tremor_force: 0.0,
        tremor_torque: 0.0,
        drift: 0.0,
        rotation_drift: 0.0,
        ..TeacherConfig::default()
    };
    // The moment the hand is firmly held; from then on it follows the path, but 5 mm too low.
    let taken = config.pause + 0.5;
    let spring = config.stiffness * 0.005;
    let mut teacher = Teacher::new(config, side_grasp_path());
    teacher.begin();
    let mut pulls = Vec::new();
    for step in 0..6000 {
        let time = f64::from(step) * STEP_SECONDS - taken;
        let mut hand = side_grasp_path().pose(time);
        hand.position[2] -= if time > 0.0 { 0.005 } else { 0.0 };
        let (force, _) = teacher.pull(&hand);
        if time > 0.0 {
            pulls.push(force[2]);
        }
    }
    // 0.05 s to forget the jump of 5 mm in the filtered speed; the reaction time is 0.2 s.
    let at = |seconds: f64| pulls[(seconds / STEP_SECONDS) as usize];
    assert!((at(0.1) - spring).abs() < 0.05 && (at(0.19) - spring).abs() < 0.05, "{} {}", at(0.1), at(0.19));
    assert!(at(1.5) > 1.5 * spring, "{} N after 1.5 s", at(1.5));
}

#[test]
fn the_teacher_pulls_towards_the_path_and_never_beyond_their_strength() {
    let config =
        TeacherConfig { tremor_force: 0.0, tremor_torque: 0.0, drift: 0.0, rotation_drift: 0.0, ..Default::default() };
    let mut teacher = Teacher::new(config, side_grasp_path());
    teacher.begin();
    // The hand is held back 20 cm below the start and turned by 1 rad about the vertical.
    let start = side_grasp_path().start();
    let mut hand = start;
    hand.position[2] -= 0.2;
    let (s, c) = 0.5_f64.sin_cos();
    let q = start.quaternion;
    hand.quaternion = [c * q[0] - s * q[3], c * q[1] - s * q[2], c * q[2] + s * q[1], c * q[3] + s * q[0]];
    let mut last = ([0.0; 3], [0.0; 3]);
    for _ in 0..2600 {
        last = teacher.pull(&hand);
        let length = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
        assert!(length(last.0) <= 30.0 + 1e-9 && length(last.1) <= 5.0 + 1e-9);
    }
    assert!(last.0[2] > 29.0, "pulls up with {:?}", last.0);
    assert!(last.1[2] < -4.5, "turns back with {:?}", last.1);
}
