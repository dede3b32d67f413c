//! `PrimitiveError`: why tables are no movement, and which value of them is at fault.

use core::fmt;

use crate::{GainError, ORIENTATION_ROWS, POSITION_ROWS, POSTURE_ROWS};

/// Group of rows with common gains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Row {
    /// Position rows.
    Position,
    /// Orientation rows.
    Orientation,
    /// Posture rows.
    Posture,
    /// Hand rows.
    Hand,
}

impl Row {
    /// Group of a row of weights, and its place there.
    pub(crate) fn of_weights(row: usize) -> (Self, usize) {
        const ORIENTATION: usize = POSITION_ROWS;
        const POSTURE: usize = ORIENTATION + ORIENTATION_ROWS;
        const HAND: usize = POSTURE + POSTURE_ROWS;
        match row {
            0..ORIENTATION => (Self::Position, row),
            ORIENTATION..POSTURE => (Self::Orientation, row - ORIENTATION),
            POSTURE..HAND => (Self::Posture, row - POSTURE),
            _ => (Self::Hand, row - HAND),
        }
    }
}

impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Position => "position",
            Self::Orientation => "orientation",
            Self::Posture => "posture",
            Self::Hand => "hand",
        })
    }
}

/// Which values of a movement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The start.
    Start,
    /// The goal.
    Goal,
    /// The velocity at the start.
    StartVelocity,
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Start => "start",
            Self::Goal => "goal",
            Self::StartVelocity => "start velocity",
        })
    }
}

/// Why tables are refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PrimitiveError {
    /// The duration is not a positive number up to 3600 s.
    Duration,
    /// `alpha` lets the phase end outside 1e-6..0.1.
    Alpha,
    /// Fewer than two kernels, or more than the capacity.
    KernelCount,
    /// The activation at the next centre is outside 0.05..0.95.
    Activation,
    /// Not exactly `ROWS * kernel_count` weights.
    WeightCount,
    /// A weight is NaN or infinite.
    Weight,
    /// Gains of this group are unusable.
    Gains(Row, GainError),
    /// The duration is too short for the gains of this group: at 300 Hz the integration would be unstable.
    Unstable(Row),
    /// A start value is NaN or infinite.
    Start,
    /// A start velocity is NaN or infinite.
    StartVelocity,
    /// A goal value is NaN or infinite.
    Goal,
    /// The start orientation is not a unit quaternion.
    StartNotUnit,
    /// The goal orientation is not a unit quaternion.
    GoalNotUnit,
    /// Start and goal are more than 175 degrees apart, where the error of Eq. (4) fails: use
    /// [`OrientationError::RotationVector`](crate::OrientationError::RotationVector).
    TurnsTooFar,
    /// The weights give a larger forcing term than any movement of this duration with these gains needs, see
    /// [`bounds`](crate::bounds).
    WeightTooLarge {
        /// Row of weights, 0 to 16.
        row: u8,
        /// Kernel at whose centre, or behind it, the term is too large, from 0.
        kernel: u8,
    },
    /// A value is larger than any movement needs, see [`bounds`](crate::bounds).
    TooLarge {
        /// Where it is.
        part: Part,
        /// Its group.
        row: Row,
        /// Its place in the group, from 0.
        index: u8,
    },
}

impl fmt::Display for PrimitiveError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Duration => f.write_str("the duration is not a positive number up to 3600 s"),
            Self::Alpha => f.write_str("alpha lets the phase end outside 1e-6..0.1"),
            Self::KernelCount => f.write_str("fewer than two kernels or more than fit"),
            Self::Activation => f.write_str("the kernel activation is outside 0.05..0.95"),
            Self::WeightCount => f.write_str("the number of weights is not rows times kernels"),
            Self::Weight => f.write_str("a weight is not a number"),
            Self::Gains(row, error) => write!(f, "{row}: {error}"),
            Self::Unstable(row) => {
                write!(f, "{row}: the duration is too short for these gains at 300 Hz")
            }
            Self::Start => f.write_str("a start value is not a number"),
            Self::StartVelocity => f.write_str("a start velocity is not a number"),
            Self::Goal => f.write_str("a goal value is not a number"),
            Self::StartNotUnit => f.write_str("the start orientation is not a unit quaternion"),
            Self::GoalNotUnit => f.write_str("the goal orientation is not a unit quaternion"),
            Self::TurnsTooFar => {
                f.write_str("start and goal are more than 175 degrees apart; the rotation-vector error is needed")
            }
            Self::WeightTooLarge { row, kernel } => {
                let (group, row) = Row::of_weights(usize::from(*row));
                write!(
                    f,
                    "the weights of {group} row {row} at kernel {kernel} (both from 0) are larger than any movement \
                     needs"
                )
            }
            Self::TooLarge { part, row, index } => {
                write!(f, "{row} value {index} (from 0) of the {part} is larger than any movement needs")
            }
        }
    }
}

impl core::error::Error for PrimitiveError {}
