//! `PrimitiveError`: why tables are no movement, and which value of them is at fault.

use core::fmt;

use crate::GainError;

/// Kind of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Group {
    /// Position rows of the poses, three each.
    Position,
    /// Orientation rows of the poses, three each.
    Orientation,
    /// Point rows.
    Points,
}

impl Group {
    /// Group of a row of weights, and its place there: of each pose three position and three orientation rows, then
    /// the point rows.
    #[must_use]
    pub fn of_weights(row: usize, poses: usize) -> (Self, usize) {
        let (pose, axis) = (row / 6, row % 6);
        if pose >= poses {
            (Self::Points, row - 6 * poses)
        } else if axis < 3 {
            (Self::Position, 3 * pose + axis)
        } else {
            (Self::Orientation, 3 * pose + axis - 3)
        }
    }
}

impl fmt::Display for Group {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Position => "position",
            Self::Orientation => "orientation",
            Self::Points => "point",
        })
    }
}

/// Part of the values of a movement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
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
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum PrimitiveError {
    /// The duration is not a positive number up to 3600 s.
    Duration,
    /// `alpha` lets the phase end outside 1e-6..0.1.
    Alpha,
    /// Fewer than two kernels, or more than the capacity.
    KernelCount,
    /// The activation at the next centre is outside 0.05..0.95, or the number type cannot hold so many or so few
    /// kernels of this activation and decay: fixed point ends at 970 of the default ones, and does not hold two where
    /// `alpha` is large.
    Activation,
    /// Not exactly `kernel_count` weights for each row.
    WeightCount,
    /// The control period is not between [`bounds::SHORTEST_CONTROL_PERIOD`](crate::bounds::SHORTEST_CONTROL_PERIOD)
    /// and 3600 s.
    ControlPeriod,
    /// A weight is NaN or infinite, or more than the number type keeps
    /// ([`Scalar::to_weight`](crate::Scalar::to_weight)).
    Weight,
    /// The gains of a row are unusable.
    Gains {
        /// Its group.
        group: Group,
        /// Its place in the group, from 0.
        index: u8,
        /// The gain that is wrong.
        error: GainError,
    },
    /// The duration is too short for the gains of a row: at this control period the integration would be unstable.
    Unstable {
        /// Its group.
        group: Group,
        /// Its place in the group, from 0.
        index: u8,
    },
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
    /// [`OrientationError::RotationVector`](crate::OrientationError::RotationVector). With that: more than 359 degrees.
    TurnsTooFar,
    /// The weights give a larger forcing term than any movement of this duration with these gains needs, see
    /// [`bounds`](crate::bounds).
    WeightTooLarge {
        /// Group of the row.
        group: Group,
        /// Its place in the group, from 0.
        index: u8,
        /// Kernel at whose centre, or behind it, the term is too large, from 0.
        kernel: u8,
    },
    /// A value is larger than any movement needs, see [`bounds`](crate::bounds).
    TooLarge {
        /// Where it is.
        part: Part,
        /// Its group.
        group: Group,
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
            Self::Activation => f.write_str(
                "the kernel activation is outside 0.05..0.95, or the number type cannot hold so many or so few kernels",
            ),
            Self::WeightCount => f.write_str("the number of weights is not rows times kernels"),
            Self::Weight => f.write_str("a weight is not a number, or more than the number type keeps"),
            Self::ControlPeriod => f.write_str("the control period is not between 1e-6 and 3600 s"),
            Self::Gains { group, index, error } => write!(f, "{group} row {index} (from 0): {error}"),
            Self::Unstable { group, index } => {
                write!(
                    f,
                    "{group} row {index} (from 0): the duration is too short for its gains at this control period"
                )
            }
            Self::Start => f.write_str("a start value is not a number"),
            Self::StartVelocity => f.write_str("a start velocity is not a number"),
            Self::Goal => f.write_str("a goal value is not a number"),
            Self::StartNotUnit => f.write_str("the start orientation is not a unit quaternion"),
            Self::GoalNotUnit => f.write_str("the goal orientation is not a unit quaternion"),
            Self::TurnsTooFar => f.write_str(
                "start and goal are more than 175 degrees apart, where the rotation-vector error is needed, or more \
                 than 359, where no error is left",
            ),
            Self::WeightTooLarge { group, index, kernel } => write!(
                f,
                "the weights of {group} row {index} at kernel {kernel} (both from 0) are larger than any movement needs"
            ),
            Self::TooLarge { part, group, index } => {
                // As text: the routines that print an f64 are larger than this crate.
                let largest = match part {
                    Part::Start | Part::Goal => "20 m or rad",
                    Part::StartVelocity => "50 m/s or rad/s",
                };
                write!(f, "{group} value {index} (from 0) of the {part} is larger than any movement needs: {largest}")
            }
        }
    }
}

impl core::error::Error for PrimitiveError {}
