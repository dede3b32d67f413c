//! The way along which a teacher guides the hand: a curve for the grasp point and a turn about several axes.

use crate::Pose;
use crate::rotation::{add_scaled, exponential, multiply, norm};

/// A smooth way of the grasp point through one or several legs, at rest between them.
///
/// Position is a cubic Bezier curve in each leg; orientation is the goal's, from which two turns in the hand's frame
/// fade away one after the other, so that the axis of rotation changes on the way. Time runs by minimum jerk in each
/// leg, or at a constant speed between soft ends, as people do who take care not to bump into something.
#[derive(Clone, Debug)]
pub struct GuidePath {
    goal: [f64; 4],
    legs: Vec<Leg>,
}

/// A part of a path, at rest at both ends.
#[derive(Clone, Debug)]
pub(super) struct Leg {
    /// Control points of the cubic Bezier curve, m.
    control: [[f64; 3]; 4],
    /// Turns away from the goal's orientation at the start of the leg, rotation vectors in the hand's frame, rad.
    turns: [[f64; 3]; 2],
    duration: f64,
    /// Time in which a constant speed is reached and left, as a share of the duration; `None`: minimum jerk.
    ramp: Option<f64>,
}

impl Leg {
    /// A curve that begins turned away and ends in the goal's orientation.
    pub(super) const fn new(control: [[f64; 3]; 4], turns: [[f64; 3]; 2], duration: f64) -> Self {
        Self { control, turns, duration, ramp: None }
    }

    /// The same at a constant speed, but for `seconds` at either end.
    pub(super) fn steady(self, seconds: f64) -> Self {
        Self { ramp: Some(seconds / self.duration), ..self }
    }

    /// A straight line in the goal's orientation.
    pub(super) fn straight(from: [f64; 3], to: [f64; 3], duration: f64) -> Self {
        let towards = add_scaled(to, -1.0, from);
        let at = |share: f64| add_scaled(from, share, towards);
        Self::new([from, at(1.0 / 3.0), at(2.0 / 3.0), to], [[0.0; 3]; 2], duration)
    }

    /// A rest in the goal's orientation.
    pub(super) const fn rest(at: [f64; 3], duration: f64) -> Self {
        Self::new([at; 4], [[0.0; 3]; 2], duration)
    }

    /// Where the leg ends, m.
    pub(super) const fn end(&self) -> [f64; 3] {
        self.control[3]
    }

    /// Position and turns that are left, `share` of the time after the start.
    fn at(&self, share: f64) -> ([f64; 3], [[f64; 3]; 2]) {
        let s = match self.ramp {
            None => minimum_jerk(share),
            Some(ramp) => steady(share, ramp),
        };
        let r = 1.0 - s;
        let weights = [r * r * r, 3.0 * r * r * s, 3.0 * r * s * s, s * s * s];
        let position = self.control.iter().zip(weights).fold([0.0; 3], |sum, (p, w)| add_scaled(sum, w, *p));
        // The hand is level before the fingers come near the object: both turns end before the curve does.
        let left = [1.0 - minimum_jerk(s / 0.95), 1.0 - minimum_jerk((s - 0.1) / 0.85)];
        (position, [0, 1].map(|i| self.turns[i].map(|x| left[i] * x)))
    }
}

/// Minimum jerk from 0 to 1 for `s` in [0, 1]; 0 before, 1 after.
fn minimum_jerk(s: f64) -> f64 {
    let s = s.clamp(0.0, 1.0);
    s * s * s * (10.0 + s * (6.0 * s - 15.0))
}

/// From 0 to 1 at a constant speed that is reached and left smoothly within `ramp` (a share of the time, at most 0.5).
fn steady(share: f64, ramp: f64) -> f64 {
    let share = share.clamp(0.0, 1.0);
    let speed = 1.0 / (1.0 - ramp);
    // The speed rises as 3 u^2 - 2 u^3 with u = share / ramp; this is its integral.
    let rise = |u: f64| speed * ramp * (u * u * u - 0.5 * u * u * u * u);
    if share < ramp {
        rise(share / ramp)
    } else if share > 1.0 - ramp {
        1.0 - rise((1.0 - share) / ramp)
    } else {
        speed * (share - 0.5 * ramp)
    }
}

impl GuidePath {
    /// A path that ends in the orientation `goal`. Each leg begins where the one before ends.
    pub(super) const fn new(goal: [f64; 4], legs: Vec<Leg>) -> Self {
        Self { goal, legs }
    }

    /// Duration of the movement, s.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.legs.iter().map(|leg| leg.duration).sum()
    }

    /// Pose of the grasp point `time` seconds after the start; rests at the ends.
    #[must_use]
    pub fn pose(&self, time: f64) -> Pose {
        let mut left = time;
        let mut reached = ([0.0; 3], [[0.0; 3]; 2]);
        for leg in &self.legs {
            reached = leg.at(left / leg.duration);
            left -= leg.duration;
            if left <= 0.0 {
                break;
            }
        }
        let (position, turns) = reached;
        let quaternion = turns.into_iter().fold(self.goal, |q, turn| multiply(q, exponential(turn)));
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
        self.pose(self.duration())
    }

    /// Length of the curve of the grasp point, m.
    #[must_use]
    pub fn length(&self) -> f64 {
        let points: Vec<_> = (0..=500).map(|i| self.pose(self.duration() * f64::from(i) / 500.0).position).collect();
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
    // Palm level: hand z along the approach, hand x straight up (F1 and F2 above one another, the fingers close
    // sideways). A half turn about the bisector of x and z swaps those two axes; then the whole hand turns to the
    // approach.
    let half = 0.5_f64.sqrt();
    let goal_quaternion = multiply(exponential([0.0, 0.0, 30.0_f64.to_radians()]), [0.0, half, 0.0, half]);
    let turns = [[0.0, -30.0_f64.to_radians(), -25.0_f64.to_radians()], [-25.0_f64.to_radians(), 0.0, 0.0]];
    GuidePath::new(goal_quaternion, vec![Leg::new([start, leave, arrive, goal], turns, 7.0)])
}
