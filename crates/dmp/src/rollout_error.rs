//! `RolloutError`: why a start, a tick or a change in flight is refused.

use core::fmt;

/// Reason for which a start, a tick or a change in flight is refused; the run goes on unchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum RolloutError {
    /// A value is NaN or infinite.
    NotFinite,
    /// A value is larger than any movement needs, see [`bounds`](crate::bounds).
    TooLarge,
    /// A quaternion is not of unit norm.
    NotUnit,
    /// The duration is shorter than [`minimum_duration`](crate::Primitive::minimum_duration), or the speed too high.
    TooFast,
    /// A speed, rate or duration is negative, or a duration is 0.
    Negative,
    /// The control period is longer than the one that the primitive was checked for.
    PeriodTooLong,
    /// The run was started with another primitive.
    OtherPrimitive,
    /// The primitive has no such pose.
    NoSuchPose,
    /// The start or the new goal is more than 175 degrees away, where the error of Eq. (4) fails.
    TurnsTooFar,
}

impl fmt::Display for RolloutError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotFinite => "a value is not a number",
            Self::TooLarge => "a value is larger than any movement needs",
            Self::NotUnit => "a quaternion is not of unit norm",
            Self::TooFast => "too fast: the integration would be unstable at this control period",
            Self::PeriodTooLong => "the control period is longer than the primitive was checked for",
            Self::NoSuchPose => "the primitive has no such pose",
            Self::Negative => "a speed, rate or duration is negative",
            Self::OtherPrimitive => "the run was started with another primitive",
            Self::TurnsTooFar => "the goal is more than 175 degrees away; the rotation-vector error is needed",
        })
    }
}

impl core::error::Error for RolloutError {}
