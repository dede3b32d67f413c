//! A small pure-Rust world: the WAM as rigid bodies, with nothing to touch.
//!
//! For unit tests and for runs without MuJoCo. **True**: kinematics, mass matrix, Coriolis torques and gravity of every
//! link and of the hand with its fingers half closed, the torque of a push at the grasp point, viscous and dry friction
//! of coupled joints, sticking included, inelastic joint stops. **Simplified**: cables are rigid; the hand is rigid,
//! what it holds is a point, and the wrist wrench is quasi-static: the sensor does not feel the inertia of the hand.
//! There is nothing to touch but springs in the way of the fingers ([`FingerObstacle`]), whose links are where their
//! drives hold them otherwise, without inertia.

use super::rigid_bodies::{Body, Dynamics};
use super::{ARM_STREAM, HandState, HandTargets, Held, Pose, World};
use crate::Noise;
use crate::chain::{self, Frame, Vector, add, dot, subtract};
use crate::rotation::cross;
use crate::time::STEP_SECONDS;

/// Gravity, m/s^2, world frame (the value of the golden vectors).
const GRAVITY: Vector = [0.0, 0.0, -9.81];

/// Mass (kg), centre of mass in frame j (m) and inertia about it (kg m^2) of each link, `wam7.toml` `[[arm.link]]`.
const LINKS: [(f64, Vector, [f64; 6]); 7] = [
    (10.7677, [-0.00443, 0.12189, -0.00066], [0.13488033, 0.11328369, 0.0904633, 0.00213041, 0.00012485, -0.00068555]),
    (3.8749, [-0.00237, 0.03106, 0.01542], [0.02140958, 0.01377875, 0.01558906, -0.00027172, -2.461e-05, 0.0018192]),
    (1.8023, [-0.03826, 0.20751, 3e-05], [0.05911077, 0.0032455, 0.05927043, 0.00249612, -7.38e-06, 1.767e-05]),
    (
        2.17266212,
        [0.00553408, 6.822e-05, 0.11927695],
        [0.01067491, 0.01058659, 0.00282036, -4.503e-05, 0.00135557, 0.00011002],
    ),
    (0.35655692, [5.483e-05, 0.02886286, 0.00148493], [0.00037112, 0.00019434, 0.00038209, 8e-08, 3e-08, 1.613e-05]),
    (
        0.40915886,
        [-5.923e-05, -0.01686123, 0.02419052],
        [0.00054889, 0.00023846, 0.00045133, -1.9e-07, 1e-07, 4.43e-05],
    ),
    (0.0754827, [0.00014836, 7.252e-05, -0.00335185], [3.911e-05, 3.877e-05, 7.614e-05, -1.9e-07, 0.0, 0.0]),
];

/// Force/torque sensor and hand together: mass (kg), centre of mass in frame 7 (m), `[payload.wam7_bh280_ft]`.
const PAYLOAD: (f64, Vector) = (1.337308, [-6.029705722242e-05, -0.009027260457134806, 0.0673508537777823]);

/// Its inertia about that centre, axes of frame 7, kg m^2.
const PAYLOAD_INERTIA: [f64; 6] = [
    0.004898018820238933,
    0.0033387995622981836,
    0.002820807058958497,
    -8.633785350111146e-06,
    8.561979507244731e-07,
    0.0004391319639121204,
];

/// Load of the sensor: the hand alone, mass (kg), centre of mass in frame 7 (m) = hand frame turned by pi, 12 mm out.
const HAND: (f64, Vector) = (1.201308, [-6.71232831213989e-05, -0.010049236022244114, 0.074296379915774]);

/// Where the sensor measures, frame 7, m (`[ft_sensor] origin_in_frame7`); its axes are those of frame 7.
const SENSOR_ORIGIN: Vector = [0.0, 0.0, 0.006];

