//! The postures of the tour, and the part of a pass that counts.
//!
//! In every posture the hand is above the table and in front of the base, and so it is on the straight ways between
//! them (`the_tour_stays_above_the_table_and_away_from_the_arm_itself`). They were drawn at random within those bounds.

/// Distance from the posture at which a pass begins and ends, rad, every joint.
pub const HALF_WAY: f32 = 0.12;

/// Duration of a pass, s. Twice [`HALF_WAY`] in this time is 0.15 rad/s in the middle, where all joints slide.
pub const PASS_SECONDS: f32 = 3.0;

/// The part of a pass that counts, by where the first joint is: around the posture, where the path is fastest and its
/// acceleration passes zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    /// Distance from the posture up to which a sample counts, rad.
    pub half: f64,
}

impl Window {
    /// Half of the way.
    pub const MIDDLE: Self = Self { half: 0.5 * HALF_WAY as f64 };

    /// True if a joint whose path should be at `q` (rad) is near `posture` (rad).
    #[must_use]
    pub fn contains(self, q: f64, posture: f64) -> bool {
        (q - posture).abs() <= self.half
    }
}

/// True for the postures by which the result is judged: every fourth, so that they lie among the others.
#[must_use]
pub const fn is_held_out(index: usize) -> bool {
    index % 4 == 2
}

/// Joint angles of the postures, rad, in the order of the tour.
pub const TOUR: [[f32; 7]; 20] = [
    [0.0, -0.4, 0.0, 2.0, 0.0, 0.0, 0.0],
    [0.0, 0.4, -0.9, 0.9, -0.9, 0.8, 0.6],
    [-0.3, -0.2, 0.9, 2.0, -0.9, 0.9, 0.1],
    [0.3, 0.0, 0.1, 0.5, -1.5, -0.6, 1.1],
    [0.3, -0.3, 0.4, 1.9, 0.5, -0.9, 1.1],
    [-0.3, -0.4, 0.9, 1.4, -0.6, -0.5, 0.2],
    [0.3, 0.2, -0.1, 0.6, 0.6, -0.9, 0.0],
    [-0.1, -0.3, 0.6, 1.0, -0.5, 1.0, 0.8],
    [0.5, 0.2, 0.0, 1.7, -0.5, -0.4, -0.2],
    [0.2, 0.5, 0.5, 1.1, 0.1, -0.4, 0.0],
    [0.0, -0.1, 0.3, 1.3, 0.4, 0.3, 0.7],
    [0.4, 0.2, 0.3, 1.7, 0.2, -0.7, 0.7],
    [-0.5, -0.3, -0.1, 1.6, -1.1, 0.4, 0.3],
    [-0.5, 0.2, -0.5, 0.6, -1.3, -0.4, -0.8],
    [-0.5, -0.3, 0.1, 1.5, -1.3, 0.3, 0.9],
    [-0.1, 0.1, -0.5, 1.0, 0.7, -0.2, 1.1],
    [-0.2, 0.7, 0.6, 0.5, -0.3, -0.5, 1.0],
    [0.0, 0.0, -0.4, 1.4, -0.5, -0.3, 0.6],
    [0.4, 0.1, -0.2, 1.9, -1.1, -0.4, 0.8],
    [-0.4, 0.2, 0.1, 1.3, -0.8, -0.7, 0.2],
];
