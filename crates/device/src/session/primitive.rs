//! From an image in the store to the primitive the control half runs.

use control::arm::ArmModel;
use control::load;
use dmp::{
    Configuration, ExpectedWrench, Feedback, GainSchedule, Hemisphere, Limits, OrientationError, PrimitiveTables,
    Quaternion, SENSORS, Velocity,
};
use link::image::{
    COUPLED_ROWS, EXPECTATION_POINTS_LIMIT, GAIN_POINTS_LIMIT, HemisphereKind, ImageContent, KERNEL_LIMIT,
    OrientationErrorKind, Reals, WEIGHT_ROWS, Waypoint,
};

use super::wire::{PrimitiveTrouble, TROUBLE_EXPECTATION, TROUBLE_FEEDBACK};
use crate::port::StoredPrimitive;

// The image's limits must not exceed what the control half can hold; a table that does not fit would be refused
// only after its upload.
const _: () = assert!(KERNEL_LIMIT <= control::MAX_KERNELS);
const _: () = assert!(GAIN_POINTS_LIMIT <= dmp::GAIN_CAPACITY);
const _: () = assert!(EXPECTATION_POINTS_LIMIT <= dmp::EXPECTED_CAPACITY);

/// Room to copy the weights into, because those of an image are not aligned.
pub(crate) type WeightRoom = [f32; WEIGHT_ROWS * KERNEL_LIMIT];

/// Checks the content against the arm and builds the primitive.
pub(crate) fn build(
    model: &ArmModel<f32>,
    content: &ImageContent<Reals<'_>>,
    room: &mut WeightRoom,
) -> Result<StoredPrimitive, PrimitiveTrouble> {
    let weights = content.weights.copy_to(room).unwrap_or_default();
    let velocity = &content.start_velocity;
    let tables = PrimitiveTables {
        duration: content.duration,
        alpha: content.alpha,
        activation: content.activation,
        kernel_count: content.kernels,
        weights,
        stiffness: content.stiffness,
        damping: content.damping,
        orientation_error: match content.orientation_error {
            OrientationErrorKind::QuaternionDifference => OrientationError::Quaternion,
            OrientationErrorKind::RotationVector => OrientationError::RotationVector,
        },
        hemisphere: match content.hemisphere {
            HemisphereKind::Demonstrated => Hemisphere::Demonstrated,
            HemisphereKind::Nearest => Hemisphere::Nearest,
        },
        start: configuration(&content.start),
        goal: configuration(&content.goal),
        start_velocity: Velocity {
            position: velocity.position,
            orientation: velocity.orientation,
            posture: velocity.posture,
            hand: velocity.hand,
        },
        feedback: feedback(content)?,
        expected: expectation(content)?,
    };
    load::primitive(model, &tables).map_err(PrimitiveTrouble::from)
}

fn configuration(waypoint: &Waypoint) -> Configuration<f32> {
    let [w, x, y, z] = waypoint.orientation;
    Configuration {
        position: waypoint.position,
        orientation: Quaternion::new(w, x, y, z),
        posture: waypoint.posture,
        hand: waypoint.hand,
    }
}

fn feedback(content: &ImageContent<Reals<'_>>) -> Result<Option<Feedback<f32>>, PrimitiveTrouble> {
    if content.k1.is_empty() {
        return Ok(None);
    }
    let mut k1 = [[0.0; COUPLED_ROWS]; GAIN_POINTS_LIMIT];
    let mut k2 = [[0.0; SENSORS]; GAIN_POINTS_LIMIT];
    let limits = Limits {
        displacement: content.clamps.position,
        rotation: content.clamps.orientation,
        hand: content.clamps.hand,
    };
    GainSchedule::new(points(content.k1, &mut k1))
        .and_then(|k1| Feedback::new(k1, GainSchedule::new(points(content.k2, &mut k2))?, limits))
        .map(Some)
        .map_err(|_| TROUBLE_FEEDBACK)
}

fn expectation(content: &ImageContent<Reals<'_>>) -> Result<Option<ExpectedWrench<f32>>, PrimitiveTrouble> {
    if content.expected_mean.is_empty() {
        return Ok(None);
    }
    let mut mean = [[0.0; SENSORS]; EXPECTATION_POINTS_LIMIT];
    ExpectedWrench::new(points(content.expected_mean, &mut mean), content.marks.recorded_duration)
        .map(Some)
        .map_err(|_| TROUBLE_EXPECTATION)
}

/// Copies a table, point after point, to the front of `room`.
fn points<'a, const COLUMNS: usize>(table: Reals<'_>, room: &'a mut [[f32; COLUMNS]]) -> &'a [[f32; COLUMNS]] {
    let count = (table.len() / COLUMNS).min(room.len());
    let used = room.get_mut(..count).unwrap_or_default();
    for (place, value) in used.as_flattened_mut().iter_mut().zip(table.iter()) {
        *place = value;
    }
    used
}
