//! Plain tables to a checked primitive that this arm can run.
//!
//! `dmp` checks what any movement has to satisfy; here comes what this arm adds: postures within the soft limits, poses
//! within reach, a start pose that belongs to the start posture, a duration and a speed that are allowed near people.

use core::fmt;

use dmp::{Configuration, Primitive, PrimitiveError, PrimitiveTables};

use crate::arm::ArmModel;
use crate::kinematics::Frames;
use crate::real::Real;
use crate::units::{JointPositions, Orientation};

/// Shortest movement (s).
pub const SHORTEST: f64 = 0.5;
/// Longest movement (s).
pub const LONGEST: f64 = 120.0;
/// Farthest tool position from the shoulder (m): the outstretched arm with its hand reaches 1.04 m.
pub const REACH: f64 = 1.05;
/// Largest distance between the taught pose and the pose of the taught posture (m).
pub const POSE_MISMATCH: f64 = 0.05;
/// Largest angle between them (rad): 10 degrees.
pub const TURN_MISMATCH: f64 = 0.175;

/// Start or goal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// The start of the movement.
    Start,
    /// The goal of the movement.
    Goal,
}

impl fmt::Display for End {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            End::Start => "start",
            End::Goal => "goal",
        })
    }
}

/// Why a primitive is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoadError {
    /// The tables are no movement.
    Primitive(PrimitiveError),
    /// The duration is outside 0.5 to 120 s.
    Duration,
    /// A joint (0 = J1) of the start or goal posture lies outside its soft limits.
    Posture(End, u8),
    /// The start or goal position is out of reach.
    OutOfReach(End),
    /// The start or goal pose is not that of the start or goal posture, within 5 cm and 10 degrees.
    Inconsistent(End),
}

impl fmt::Display for LoadError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            LoadError::Primitive(error) => error.fmt(formatter),
            LoadError::Duration => write!(formatter, "the duration is outside {SHORTEST} to {LONGEST} s"),
            LoadError::Posture(end, joint) => {
                write!(formatter, "J{} of the {end} posture lies outside its soft limits", joint + 1)
            }
            LoadError::OutOfReach(end) => write!(formatter, "the {end} position is out of reach"),
            LoadError::Inconsistent(end) => {
                write!(formatter, "the {end} pose does not belong to the {end} posture on this arm")
            }
        }
    }
}

impl core::error::Error for LoadError {}

/// Checks tables and builds the primitive.
///
/// # Errors
/// [`LoadError`] names what is wrong; nothing is changed.
pub fn primitive<R: Real, const N: usize>(
    model: &ArmModel<R>,
    tables: &PrimitiveTables<'_, R>,
) -> Result<Primitive<R, N>, LoadError> {
    let primitive = Primitive::new(tables).map_err(LoadError::Primitive)?;
    check(model, &primitive)?;
    Ok(primitive)
}

/// Checks a primitive against this arm.
///
/// # Errors
/// As [`primitive`].
pub fn check<R: Real, const N: usize>(model: &ArmModel<R>, primitive: &Primitive<R, N>) -> Result<(), LoadError> {
    let duration = primitive.duration();
    if !(duration >= R::of(SHORTEST) && duration <= R::of(LONGEST)) {
        return Err(LoadError::Duration);
    }
    check_end(model, End::Start, primitive.start())?;
    check_end(model, End::Goal, primitive.goal())
}

fn check_end<R: Real>(model: &ArmModel<R>, end: End, configuration: &Configuration<R>) -> Result<(), LoadError> {
    let limits = model.soft_min.iter().zip(&model.soft_max);
    for (joint, (q, (min, max))) in (0u8..).zip(configuration.posture.iter().zip(limits)) {
        if !(q >= min && q <= max) {
            return Err(LoadError::Posture(end, joint));
        }
    }
    let position = nalgebra::Vector3::from(configuration.position);
    if !within_reach(&position) {
        return Err(LoadError::OutOfReach(end));
    }
    let pose = Frames::new(model, &JointPositions::from_array(configuration.posture)).tool_pose();
    let orientation = Orientation(configuration.orientation.to_array());
    let (offset, turn) = (pose.position - position, pose.orientation.error_to(&orientation));
    let near = offset.dot(&offset) <= R::of(POSE_MISMATCH * POSE_MISMATCH);
    let aligned = turn.dot(&turn) <= R::of(TURN_MISMATCH * TURN_MISMATCH);
    if near && aligned { Ok(()) } else { Err(LoadError::Inconsistent(end)) }
}

/// Whether a tool position can be reached at all. False for a NaN.
pub fn within_reach<R: Real>(position: &nalgebra::Vector3<R>) -> bool {
    position.dot(position) <= R::of(REACH * REACH)
}

/// Why a primitive was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoadRefusal {
    /// A run is in progress.
    Running,
    /// This arm cannot run it.
    Unfit(LoadError),
}

impl fmt::Display for LoadRefusal {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            LoadRefusal::Running => formatter.write_str("a run is in progress"),
            LoadRefusal::Unfit(error) => error.fmt(formatter),
        }
    }
}

impl core::error::Error for LoadRefusal {}
