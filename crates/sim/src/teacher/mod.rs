//! The simulated teacher: takes the hand of the arm, guides it compliantly along a path, and lets go.
//!
//! The teacher holds only the hand, at the grasp point. The rest of the arm, the elbow above all, follows its own
//! dynamics under gravity compensation, as with a real teacher. The pull is
//!
//! `f = g(t) [k (x_aim - x) - d dx] + tremor`, shortened to the teacher's strength (the same for rotation),
//!
//! with `x_aim` the path plus slow drift plus a correction: what the teacher sees of the error, a reaction time late,
//! is integrated until it is gone. `g` fades in when the hand is taken and out when it is let go.

mod guided;
mod movement;
mod path;
mod tremor;

use crate::rotation::{add_scaled, difference, exponential, multiply, norm, shortened};
use crate::{Noise, Pose, STEP_SECONDS};
use std::collections::VecDeque;
use tremor::{Drift, Tremor};

pub use guided::GuidedWorld;
pub use movement::TaughtMovement;
pub use path::{GuidePath, side_grasp_path};

/// Joint posture in which the demonstration begins, rad: the grasp point is at the start of [`side_grasp_path`].
///
/// Found by `Kinematics::inverse` from the goal posture backwards along the path (the test
/// `the_demonstration_postures_reach_the_ends_of_the_path` repeats it).
/// The straight way in joint space from the home posture to here touches nothing.
pub const DEMONSTRATION_START: [f64; 7] = [-0.8713, 0.6359, 0.4817, 1.8822, -0.6786, -0.5848, -0.4608];

/// A joint posture that reaches the goal of [`side_grasp_path`], rad; the arm being redundant, a demonstration ends
/// near it.
pub const DEMONSTRATION_GOAL: [f64; 7] = [-0.5501, 1.1622, 0.7957, 1.7611, -0.6966, -0.8446, -0.3368];

/// Properties of the teacher.
#[derive(Clone, Debug)]
pub struct TeacherConfig {
    /// Seed of tremor and drift: the same seed, the same movements of the hand.
    pub seed: u64,
    /// Pause between [`Teacher::begin`] and taking the hand, s.
    pub pause: f64,
    /// Stiffness of the pull, N/m.
    pub stiffness: f64,
    /// Damping of the pull, N s/m.
    pub damping: f64,
    /// Strength: the longest force, N.
    pub force_limit: f64,
    /// Stiffness of the turning, N m/rad.
    pub rotation_stiffness: f64,
    /// Damping of the turning, N m s/rad.
    pub rotation_damping: f64,
    /// Strength: the longest torque, N m.
    pub torque_limit: f64,
    /// Tremor between 8 and 12 Hz, root mean square per axis, N.
    pub tremor_force: f64,
    /// Tremor between 8 and 12 Hz, root mean square per axis, N m.
    pub tremor_torque: f64,
    /// Slow wandering of the aim, root mean square per axis, m.
    pub drift: f64,
    /// Slow wandering of the aimed orientation, root mean square per axis, rad.
    pub rotation_drift: f64,
    /// Reaction time: how old what the teacher sees is, s.
    pub reaction_time: f64,
    /// Rate at which a seen error is corrected, 1/s.
    pub correction_rate: f64,
    /// Time for which the hand is held at the goal before it is let go, s.
    pub settle: f64,
}

impl Default for TeacherConfig {
    /// A careful adult: arm stiffness 450 N/m, at most 30 N and 5 N m, 0.7 N of tremor, 4 mm of drift.
    fn default() -> Self {
        Self {
            seed: 0,
            pause: 1.0,
            stiffness: 450.0,
            damping: 60.0,
            force_limit: 30.0,
            rotation_stiffness: 12.0,
            rotation_damping: 0.6,
            torque_limit: 5.0,
            tremor_force: 0.7,
            tremor_torque: 0.02,
            drift: 0.004,
            rotation_drift: 0.015,
            reaction_time: 0.2,
            correction_rate: 1.5,
            settle: 1.0,
        }
    }
}

