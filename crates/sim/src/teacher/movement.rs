//! The movements that the teacher can show: path of the hand, posture at the start, posture at the end.
//!
//! World frame; the table's top is at z = -0.15. In every movement the hand's z axis is the direction of approach.

use super::path::{GuidePath, Leg};
use crate::rotation::{add_scaled, exponential, multiply};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_3, FRAC_PI_4, PI};

/// Something a teacher teaches the arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TaughtMovement {
    /// The demonstration of the first teaching: a side grasp of the small torch out of a turn about all axes of the
    /// hand.
    SmallTorch,
    /// A level side grasp of the flashlight: 60 degrees to the left of straight ahead, the palm 11 cm above the table.
    /// Where it is pushed lower than 7 cm a flashlight slides; the higher, the sooner it topples.
    Flashlight,
    /// The same for a cup: 45 degrees to the left, the palm 6 cm above the table, and 2 cm less far, for the cup is
    /// thick.
    Cup,
    /// A grasp from above across a lying bottle, whose axis is world x where its yaw is 0; closing fingertips would
    /// touch the table.
    Bottle,
    /// A level side grasp of the weight, a rest for the fingers to close, then 10 cm straight up.
    Lift,
}

/// Distance along which the hand approaches, m.
const APPROACH: f64 = 0.42;

/// Duration of an approach, s.
const APPROACH_SECONDS: f64 = 14.0;

/// Time in which the hand reaches and leaves its steady speed, s: 3.4 cm/s over 42 cm. Nobody who approaches something
/// that topples arrives faster.
const SOFT_ENDS: f64 = 1.5;

/// Rest while the fingers close, s.
const CLOSING_SECONDS: f64 = 3.5;

/// Height (m) and duration (s) of the lift.
const LIFT: (f64, f64) = (0.10, 2.5);

/// Direction of side grasps, rad to the left of straight ahead.
const SIDE_AZIMUTH: f64 = FRAC_PI_4;

/// The same for the flashlight: here the wrist (joint 6) has half a radian to spare on either side wherever the hand
/// retreats and turns along the approach; at 45 degrees it meets its stop.
const FLASHLIGHT_AZIMUTH: f64 = FRAC_PI_3;

/// Where side grasps end, world x and y, m.
const SIDE_GOAL: [f64; 2] = [0.75, 0.20];

/// Where the grasp from above ends, m: 2.5 cm above the table, the palm just above the bottle and the open fingertips
/// on the table. The fingers reach 6.8 cm beyond the grasp point as they close: 4 cm into the table.
const BOTTLE_GOAL: [f64; 3] = [0.62, 0.10, -0.125];

impl TaughtMovement {
    /// All movements.
    pub const ALL: [Self; 5] = [Self::SmallTorch, Self::Flashlight, Self::Cup, Self::Bottle, Self::Lift];

    /// The way along which the hand is guided.
    #[must_use]
    pub fn path(self) -> GuidePath {
        match self {
            Self::SmallTorch => super::side_grasp_path(),
            Self::Flashlight => {
                let approach = side_approach(FLASHLIGHT_AZIMUTH, -0.04, self.short_of_object());
                GuidePath::new(level_hand(FLASHLIGHT_AZIMUTH), vec![approach])
            }
            Self::Cup => {
                let approach = side_approach(SIDE_AZIMUTH, -0.09, self.short_of_object());
                GuidePath::new(level_hand(SIDE_AZIMUTH), vec![approach])
            }
            Self::Bottle => GuidePath::new(hand_down(), vec![from_above()]),
            Self::Lift => {
                let approach = side_approach(SIDE_AZIMUTH, -0.06, self.short_of_object());
                let held = approach.end();
                let up = add_scaled(held, LIFT.0, [0.0, 0.0, 1.0]);
                let lift = Leg::straight(held, up, LIFT.1);
                GuidePath::new(level_hand(SIDE_AZIMUTH), vec![approach, Leg::rest(held, CLOSING_SECONDS), lift])
            }
        }
    }