/// Rotor inertia reflected to the joints, kg m^2 (`reflected_diag`), and the pair of J5 and J6 that one pair of motors
/// turns (`reflected_j5_j6`).
const ROTORS: [f64; 7] =
    [0.20517084, 0.18883754875, 0.066906917344, 0.03462264, 0.003227287, 0.003227287, 0.000316524958];
const ROTORS_J5_J6: f64 = 5.6454e-05;

/// Viscous friction, N m s/rad, `[arm.friction]`.
const VISCOUS: [f64; 7] = [1.27163, 1.15061, 0.407672, 0.233564, 0.0159914, 0.0159914, 0.00267989];
/// Coulomb friction, N m, `[arm.friction]` (an estimate there).
const COULOMB: [f64; 7] = [1.5, 2.0, 1.0, 0.8, 0.2, 0.2, 0.1];

/// Stop of the folded elbow, rad: two decimals in the model file, not the circle's constant.
const ELBOW_STOP: f64 = 314.0 / 100.0;

/// Joint stops, rad, `q_min` and `q_max`.
const STOPS: [(f64, f64); 7] =
    [(-2.6, 2.6), (-2.0, 2.0), (-2.8, 2.8), (-0.9, ELBOW_STOP), (-4.76, 1.24), (-1.57, 1.57), (-3.0, 3.0)];

/// The WAM's home, rad (`[arm] home`): on the stop of joint 2, elbow folded.
pub const HOME: [f64; 7] = [0.0, -2.0, 0.0, 3.13, 0.0, 0.0, 0.0];

/// Springs in the way of one finger: beyond an angle the link stays behind its drive, and the drive feels the spring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FingerObstacle {
    /// Angle at which the inner link touches, rad; infinite for nothing in its way.
    pub inner: f64,
    /// Angle at which the outer link touches, rad relative to the inner link; infinite for nothing in its way.
    pub outer: f64,
    /// Stiffness at either link, N m per rad by which the drive is beyond the link.
    pub stiffness: f64,
}

impl FingerObstacle {
    /// Nothing in the way.
    pub const NOTHING: Self = Self { inner: f64::INFINITY, outer: f64::INFINITY, stiffness: 0.0 };
}

/// The WAM as rigid bodies in free space.
#[derive(Clone, Debug)]
pub struct FreeJoints {
    q: [f64; 7],
    dq: [f64; 7],
    gravity: Vector,
    coulomb: [f64; 7],
    /// Factors on the masses of links 1 to 7, and of the hand.
    weights: ([f64; 7], f64),
    held: Option<Held>,
    push_force: Vector,
    push_torque: Vector,
    hand: HandTargets,
    obstacles: [FingerObstacle; 3],
    spread_push: f64,
}

impl FreeJoints {
    /// The arm at rest at `q` (rad; brought inside the joint stops), with gravity and friction.
    #[must_use]
    pub fn new(q: [f64; 7]) -> Self {
        let inside = std::array::from_fn(|joint| q[joint].clamp(STOPS[joint].0, STOPS[joint].1));
        Self {
            q: inside,
            dq: [0.0; 7],
            gravity: GRAVITY,
            coulomb: COULOMB,
            weights: ([1.0; 7], 1.0),
            held: None,
            push_force: [0.0; 3],
            push_torque: [0.0; 3],
            hand: HandTargets::default(),
            obstacles: [FingerObstacle::NOTHING; 3],
            spread_push: 0.0,
        }
    }

    /// The same arm with other masses and friction: factors on the masses of links 1 to 7 and of the hand, whose
    /// centres stay, and on the Coulomb friction of the joints.
    #[must_use]
    pub fn with_factors(self, links: [f64; 7], hand: f64, friction: [f64; 7]) -> Self {
        let coulomb = std::array::from_fn(|joint| self.coulomb[joint] * friction[joint]);
        Self { weights: (links, hand), coulomb, ..self }
    }