/// Stage of the demonstration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Not touching the arm: [`Teacher::begin`] was not called yet.
    Watching,
    /// Has to begin, not touching the arm yet.
    Pausing,
    /// Takes the hand and holds it at the start.
    Taking,
    /// Guides the hand along the path.
    Guiding,
    /// Holds the hand at the goal.
    Settling,
    /// Lets go.
    Releasing,
    /// Not touching the arm any more.
    Done,
}

/// Stream of random numbers that no part of the plant uses, so that a plant and a teacher may share a seed.
const NOISE_STREAM: u64 = 0x7065_7273_6f6e;

/// Duration of taking the hand and of letting it go, s: no pull begins or ends with a jerk.
const GRIP_SECONDS: f64 = 0.5;

/// Time constant with which the teacher feels the speed of the hand, s.
const SPEED_FILTER_SECONDS: f64 = 0.005;

/// Errors smaller than this are not corrected, m: nobody sees a millimetre or two at arm's length.
const CARELESS_METRES: f64 = 0.002;

/// Turns smaller than this are not corrected, rad.
const CARELESS_RADIANS: f64 = 0.01;

/// Longest correction of the aim, m. It times the stiffness exceeds what static friction takes at the hand (about 5 N).
const CORRECTION_LIMIT: f64 = 0.05;

/// Longest correction of the aimed orientation, rad.
const ROTATION_CORRECTION_LIMIT: f64 = 0.3;

/// A teacher with a seed, a path to follow, and a memory of the last fraction of a second.
#[derive(Clone, Debug)]
pub struct Teacher {
    config: TeacherConfig,
    path: GuidePath,
    /// Time since `begin`, s; `None` while watching.
    time: Option<f64>,
    noise: Noise,
    tremor: [Tremor; 6],
    drift: [Drift; 6],
    last: Option<Pose>,
    speed: [[f64; 3]; 2],
    /// Errors (m, rad) of the path on their way through the reaction time.
    seen: VecDeque<[[f64; 3]; 2]>,
    correction: [[f64; 3]; 2],
}

impl Teacher {
    /// A teacher who watches until told to [`begin`](Self::begin).
    #[must_use]
    pub fn new(config: TeacherConfig, path: GuidePath) -> Self {
        let noise = Noise::new(config.seed, NOISE_STREAM);
        Self {
            config,
            path,
            time: None,
            noise,
            tremor: std::array::from_fn(|_| Tremor::new()),
            drift: std::array::from_fn(|_| Drift::default()),
            last: None,
            speed: [[0.0; 3]; 2],
            seen: VecDeque::new(),
            correction: [[0.0; 3]; 2],
        }
    }

    /// Tells the teacher to start: after the pause they take the hand. Does nothing once begun.
    pub fn begin(&mut self) {
        self.time.get_or_insert(0.0);
    }

    /// The path the teacher follows.
    #[must_use]
    pub fn path(&self) -> &GuidePath {
        &self.path
    }

    /// Stage of the demonstration.
    #[must_use]
    pub fn stage(&self) -> Stage {
        let Some(time) = self.time else {
            return Stage::Watching;
        };
        let taken = self.config.pause + GRIP_SECONDS;
        let arrived = taken + self.path.duration();
        let settled = arrived + self.config.settle;
        match time {
            t if t < self.config.pause => Stage::Pausing,
            t if t < taken => Stage::Taking,
            t if t < arrived => Stage::Guiding,
            t if t < settled => Stage::Settling,
            t if t < settled + GRIP_SECONDS => Stage::Releasing,
            _ => Stage::Done,
        }
    }

    /// Time on the path, s: negative before it starts, longer than its duration after its end.
    fn path_time(&self) -> f64 {
        self.time.unwrap_or(0.0) - self.config.pause - GRIP_SECONDS
    }

