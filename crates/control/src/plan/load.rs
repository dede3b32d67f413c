//! Plain tables to a checked primitive that this arm can run.
//!
//! `dmp` checks what any movement has to satisfy; here comes what this arm adds: postures within the soft limits, poses
//! within reach, a start pose that belongs to the start posture, a duration and a speed that are allowed near people.

use core::fmt;

use dmp::PrimitiveError;
use pinned_init::{Init, init};

use crate::model::arm::ArmModel;
use crate::model::kinematics::Frames;
use crate::model::wam7;
use crate::plan::bounds::{self, Quantity};
use crate::plan::primitive::{Configuration, MovementTables, Primitive, posture_and_hand, write_error};
use crate::real::Real;
use crate::units::{JointPositions, Orientation};

/// Shortest movement (s).
pub const SHORTEST_MOVEMENT: f64 = 0.5;
/// Longest movement (s).
pub const LONGEST_MOVEMENT: f64 = 120.0;
/// Farthest tool position from the shoulder (m): the outstretched arm with its hand reaches 1.04 m.
pub const REACH: f64 = 1.05;
/// Largest distance between the taught pose and the pose of the taught posture (m).
pub const POSE_MISMATCH: f64 = 0.05;
/// Largest angle between them (rad): 10 degrees.
pub const TURN_MISMATCH: f64 = 0.175;

/// Largest force that a primitive may expect (N): three quarters of what stops a movement. A person may be in between.
pub const EXPECTED_FORCE: f64 = 50.0;

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
    /// A sensor (0 = force x) is expected to measure more than [`EXPECTED_FORCE`], or more than it can.
    Expected(u8),
    /// A number of the image, or of the plan that it gives, is beyond its bound.
    Bound(Quantity),
}

impl fmt::Display for LoadError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            LoadError::Primitive(error) => write_error(error, formatter),
            LoadError::Duration => {
                write!(formatter, "the duration is outside {SHORTEST_MOVEMENT} to {LONGEST_MOVEMENT} s")
            }
            LoadError::Posture(end, joint) => {
                write!(formatter, "J{} of the {end} posture lies outside its soft limits", joint + 1)
            }
            LoadError::OutOfReach(end) => write!(formatter, "the {end} position is out of reach"),
            LoadError::Inconsistent(end) => {
                write!(formatter, "the {end} pose does not belong to the {end} posture on this arm")
            }
            LoadError::Expected(0..3) => write!(formatter, "a force of more than {EXPECTED_FORCE} N is expected"),
            LoadError::Expected(_) => formatter.write_str("a torque is expected that the sensor cannot measure"),
            LoadError::Bound(quantity) => quantity.fmt(formatter),
        }
    }
}

impl core::error::Error for LoadError {}

/// A primitive that an arm can run: the word of [`check`], which alone gives it, and what
/// [`Cycle::load`](crate::Cycle::load) asks for. The check costs two forward kinematics and belongs where there is
/// time; taking the primitive over is then a copy.
#[derive(Debug)]
pub struct CheckedPrimitive<'a, R: Real, const N: usize> {
    primitive: &'a Primitive<R, N>,
    tool: Tool<R>,
}

impl<'a, R: Real, const N: usize> CheckedPrimitive<'a, R, N> {
    /// The primitive.
    pub fn primitive(&self) -> &'a Primitive<R, N> {
        self.primitive
    }

    /// True if it was checked for an arm with the tool of this one. Nothing else of an arm that a check looks at can
    /// differ: links and limits are constants of the model.
    pub(crate) fn is_for(&self, model: &ArmModel<R>) -> bool {
        self.tool == Tool::of(model)
    }
}

/// The place of the primitive that the next run plays. It is there from the beginning, so that the first one is copied
/// into it as every other, and not also built and moved: 23 kB take some time.
pub(crate) struct Loaded<R: Real, const N: usize> {
    primitive: Primitive<R, N>,
    present: bool,
}

impl<R: Real, const N: usize> Loaded<R, N> {
    /// Makes an empty place where it is.
    pub(crate) fn init() -> impl Init<Self> {
        init!(Loaded { primitive: Primitive::PLACEHOLDER, present: false })
    }

    /// The primitive, if there is one.
    pub(crate) fn get(&self) -> Option<&Primitive<R, N>> {
        self.present.then_some(&self.primitive)
    }

    /// Copies a primitive here.
    pub(crate) fn put(&mut self, fit: &CheckedPrimitive<'_, R, N>) {
        self.primitive.clone_from(fit.primitive);
        self.present = true;
    }

    /// Forgets it.
    pub(crate) fn clear(&mut self) {
        self.present = false;
    }
}

