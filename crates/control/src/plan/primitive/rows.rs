//! The rows of this arm's movements: one pose, the posture of seven joints, four digits of the hand.
//!
//! The paper does not say how the posture is parameterised; one row per arm joint is our reading.

use core::fmt;

use dmp::{Gain, Group, Pose, PoseGains, PoseLimits, PrimitiveError, Quaternion, Scalar, Twist};

/// Rows of the end-effector position (x, y, z in the world frame, m).
pub const POSITION_ROWS: usize = 3;
/// Rows of the end-effector orientation (body frame, rad).
pub const ORIENTATION_ROWS: usize = 3;
/// Rows of the default posture `q_post` (one per arm joint, rad).
pub const POSTURE_ROWS: usize = 7;
/// Rows of the hand (spread, F1, F2, F3, rad).
pub const HAND_ROWS: usize = 4;
/// Point rows: posture, then hand.
pub const POINT_ROWS: usize = POSTURE_ROWS + HAND_ROWS;
/// All rows of weights in their order: position, orientation, posture, hand.
pub const ROWS: usize = POSITION_ROWS + ORIENTATION_ROWS + POINT_ROWS;

/// Movement without the memory of its sensors.
pub type Movement<T, const N: usize> = dmp::Primitive<T, POINT_ROWS, 1, N>;
/// Tables of a movement.
pub type MovementTables<'a, T> = dmp::PrimitiveTables<'a, T, POINT_ROWS, 1>;
/// State of a run.
pub type Rollout<T, const N: usize> = dmp::Rollout<T, POINT_ROWS, 1, N>;
/// Plan at one tick.
pub type Reference<T> = dmp::Reference<T, POINT_ROWS, 1>;
/// Pose, posture and hand.
pub type Configuration<T> = dmp::Configuration<T, POINT_ROWS, 1>;
/// Their velocities.
pub type Velocity<T> = dmp::Velocity<T, POINT_ROWS, 1>;
/// Where a run begins.
pub type StartState<T> = dmp::StartState<T, POINT_ROWS, 1>;
/// Coupling of one tick.
pub type Coupling<T> = dmp::Coupling<T, POINT_ROWS, 1>;
/// Springs and dampers.
pub type Gains<T> = dmp::Gains<T, POINT_ROWS, 1>;
/// Largest displacements by a coupling.
pub type Limits<T> = dmp::DisplacementLimits<T, POINT_ROWS, 1>;

/// The point rows of a posture (rad) and a hand (spread, F1, F2, F3, rad).
pub fn points<T: Copy>(posture: [T; POSTURE_ROWS], hand: [T; HAND_ROWS]) -> [T; POINT_ROWS] {
    let ([a, b, c, d, e, f, g], [h, i, j, k]) = (posture, hand);
    [a, b, c, d, e, f, g, h, i, j, k]
}

/// Posture and hand of point rows.
#[inline]
pub fn posture_and_hand<T: Copy>(points: &[T; POINT_ROWS]) -> ([T; POSTURE_ROWS], [T; HAND_ROWS]) {
    let [a, b, c, d, e, f, g, hand @ ..] = *points;
    ([a, b, c, d, e, f, g], hand)
}

/// Position (m, world), orientation (w, x, y, z, body -> world), posture and hand (rad).
pub fn configuration<T: Scalar>(
    position: [T; 3],
    [w, x, y, z]: [T; 4],
    posture: [T; POSTURE_ROWS],
    hand: [T; HAND_ROWS],
) -> Configuration<T> {
    let pose = Pose { position, orientation: Quaternion::new(w, x, y, z) };
    Configuration { poses: [pose], points: points(posture, hand) }
}

/// Linear velocity (m/s, world), angular velocity (rad/s, body), those of posture and hand (rad/s).
pub fn velocity<T: Scalar>(
    linear: [T; 3],
    angular: [T; 3],
    posture: [T; POSTURE_ROWS],
    hand: [T; HAND_ROWS],
) -> Velocity<T> {
    Velocity { poses: [Twist { linear, angular }], points: points(posture, hand) }
}

/// Stiffness and damping of position, orientation, posture and hand.
pub fn gains<T: Scalar>(stiffness: [T; 4], damping: [T; 4]) -> Gains<T> {
    let ([k_p, k_o, k_q, k_h], [d_p, d_o, d_q, d_h]) = (stiffness, damping);
    let gain = |stiffness: T, damping: T| Gain { stiffness, damping };
    Gains {
        poses: [PoseGains { position: gain(k_p, d_p), orientation: gain(k_o, d_o) }],
        points: points([gain(k_q, d_q); POSTURE_ROWS], [gain(k_h, d_h); HAND_ROWS]),
    }
}

/// Largest displacement of the position (m), of the orientation and of each digit (rad). The posture has no sensor.
pub fn limits<T: Scalar>(displacement: T, rotation: T, hand: T) -> Limits<T> {
    Limits {
        poses: [PoseLimits { displacement, rotation }],
        points: points([T::ZERO; POSTURE_ROWS], [hand; HAND_ROWS]),
    }
}

/// Part of the arm that a row of a movement moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RowGroup {
    /// Position of the tool.
    Position,
    /// Orientation of the tool.
    Orientation,
    /// Posture of the arm.
    Posture,
    /// Digits of the hand.
    Hand,
}

impl RowGroup {
    /// All of them in the order of their numbers on the link.
    pub const ALL: [RowGroup; 4] = [Self::Position, Self::Orientation, Self::Posture, Self::Hand];

    /// The part that a row of `dmp` moves, and the place in it.
    pub fn of(group: Group, index: u8) -> (Self, u8) {
        match group {
            Group::Position => (Self::Position, index),
            Group::Orientation => (Self::Orientation, index),
            _ => match index.checked_sub(POSTURE_ROWS as u8) {
                Some(digit) => (Self::Hand, digit),
                None => (Self::Posture, index),
            },
        }
    }

    /// The row of `dmp` at a place of this part.
    pub fn row(self, index: u8) -> (Group, u8) {
        match self {
            Self::Position => (Group::Position, index),
            Self::Orientation => (Group::Orientation, index),
            Self::Posture => (Group::Points, index),
            Self::Hand => (Group::Points, index.saturating_add(POSTURE_ROWS as u8)),
        }
    }
}

impl fmt::Display for RowGroup {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Position => "position",
            Self::Orientation => "orientation",
            Self::Posture => "posture",
            Self::Hand => "hand",
        })
    }
}

/// Writes why tables are refused, with the words of this arm for its rows.
pub(crate) fn write_error(error: &PrimitiveError, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    match *error {
        PrimitiveError::Gains { group, index, error } => write!(f, "{}: {error}", RowGroup::of(group, index).0),
        PrimitiveError::Unstable { group, index } => {
            write!(f, "{}: the duration is too short for these gains", RowGroup::of(group, index).0)
        }
        PrimitiveError::WeightTooLarge { group, index, kernel } => {
            let (group, index) = RowGroup::of(group, index);
            write!(
                f,
                "the weights of {group} row {index} at kernel {kernel} (both from 0) are larger than any movement needs"
            )
        }
        PrimitiveError::TooLarge { part, group, index } => {
            let (group, index) = RowGroup::of(group, index);
            write!(f, "{group} value {index} (from 0) of the {part} is larger than any movement needs")
        }
        ref other => write!(f, "{other}"),
    }
}