    /// Firmness of the hold, 0 to 1.
    fn grip(&self) -> f64 {
        let rise = (self.path_time() + GRIP_SECONDS) / GRIP_SECONDS;
        let fall = (self.path.duration() + self.config.settle + GRIP_SECONDS - self.path_time()) / GRIP_SECONDS;
        rise.min(fall).clamp(0.0, 1.0)
    }

    /// One physics step: the force (N) and torque (N m) of the teacher at the grasp point, world axes.
    ///
    /// Call it once per physics step with the pose of the grasp point; time advances by [`STEP_SECONDS`].
    pub fn pull(&mut self, hand: &Pose) -> ([f64; 3], [f64; 3]) {
        let Some(time) = self.time else {
            return ([0.0; 3], [0.0; 3]);
        };
        self.feel(hand);
        let grip = self.grip();
        let mut wrench = [[0.0; 3]; 2];
        if grip > 0.0 {
            let aim = self.aim(hand);
            let shake: [f64; 6] = std::array::from_fn(|i| self.tremor[i].next(&mut self.noise));
            let c = &self.config;
            let spring = [
                (add_scaled(aim.position, -1.0, hand.position), c.stiffness, c.damping, c.tremor_force, c.force_limit),
                (
                    difference(aim.quaternion, hand.quaternion),
                    c.rotation_stiffness,
                    c.rotation_damping,
                    c.tremor_torque,
                    c.torque_limit,
                ),
            ];
            for (k, (stretch, stiffness, damping, tremor, limit)) in spring.into_iter().enumerate() {
                let pull: [f64; 3] = std::array::from_fn(|i| {
                    grip * (stiffness * stretch[i] - damping * self.speed[k][i] + tremor * shake[3 * k + i])
                });
                wrench[k] = shortened(pull, limit);
            }
        }
        self.time = Some(time + STEP_SECONDS);
        (wrench[0], wrench[1])
    }

    /// Speed of the hand, from one pose to the next.
    fn feel(&mut self, hand: &Pose) {
        let last = self.last.replace(*hand).unwrap_or(*hand);
        let moved = [add_scaled(hand.position, -1.0, last.position), difference(hand.quaternion, last.quaternion)];
        let share = STEP_SECONDS / SPEED_FILTER_SECONDS;
        for (speed, moved) in self.speed.iter_mut().zip(moved) {
            let change = add_scaled(moved.map(|x| x / STEP_SECONDS), -1.0, *speed);
            *speed = add_scaled(*speed, share, change);
        }
    }

    /// Where the teacher aims: the path, plus drift, plus the correction of what they saw a reaction time ago.
    fn aim(&mut self, hand: &Pose) -> Pose {
        let wanted = self.path.pose(self.path_time());
        self.seen.push_back([
            add_scaled(wanted.position, -1.0, hand.position),
            difference(wanted.quaternion, hand.quaternion),
        ]);
        if self.seen.len() as f64 * STEP_SECONDS > self.config.reaction_time
            && let Some(error) = self.seen.pop_front()
        {
            let careless = [CARELESS_METRES, CARELESS_RADIANS];
            let limits = [CORRECTION_LIMIT, ROTATION_CORRECTION_LIMIT];
            for k in 0..2 {
                let length = norm(error[k]);
                if length > careless[k] {
                    let share = self.config.correction_rate * STEP_SECONDS * (1.0 - careless[k] / length);
                    self.correction[k] = shortened(add_scaled(self.correction[k], share, error[k]), limits[k]);
                }
            }
        }
        let wander: [f64; 6] = std::array::from_fn(|i| self.drift[i].next(&mut self.noise));
        let (d, r) = (self.config.drift, self.config.rotation_drift);
        let turn = [r * wander[3], r * wander[4], r * wander[5]];
        Pose {
            position: add_scaled(
                add_scaled(wanted.position, 1.0, self.correction[0]),
                d,
                [wander[0], wander[1], wander[2]],
            ),
            quaternion: multiply(exponential(add_scaled(turn, 1.0, self.correction[1])), wanted.quaternion),
        }
    }
}
