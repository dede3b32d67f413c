//! From an image in the store to the primitive the control half runs.

use control::model::ArmModel;
use control::plan::bounds;
use control::plan::load;
use control::plan::load::LoadError;
use control::plan::primitive::{self, Configuration, MovementTables, configuration, gains, limits, velocity};
use link::Refusal;
use link::image::{
    EXPECTATION_POINTS_LIMIT, GAIN_POINTS_LIMIT, ImageContent, KERNEL_LIMIT, Reals, STATISTICS_POINTS_LIMIT,
    STATISTICS_ROWS, WEIGHT_ROWS, Waypoint,
};

use crate::application::Refused;
use crate::port::{CheckedPrimitive, StoredPrimitive};
use crate::recorded_filter::{self, OtherFilter};
use crate::wire::PrimitiveDefect;

// The image's limits must not exceed what the control half can hold; a table that does not fit would be refused
// only after its upload.
const _: () = assert!(KERNEL_LIMIT <= control::MAX_KERNELS);
const _: () = assert!(GAIN_POINTS_LIMIT <= primitive::GAIN_CAPACITY);
const _: () = assert!(EXPECTATION_POINTS_LIMIT <= primitive::EXPECTED_CAPACITY);
const _: () = assert!(STATISTICS_POINTS_LIMIT <= primitive::STATISTICS_CAPACITY);
const _: () = assert!(STATISTICS_ROWS == primitive::STATISTICS_CHANNELS);

/// Buffer to copy the weights into, because those of an image are not aligned.
pub(crate) type WeightBuffer = [f32; WEIGHT_ROWS * KERNEL_LIMIT];

/// Why an image is not a primitive for this device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unfit {
    /// Its content is outside what the controller accepts.
    Content(PrimitiveDefect),
    /// Its expectation was recorded through another filter.
    Filter(OtherFilter),
}

impl From<PrimitiveDefect> for Unfit {
    fn from(defect: PrimitiveDefect) -> Self {
        Self::Content(defect)
    }
}

impl From<Unfit> for Refused {
    fn from(unfit: Unfit) -> Self {
        match unfit {
            Unfit::Content(defect) => (Refusal::PrimitiveInvalid, defect.0),
            Unfit::Filter(other) => other.into(),
        }
    }
}

/// Makes `primitive` that of the content, in place (it has 23 kB, the stack has 64), and checks it against the arm:
/// last, so that nothing can change between the check and the copy that its result allows.
///
/// # Errors
/// [`Unfit`]; what `primitive` holds then is of no use.
pub(crate) fn build<'a>(
    model: &ArmModel<f32>,
    content: &ImageContent<Reals<'_>>,
    weights_buffer: &mut WeightBuffer,
    primitive: &'a mut StoredPrimitive,
) -> Result<CheckedPrimitive<'a>, Unfit> {
    let recorded = !content.expected_mean.is_empty() || !content.statistics_mean.is_empty();
    if recorded {
        recorded_filter::check(content.marks.filter_cutoff).map_err(Unfit::Filter)?;
    }
    let marks = &content.marks;
    bounds::check_marks(marks.payload_mass, &marks.payload_centre, marks.trials, marks.spread_floor)
        .map_err(|quantity| PrimitiveDefect::from(LoadError::Bound(quantity)))?;
    let weights = content.weights.copy_to(weights_buffer).unwrap_or_default();
    let start_velocity = &content.start_velocity;
    let tables = MovementTables {
        control_period: control::PERIOD as f32,
        duration: content.duration,
        alpha: content.alpha,
        activation: content.activation,
        kernel_count: content.kernels,
        weights,
        gains: gains(content.stiffness, content.damping),
        orientation_error: content.orientation_error,
        hemisphere: content.hemisphere,
        start: waypoint(&content.start),
        goal: waypoint(&content.goal),
        start_velocity: velocity(
            start_velocity.position,
            start_velocity.orientation,
            start_velocity.posture,
            start_velocity.hand,
        ),
    };
    primitive.assign(&tables).map_err(|error| PrimitiveDefect::from(LoadError::Primitive(error)))?;
    if !content.k1.is_empty() {
        let clamps = &content.clamps;
        let limits = limits(clamps.position, clamps.orientation, clamps.hand);
        primitive.assign_feedback(content.k1.iter(), content.k2.iter(), limits).map_err(PrimitiveDefect::feedback)?;
    }
    if !content.expected_mean.is_empty() {
        primitive
            .assign_expected(content.expected_mean.iter(), content.marks.recorded_duration)
            .map_err(PrimitiveDefect::expectation)?;
    }
    if !content.statistics_mean.is_empty() {
        let (mean, spread) = (content.statistics_mean.iter(), content.statistics_spread.iter());
        primitive.assign_statistics(mean, spread, content.statistics_trials).map_err(PrimitiveDefect::statistics)?;
    }
    load::check(model, primitive).map_err(|error| PrimitiveDefect::from(error).into())
}

fn waypoint(waypoint: &Waypoint) -> Configuration<f32> {
    configuration(waypoint.position, waypoint.orientation, waypoint.posture, waypoint.hand)
}
