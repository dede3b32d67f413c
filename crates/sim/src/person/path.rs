//! The way along which a person guides the hand: a curve for the grasp point and a turn about several axes.

use crate::Pose;
use crate::rotation::{add_scaled, exponential, multiply, norm};

/// A smooth way from a start pose to a goal pose of the grasp point.
///
/// Position is a cubic Bezier curve; orientation is the goal's, from which two turns in the hand's frame fade away one
/// after the other, so that the axis of rotation changes on the way. Time runs by minimum jerk, at rest at both ends.
#[derive(Clone, Debug)]
pub struct GuidePath {
    control: [[f64; 3]; 4],
    goal: [f64; 4],
    turns: [[f64; 3]; 2],
    duration: f64,
}

/// Minimum jerk from 0 to 1 for `s` in [0, 1]; 0 before, 1 after.
fn minimum_jerk(s: f64) -> f64 {
    let s = s.clamp(0.0, 1.0);
    s * s * s * (10.0 + s * (6.0 * s - 15.0))
}

impl GuidePath {
    /// Duration of the movement, s.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// Pose of the grasp point `time` seconds after the start; rests at the ends.
    #[must_use]
    pub fn pose(&self, time: f64) -> Pose {
        let s = minimum_jerk(time / self.duration);
        let r = 1.0 - s;
        let weights = [r * r * r, 3.0 * r * r * s, 3.0 * r * s * s, s * s * s];
        let position = self.control.iter().zip(weights).fold([0.0; 3], |sum, (p, w)| add_scaled(sum, w, *p));
        // The hand is level before the fingers come near the object: both turns end before the curve does.
        let left = [1.0 - minimum_jerk(s / 0.95), 1.0 - minimum_jerk((s - 0.1) / 0.85)];
        let quaternion = self
            .turns
            .iter()
            .zip(left)
            .fold(self.goal, |q, (turn, left)| multiply(q, exponential(turn.map(|x| left * x))));
        Pose { position, quaternion }
    }

    /// Pose before the movement.
    #[must_use]
    pub fn start(&self) -> Pose {
        self.pose(0.0)
    }

    /// Pose after the movement.
    #[must_use]
    pub fn goal(&self) -> Pose {
        self.pose(self.duration)
    }

    /// Length of the curve of the grasp point, m.
    #[must_use]
    pub fn length(&self) -> f64 {
        let points: Vec<_> = (0..=500).map(|i| self.pose(self.duration * f64::from(i) / 500.0).position).collect();
        points.windows(2).map(|w| norm(add_scaled(w[1], -1.0, w[0]))).sum()
    }
}

/// The demonstration: from in front of the robot to a level side grasp of the upright flashlight, in 7 s.
///
/// The palm arrives level, 30 degrees to the left of straight ahead, with the flashlight's axis through the grasp
/// point 13 cm above the table. 0.41 m of curve and 46 degrees of turn about all three axes of the hand.
#[must_use]
pub fn side_grasp_path() -> GuidePath {
    // Approach direction: horizontal, turned by 30 degrees about the vertical.
    let (sine, cosine) = 30.0_f64.to_radians().sin_cos();
    let approach = [cosine, sine, 0.0];
    let left = [-sine, cosine, 0.0];
    let goal = [0.80, 0.0, -0.01];
    let start = add_scaled(add_scaled(add_scaled(goal, -0.28, approach), -0.2, left), 0.18, [0.0, 0.0, 1.0]);
    // The last control point lies on the line of approach, so the curve ends straight into the grasp.
    let arrive = add_scaled(goal, -0.14, approach);
    let towards = add_scaled(arrive, -1.0, start);
    let leave = add_scaled(add_scaled(add_scaled(start, 0.35, towards), 0.03, left), 0.05, [0.0, 0.0, 1.0]);
    // Palm level: hand z along the approach, hand x straight up (F1 and F2 above one another, the fingers close sideways).
    // A half turn about the bisector of x and z swaps those two axes; then the whole hand turns to the approach.
    let half = 0.5_f64.sqrt();
    let goal_quaternion = multiply(exponential([0.0, 0.0, 30.0_f64.to_radians()]), [0.0, half, 0.0, half]);
    GuidePath {
        control: [start, leave, arrive, goal],
        goal: goal_quaternion,
        turns: [[0.0, -30.0_f64.to_radians(), -25.0_f64.to_radians()], [-25.0_f64.to_radians(), 0.0, 0.0]],
        duration: 7.0,
    }
}
