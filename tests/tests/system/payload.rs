//! The payload of an arm, measured by the whole system on arms with cables and friction of their own, against physics.
//!
//! `TACTUS_TEST_ARMS=201:210` measures these arms instead of the two of every test run, and prints a line for each.

use control::Payload;
use control::model::WeightCorrection;
use lab::load::{Body, Extra, Load, POSTURES, measure};
use lab::procedure;
use lab::weigh::PASS_SECONDS;
use sim::World;
use sim::world::mujoco::{Imperfections, MujocoOptions, MujocoWorld, Scene};
use system_tests::{expect, ready, simulation};

/// The weight that is held, beside the middle of the hand.
const HELD: &str = "0.5@0.02:-0.015:0.15";

/// Largest errors of the sensor's figures: share of the mass, and m.
const BAR: (f64, f64) = (0.02, 0.004);

/// Largest errors of what the joints tell was taken up: share of the mass, and m.
const JOINTS_BAR: (f64, f64) = (0.05, 0.01);

/// Steps of physics after which nothing moves any more: half a second.
const SETTLING_STEPS: usize = 900;

fn arms() -> Vec<u64> {
    let text = std::env::var("TACTUS_TEST_ARMS").unwrap_or_else(|_| "11:12".to_owned());
    let (first, last) = text.split_once(':').expect("TACTUS_TEST_ARMS=FIRST:LAST");
    (first.parse().expect("a number")..=last.parse().expect("a number")).collect()
}

/// All that hangs on the sensor of an arm with an empty hand whose inner links stand at `fingers` (rad), from the
/// forces that physics has there at rest.
fn hanging(arm: u64, fingers: f64) -> Body {
    let at_rest = |posture: [f32; 7]| {
        let options = MujocoOptions {
            posture: posture.map(f64::from),
            scene: Scene::NOTHING,
            fingers,
            imperfections: Imperfections { cables: None, ..Imperfections::drawn(arm) },
            ..MujocoOptions::default()
        };
        let mut world = expect(MujocoWorld::new(&options));
        // The fingers sink into their drives first.
        for _ in 0..SETTLING_STEPS {
            let torques = world.bias_torques();
            world.step(&torques);
        }
        world.wrist_wrench()
    };
    let force = at_rest(POSTURES[0]);
    let weight = (force[0].powi(2) + force[1].powi(2) + force[2].powi(2)).sqrt();
    let wrenches: Vec<[f64; 6]> = POSTURES.iter().map(|posture| at_rest(*posture)).collect();
    Body { mass: weight / 9.81, centre: centre(&wrenches) }
}

/// The place about which these wrenches have no moment: torque = place x force, by least squares.
fn centre(wrenches: &[[f64; 6]]) -> [f64; 3] {
    let (mut normal, mut right) = ([[0.0; 3]; 3], [0.0; 3]);
    for [x, y, z, tx, ty, tz] in wrenches {
        let rows = [([0.0, *z, -*y], tx), ([-*z, 0.0, *x], ty), ([*y, -*x, 0.0], tz)];
        for (row, torque) in rows {
            for i in 0..3 {
                right[i] += row[i] * torque;
                (0..3).for_each(|j| normal[i][j] += row[i] * row[j]);
            }
        }
    }
    // Cramer's rule.
    let determinant = |m: &[[f64; 3]; 3]| {
        m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
            + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
    };
    std::array::from_fn(|column| {
        let mut replaced = normal;
        (0..3).for_each(|row| replaced[row][column] = right[row]);
        determinant(&replaced) / determinant(&normal)
    })
}

/// The load, and where the inner links of the fingers stood, rad.
fn measured(address: &str) -> (Load, f64) {
    let mut arm = ready(address);
    let weight = expect(procedure::weight_in_use(&mut arm));
    assert_eq!(weight, WeightCorrection::none(Payload::SensorAndHand), "an arm that was never weighed");
    let crossings = expect(procedure::slide_postures(&mut arm, POSTURES, &[PASS_SECONDS], |_| {}));
    let fingers = simulation(arm.transport()).world().hand().inner[0];
    (expect(measure(&weight, &crossings)), fingers.max(0.0))
}

/// Share by which the mass is wrong, and distance of the centres, m.
fn error(told: Body, truth: &Body) -> (f64, f64) {
    let (mass, apart) = told.beside(truth);
    (mass / truth.mass, apart)
}

#[test]
fn hand_and_held_weight_are_told_within_two_per_cent_and_four_millimetres_by_arms_of_all_kinds() {
    let held = expect(HELD.parse::<sim::Held>());
    let held = Body { mass: held.mass(), centre: held.centre() };
    for arm in arms() {
        let (empty, fingers) = measured(&format!("sil:arm={arm}"));
        let (full, _) = measured(&format!("sil:arm={arm},held={HELD}"));
        for load in [&empty, &full] {
            expect(load.judge());
        }
        let hand = hanging(arm, fingers);
        let mut figures = vec![("hand", error(empty.sensor.hanging(), &hand), BAR)];
        let taken_up = |full: &Extra, empty: &Extra| full.beyond(empty).held().expect("half a kilogram");
        let [sensor, joints] =
            [(&full.sensor, &empty.sensor), (&full.joints, &empty.joints)].map(|(full, empty)| taken_up(full, empty));
        figures.push(("held", error(sensor, &held), BAR));
        figures.push(("held by the joints", error(joints, &held), JOINTS_BAR));
        let shown =
            figures.iter().map(|(of, (mass, apart), _)| format!("{of} {:+.2} % {:.2} mm", mass * 1e2, apart * 1e3));
        println!("arm {arm}: {}", shown.collect::<Vec<_>>().join(", "));
        println!(
            "  hand by the joints {:+.0} g +-{:.0}, {:.1} mm",
            (empty.joints.hanging().mass - hand.mass) * 1e3,
            empty.joints.mass_error * 1e3,
            empty.joints.hanging().beside(&hand).1 * 1e3
        );
        for (of, (mass, apart), bar) in figures {
            assert!(mass.abs() <= bar.0 && apart <= bar.1, "arm {arm}, {of}: {mass} of the mass, {apart} m");
        }
        // The joints of an arm that was never weighed know little, and how little.
        let (mass, _) = empty.joints.hanging().beside(&hand);
        assert!(mass.abs() < 3.0 * empty.joints.mass_error, "arm {arm}: {mass} kg, {empty:?}");
    }
}