    /// The arm of this number: masses and friction as those of `Imperfections::drawn` in the MuJoCo world.
    #[must_use]
    pub fn drawn(self, number: u64) -> Self {
        let mut noise = Noise::new(number, ARM_STREAM);
        let mut around = |share: f64| noise.uniform(1.0 - share, 1.0 + share);
        let links = std::array::from_fn(|_| around(0.1));
        let hand = around(0.03);
        let friction = std::array::from_fn(|_| around(0.3));
        self.with_factors(links, hand, friction)
    }

    /// The same arm with this weight in its hand, a point.
    #[must_use]
    pub fn with_held(self, held: Option<Held>) -> Self {
        Self { held, ..self }
    }

    /// Mass (kg) of what is held, and its centre in frame 7 (m).
    fn held_body(&self) -> (f64, Vector) {
        self.held.map_or((0.0, SENSOR_ORIGIN), |held| (held.mass(), add(SENSOR_ORIGIN, held.centre())))
    }

    /// Torques that hold the arm still where it is, without friction, N m.
    #[must_use]
    pub fn holding_torques(&self) -> [f64; 7] {
        self.external_torques(&chain::frames(&self.q)).map(|torque| -torque)
    }

    /// The same arm with the links of its hand here; the drives hold them.
    #[must_use]
    pub fn with_hand(self, hand: HandTargets) -> Self {
        Self { hand, ..self }
    }

    /// Puts a spring in the way of finger `finger` (0..=2), or takes it away ([`FingerObstacle::NOTHING`]); other
    /// numbers do nothing.
    pub fn obstruct(&mut self, finger: usize, obstacle: FingerObstacle) {
        if let Some(place) = self.obstacles.get_mut(finger) {
            *place = obstacle;
        }
    }

    /// The arm at rest without gravity and without Coulomb friction: every torque shows at once.
    #[must_use]
    pub fn weightless(q: [f64; 7]) -> Self {
        Self { gravity: [0.0; 3], coulomb: [0.0; 7], ..Self::new(q) }
    }

    /// Sets the torque with which something pushes the fingers towards larger spread, N m.
    pub fn push_spread(&mut self, torque: f64) {
        self.spread_push = torque;
    }

    /// The equation of motion where the arm is; a body whose mass is another keeps its shape.
    fn dynamics(&self, frames: &[Frame; 8]) -> Dynamics {
        let (links, hand) = self.weights;
        let held = self.held_body();
        let bodies: [Body; 10] = std::array::from_fn(|part| match LINKS.get(part) {
            Some((mass, centre, inertia)) => Body {
                link: part,
                mass: mass * links[part],
                centre: *centre,
                inertia: inertia.map(|entry| entry * links[part]),
            },
            None if part == LINKS.len() => {
                Body { link: 6, mass: PAYLOAD.0, centre: PAYLOAD.1, inertia: PAYLOAD_INERTIA }
            }
            None if part == LINKS.len() + 1 => {
                Body { link: 6, mass: HAND.0 * (hand - 1.0), centre: HAND.1, inertia: [0.0; 6] }
            }
            None => Body { link: 6, mass: held.0, centre: held.1, inertia: [0.0; 6] },
        });
        let mut dynamics = Dynamics::of(&bodies, frames, &self.dq);
        for (joint, rotor) in ROTORS.into_iter().enumerate() {
            dynamics.mass[joint][joint] += rotor;
        }
        dynamics.mass[4][5] += ROTORS_J5_J6;
        dynamics.mass[5][4] += ROTORS_J5_J6;
        dynamics
    }