/// Where the tool frame is on the tool plate, which depends on what is mounted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Tool<R> {
    height: R,
    cosine: R,
    sine: R,
}

impl<R: Real> Tool<R> {
    /// That of this arm.
    pub(crate) fn of(model: &ArmModel<R>) -> Self {
        Tool { height: model.tool_height, cosine: model.tool_cosine, sine: model.tool_sine }
    }
}

/// Checks tables and builds the primitive.
///
/// # Errors
/// [`LoadError`] names what is wrong; nothing is changed.
pub fn primitive<R: Real, const N: usize>(
    model: &ArmModel<R>,
    tables: &MovementTables<'_, R>,
) -> Result<Primitive<R, N>, LoadError> {
    let primitive = Primitive::new(tables).map_err(LoadError::Primitive)?;
    check(model, &primitive)?;
    Ok(primitive)
}

/// Checks a primitive against this arm.
///
/// # Errors
/// As [`primitive`].
pub fn check<'a, R: Real, const N: usize>(
    model: &ArmModel<R>,
    primitive: &'a Primitive<R, N>,
) -> Result<CheckedPrimitive<'a, R, N>, LoadError> {
    let duration = primitive.movement().duration();
    if !(duration >= R::constant(SHORTEST_MOVEMENT) && duration <= R::constant(LONGEST_MOVEMENT)) {
        return Err(LoadError::Duration);
    }
    check_end(model, End::Start, primitive.movement().start())?;
    check_end(model, End::Goal, primitive.movement().goal())?;
    check_expected(primitive)?;
    bounds::check(primitive).map_err(LoadError::Bound)?;
    Ok(CheckedPrimitive { primitive, tool: Tool::of(model) })
}

/// A run presses with what it expects, so that is bounded like a command.
fn check_expected<R: Real, const N: usize>(primitive: &Primitive<R, N>) -> Result<(), LoadError> {
    let [n1, n2, n3] = wam7::SENSOR_TORQUE_RANGE;
    let finger = wam7::FINGER_TORQUE_MAX;
    let limits = [EXPECTED_FORCE, EXPECTED_FORCE, EXPECTED_FORCE, n1, n2, n3, finger, finger, finger].map(R::constant);
    for sample in primitive.expected().into_iter().flat_map(|expected| expected.samples()) {
        for (sensor, (value, limit)) in (0u8..).zip(sample.iter().zip(&limits)) {
            // Of a NaN neither holds.
            let within = *value >= -*limit && value <= limit;
            if !within {
                return Err(LoadError::Expected(sensor));
            }
        }
        let [x, y, z, ..] = *sample;
        let within = x * x + y * y + z * z <= R::constant(EXPECTED_FORCE * EXPECTED_FORCE);
        if !within {
            return Err(LoadError::Expected(0));
        }
    }
    Ok(())
}

fn check_end<R: Real>(model: &ArmModel<R>, end: End, configuration: &Configuration<R>) -> Result<(), LoadError> {
    let ([taught], (posture, _)) = (&configuration.poses, posture_and_hand(&configuration.points));
    let limits = model.soft_min.iter().zip(&model.soft_max);
    for (joint, (q, (min, max))) in (0u8..).zip(posture.iter().zip(limits)) {
        if !(q >= min && q <= max) {
            return Err(LoadError::Posture(end, joint));
        }
    }
    let position = nalgebra::Vector3::from(taught.position);
    if !within_reach(&position) {
        return Err(LoadError::OutOfReach(end));
    }
    let pose = Frames::new(model, &JointPositions::from_array(posture)).tool_pose();
    let orientation = Orientation(taught.orientation.to_array());
    let (offset, turn) = (pose.position - position, pose.orientation.error_to(&orientation));
    let near = offset.dot(&offset) <= R::constant(POSE_MISMATCH * POSE_MISMATCH);
    let aligned = turn.dot(&turn) <= R::constant(TURN_MISMATCH * TURN_MISMATCH);
    if near && aligned { Ok(()) } else { Err(LoadError::Inconsistent(end)) }
}

/// True if a tool position can be reached at all. False for a NaN.
pub fn within_reach<R: Real>(position: &nalgebra::Vector3<R>) -> bool {
    position.dot(position) <= R::constant(REACH * REACH)
}

/// Why a primitive was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoadRefusal {
    /// A run is in progress.
    Running,
    /// It was checked for an arm with another tool: what is mounted has been found to be something else meanwhile.
    OtherTool,
}

impl fmt::Display for LoadRefusal {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            LoadRefusal::Running => formatter.write_str("a run is in progress"),
            LoadRefusal::OtherTool => formatter.write_str("it was checked for an arm with another tool"),
        }
    }
}

impl core::error::Error for LoadRefusal {}