    /// Joint posture in which the movement begins, rad: the grasp point is at the start of the path.
    ///
    /// Found by `Kinematics::inverse` as the posture nearest to the goal's (a test repeats it).
    /// The straight way in joint space from the home posture to here touches nothing.
    #[must_use]
    pub fn start(self) -> [f64; 7] {
        match self {
            Self::SmallTorch => super::DEMONSTRATION_START,
            Self::Flashlight => [-1.2712, 1.6177, 1.5691, 2.1800, -0.2190, 0.1411, 1.7522],
            Self::Cup => [-1.2933, 1.6342, 1.3301, 2.6968, -0.3064, -0.6327, 1.6472],
            Self::Bottle => [0.1024, 0.3395, -0.0326, 1.8077, 0.0129, 0.9946, 0.0646],
            Self::Lift => [-1.2388, 1.5864, 1.4041, 2.7033, -0.2266, -0.6868, 1.6597],
        }
    }

    /// A joint posture that reaches the end of the path, rad; the arm being redundant, a movement ends near it.
    #[must_use]
    pub fn goal(self) -> [f64; 7] {
        match self {
            Self::SmallTorch => super::DEMONSTRATION_GOAL,
            Self::Flashlight => [-0.4832, 1.6227, 1.5401, 1.6691, -0.2326, -0.1424, 1.7505],
            Self::Cup => [-0.5224, 1.6690, 1.4513, 1.8810, -0.2552, -0.5897, 1.7207],
            Self::Bottle => [0.1680, 0.8806, -0.0146, 1.7940, 0.0250, 0.4672, 0.1364],
            Self::Lift => [-0.4899, 1.4375, 1.4889, 1.8443, -0.0740, -0.5678, 1.7844],
        }
    }

    /// Distance by which the grasp point ends short of the object's axis, along the approach, m; negative where a
    /// teacher brings the palm close to what is slender.
    #[must_use]
    pub const fn short_of_object(self) -> f64 {
        match self {
            Self::Flashlight => -0.015,
            Self::Cup => 0.02,
            Self::SmallTorch | Self::Bottle | Self::Lift => 0.0,
        }
    }

    /// Time at which the grasp point is where the fingers close, s after the start of the path.
    #[must_use]
    pub fn arrival(self) -> f64 {
        match self {
            Self::Lift => APPROACH_SECONDS,
            _ => self.path().duration(),
        }
    }
}

/// Palm level, hand z to the left of straight ahead by the azimuth (rad), hand x straight down: the fingers close
/// sideways, F3 from the right. Upside down compared with [`side_grasp_path`](super::side_grasp_path): so joint 7 is
/// far from its stops out there.
fn level_hand(azimuth: f64) -> [f64; 4] {
    // A quarter turn about y takes z to straight ahead and x to straight down; then the whole hand turns to the
    // approach.
    multiply(exponential([0.0, 0.0, azimuth]), exponential([0.0, FRAC_PI_2, 0.0]))
}

/// Along the level direction of approach (azimuth, rad) to this height (m), `short` of the goal (m), slightly curved:
/// it begins 3 cm to the left of the line and 2 cm above it.
fn side_approach(azimuth: f64, height: f64, short: f64) -> Leg {
    let (sine, cosine) = azimuth.sin_cos();
    let (approach, left) = ([cosine, sine, 0.0], [-sine, cosine, 0.0]);
    let goal = add_scaled([SIDE_GOAL[0], SIDE_GOAL[1], height], -short, approach);
    let back = |distance: f64, aside: f64, above: f64| {
        add_scaled(add_scaled(add_scaled(goal, -distance, approach), aside, left), above, [0.0, 0.0, 1.0])
    };
    let control = [back(APPROACH, 0.03, 0.02), back(0.28, 0.04, 0.03), back(0.14, 0.0, 0.0), goal];
    Leg::new(control, [[0.0; 3]; 2], APPROACH_SECONDS).steady(SOFT_ENDS)
}

/// Hand z down, hand x along world x.
fn hand_down() -> [f64; 4] {
    exponential([PI, 0.0, 0.0])
}

/// From in front of the bottle and above it, straight down at the end.
fn from_above() -> Leg {
    let goal = BOTTLE_GOAL;
    let at = |back: f64, above: f64| [goal[0] - back, goal[1] - 0.5 * back, goal[2] + above];
    Leg::new([at(0.12, 0.31), at(0.06, 0.33), at(0.0, 0.14), goal], [[0.0; 3]; 2], APPROACH_SECONDS)
}