    /// Torque of gravity and of the push on each joint, N m, by the principle of virtual work.
    fn external_torques(&self, frames: &[Frame; 8]) -> [f64; 7] {
        let weight = |mass: f64| self.gravity.map(|g| g * mass);
        let (links, hand) = self.weights;
        let held = self.held_body();
        // Seven links, then sensor and hand, what the hand weighs more, what it holds, and the push: which link it acts
        // on, where, and the force.
        let forces: [(usize, Vector, Vector); 11] = std::array::from_fn(|part| match LINKS.get(part) {
            Some((mass, centre, _)) => (part, frames[part + 1].point(*centre), weight(*mass * links[part])),
            None if part == LINKS.len() => (6, frames[7].point(PAYLOAD.1), weight(PAYLOAD.0)),
            None if part == LINKS.len() + 1 => (6, frames[7].point(HAND.1), weight(HAND.0 * (hand - 1.0))),
            None if part == LINKS.len() + 2 => (6, frames[7].point(held.1), weight(held.0)),
            None => (6, chain::grasp_frame(&frames[7]).origin, self.push_force),
        });
        std::array::from_fn(|joint| {
            let (axis, origin) = (frames[joint].axes[2], frames[joint].origin);
            let moments = forces
                .iter()
                .filter(|(link, _, _)| *link >= joint)
                .map(|(_, point, force)| dot(axis, cross(subtract(*point, origin), *force)));
            moments.sum::<f64>() + dot(axis, self.push_torque)
        })
    }
}

impl World for FreeJoints {
    fn joint_positions(&self) -> [f64; 7] {
        self.q
    }

    fn joint_velocities(&self) -> [f64; 7] {
        self.dq
    }

    fn step(&mut self, torques: &[f64; 7]) {
        let frames = chain::frames(&self.q);
        let external = self.external_torques(&frames);
        let applied = std::array::from_fn(|joint| torques[joint] + external[joint]);
        let bounds = std::array::from_fn(|joint| {
            let (low, high) = STOPS[joint];
            ((low - self.q[joint]) / STEP_SECONDS, (high - self.q[joint]) / STEP_SECONDS)
        });
        let dynamics = self.dynamics(&frames);
        let speeds = dynamics.step(&self.dq, &applied, (&VISCOUS, &self.coulomb), &bounds);
        for joint in 0..7 {
            let (slowest, fastest) = bounds[joint];
            // Stops are inelastic: the joint rests against them until a torque takes it away.
            let stopped = speeds[joint] <= slowest || speeds[joint] >= fastest;
            let position = self.q[joint] + STEP_SECONDS * speeds[joint];
            self.q[joint] = position.clamp(STOPS[joint].0, STOPS[joint].1);
            self.dq[joint] = if stopped { 0.0 } else { speeds[joint] };
        }
    }

    fn wrist_wrench(&self) -> [f64; 6] {
        let plate = chain::frames(&self.q)[7];
        let sensor = plate.point(SENSOR_ORIGIN);
        let (held, held_centre) = self.held_body();
        let weight = self.gravity.map(|g| g * HAND.0 * self.weights.1);
        let held_weight = self.gravity.map(|g| g * held);
        let force = add(add(weight, held_weight), self.push_force);
        let moments = [
            cross(subtract(plate.point(HAND.1), sensor), weight),
            cross(subtract(plate.point(held_centre), sensor), held_weight),
            cross(subtract(chain::grasp_frame(&plate).origin, sensor), self.push_force),
            self.push_torque,
        ];
        let torque = moments.into_iter().fold([0.0; 3], add);
        let ([fx, fy, fz], [tx, ty, tz]) = (plate.turn_back(force), plate.turn_back(torque));
        [fx, fy, fz, tx, ty, tz]
    }

    fn grasp_pose(&self) -> Pose {
        let grasp = chain::grasp_frame(&chain::frames(&self.q)[7]);
        Pose { position: grasp.origin, quaternion: grasp.quaternion() }
    }

    fn push(&mut self, force: [f64; 3], torque: [f64; 3]) {
        self.push_force = force;
        self.push_torque = torque;
    }

    fn hand(&self) -> HandState {
        let mut state = HandState { spread: self.hand.spread, spread_load: -self.spread_push, ..HandState::default() };
        for (finger, obstacle) in self.obstacles.iter().enumerate() {
            let (inner, outer) = (self.hand.inner[finger], self.hand.outer[finger]);
            state.inner[finger] = inner.min(obstacle.inner);
            state.outer[finger] = outer.min(obstacle.outer);
            state.inner_load[finger] = obstacle.stiffness * (inner - state.inner[finger]);
            state.outer_load[finger] = obstacle.stiffness * (outer - state.outer[finger]);
        }
        state
    }

    fn drive_hand(&mut self, targets: &HandTargets) {
        self.hand = *targets;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn golden_rows() -> Vec<(Vec<String>, Vec<f64>)> {
        let text = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/vectors/dyn_wam7_bh280_ft.csv"));
        let mut lines = text.lines().filter(|line| !line.starts_with('#'));
        let names: Vec<String> = lines.next().unwrap().split(',').map(String::from).collect();
        let numbers = |line: &str| line.split(',').map(|value| value.parse().unwrap()).collect();
        lines.map(|line| (names.clone(), numbers(line))).collect()
    }

    fn column(row: &(Vec<String>, Vec<f64>), name: &str) -> f64 {
        row.1[row.0.iter().position(|other| other == name).unwrap()]
    }

    #[test]
    fn gravity_pulls_with_the_golden_torque() {
        for row in golden_rows() {
            let q = std::array::from_fn(|joint| column(&row, &format!("q{}", joint + 1)));
            let torques = FreeJoints::new(HOME).external_torques(&chain::frames(&q));
            for (joint, torque) in torques.iter().enumerate() {
                // g is what holds the arm; gravity pulls the other way.
                let held = column(&row, &format!("g{}", joint + 1));
                assert!((torque + held).abs() < 1e-9, "joint {joint}: {torque} and {held}");
            }
        }
    }

    /// The change that makes it fail: no inertia of a link, one of its masses elsewhere, no Coriolis torque.
    #[test]
    fn mass_matrix_and_velocity_torques_are_the_golden_ones() {
        let near = |value: f64, golden: f64| (value - golden).abs() < 1e-8 * golden.abs().max(1.0);
        for row in golden_rows() {
            let state = |name: &str| std::array::from_fn(|joint| column(&row, &format!("{name}{}", joint + 1)));
            let (q, dq): ([f64; 7], [f64; 7]) = (state("q"), state("qd"));
            let world = FreeJoints { q, dq, ..FreeJoints::new(HOME) };
            let dynamics = world.dynamics(&chain::frames(&q));
            for (a, reflected) in ROTORS.into_iter().enumerate() {
                let velocity = column(&row, &format!("c{}", a + 1));
                assert!(near(dynamics.velocity[a], velocity), "J{}: {} and {velocity}", a + 1, dynamics.velocity[a]);
                for b in 0..7 {
                    let rotor = if a == b { reflected } else { 0.0 };
                    let pair = if (a, b) == (4, 5) || (a, b) == (5, 4) { ROTORS_J5_J6 } else { 0.0 };
                    let links = dynamics.mass[a][b] - rotor - pair;
                    let golden = column(&row, &format!("M{}{}", a + 1, b + 1));
                    assert!(near(links, golden), "M{}{}: {links} and {golden}", a + 1, b + 1);
                }
            }
        }
    }

    /// The change that makes it fail: the torques of the velocities are left out, or have the wrong sign.
    #[test]
    fn an_arm_that_swings_freely_keeps_its_energy() {
        let mut world = FreeJoints { dq: [1.0, -0.8, 0.6, 1.2, -2.0, 1.5, 3.0], ..FreeJoints::weightless([0.0; 7]) };
        let mut rubbed = 0.0;
        let energy = |world: &FreeJoints| {
            let mass = world.dynamics(&chain::frames(&world.q)).mass;
            (0..7).map(|a| (0..7).map(|b| 0.5 * mass[a][b] * world.dq[a] * world.dq[b]).sum::<f64>()).sum::<f64>()
        };
        let first = energy(&world);
        for _ in 0..360 {
            let before = world.dq;
            world.step(&[0.0; 7]);
            rubbed += (0..7).map(|j| STEP_SECONDS * VISCOUS[j] * before[j] * world.dq[j]).sum::<f64>();
        }
        let last = energy(&world);
        assert!((last + rubbed - first).abs() < 0.01 * first && rubbed > 0.1 * first, "{first} {last} {rubbed}");
    }

    #[test]
    fn friction_holds_a_joint_until_the_torque_exceeds_it() {
        let turned = |torque: f64| {
            let mut world = FreeJoints { gravity: [0.0; 3], ..FreeJoints::new([0.0; 7]) };
            for _ in 0..1000 {
                world.step(&[torque, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
            }
            world.q[0]
        };
        assert_eq!(turned(1.49), 0.0);
        assert_eq!(turned(-1.49), 0.0);
        assert!(turned(1.6) > 0.001 && turned(-1.6) < -0.001);
    }

    #[test]
    fn a_joint_stops_at_its_stop_and_comes_away_again() {
        let mut world = FreeJoints::weightless([0.0; 7]);
        for _ in 0..3000 {
            world.step(&[40.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        }
        assert_eq!((world.q[0], world.dq[0]), (STOPS[0].1, 0.0));
        for _ in 0..100 {
            world.step(&[-40.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        }
        assert!(world.q[0] < STOPS[0].1);
    }

    #[test]
    fn a_push_turns_the_base_the_way_the_hand_is_pushed() {
        // Arm stretched out along x: a push along +y turns joint 1 to the left, that is positive about z.
        let mut q = [0.0; 7];
        q[1] = std::f64::consts::FRAC_PI_2;
        let mut world = FreeJoints::weightless(q);
        assert!(world.grasp_pose().position[0] > 1.0);
        world.push([0.0, 20.0, 0.0], [0.0; 3]);
        for _ in 0..100 {
            world.step(&[0.0; 7]);
        }
        assert!(world.dq[0] > 0.1, "{}", world.dq[0]);
    }

    #[test]
    fn a_held_weight_is_carried_by_joints_and_sensor_alike() {
        let q = [0.3, 0.6, -0.4, 1.2, 0.5, -0.7, 0.9];
        let (empty, held) = (FreeJoints::new(q), "0.5@0.02:-0.01:0.15".parse().ok());
        let full = empty.clone().with_held(held);
        let plate = chain::frames(&q)[7];
        let place = plate.point([0.02, -0.01, 0.156]);
        let weight = [0.0, 0.0, -0.5 * 9.81];
        // The same weight as a push at the grasp point, with the moment that moves it there.
        let mut pushed = empty.clone();
        pushed.push(weight, cross(subtract(place, chain::grasp_frame(&plate).origin), weight));
        for (a, b) in full.holding_torques().iter().zip(pushed.holding_torques()) {
            assert!((a - b).abs() < 1e-9, "{a} and {b}");
        }
        for (a, b) in full.wrist_wrench().iter().zip(pushed.wrist_wrench()) {
            assert!((a - b).abs() < 1e-9, "{a} and {b}");
        }
    }

    #[test]
    fn the_sensor_feels_weight_downwards_and_its_moment_about_the_sensor() {
        // Arm straight up: the sensor's z is the world's; the weight pulls along -z and has no lever but the hand's
        // offset.
        let wrench = FreeJoints::new([0.0; 7]).wrist_wrench();
        assert!((wrench[2] + HAND.0 * 9.81).abs() < 1e-9);
        assert!((wrench[3] - HAND.1[1] * wrench[2]).abs() < 1e-9);
        assert!((wrench[4] + HAND.1[0] * wrench[2]).abs() < 1e-9);
    }
}
