//! Hands a demonstration to `dmp::fit` and turns what comes back into the content of a primitive file.

use dmp::fit::{Demonstration as Samples, FitOptions};
use dmp::{Configuration, OrientationError, Quaternion};

use super::{LearnOptions, feedback};
use crate::demonstration::{Demonstration, RATE};
use crate::primitive_file::{Gain, HemisphereKind, OrientationErrorKind, PrimitiveFile, Waypoint, WaypointVelocity};

/// The fitted primitive, without name and provenance.
pub(super) fn fit(
    demonstration: &Demonstration,
    posture: &[[f64; 7]],
    hand: &[[f64; 4]],
    options: &LearnOptions,
) -> Result<PrimitiveFile, String> {
    let orientation = demonstration.orientation.iter().map(|[w, x, y, z]| Quaternion::new(*w, *x, *y, *z)).collect();
    let samples =
        Samples::new(1.0 / RATE, demonstration.position.clone(), orientation, posture.to_vec(), hand.to_vec())
            .map_err(|error| error.to_string())?;
    let learned = dmp::fit::fit(
        &samples,
        &FitOptions {
            kernel_count: options.kernels,
            cutoff: Some(options.cutoff),
            stiffness: feedback::stiffness(&options.feedback, samples.duration()),
            orientation_error: match options.orientation_error {
                OrientationErrorKind::Quaternion => OrientationError::Quaternion,
                OrientationErrorKind::RotationVector => OrientationError::RotationVector,
            },
            ..FitOptions::default()
        },
    )
    .map_err(|error| error.to_string())?;
    let gains: [Gain; 4] = std::array::from_fn(|group| Gain {
        stiffness: learned.options.stiffness[group],
        damping: learned.damping[group],
    });
    Ok(PrimitiveFile {
        file: std::path::PathBuf::new(),
        name: String::new(),
        model_hash: 0,
        duration: learned.duration,
        alpha: learned.options.alpha,
        activation: learned.options.activation,
        orientation_error: options.orientation_error,
        hemisphere: HemisphereKind::Demonstrated,
        gains,
        start: waypoint(&learned.start),
        start_velocity: WaypointVelocity {
            position: learned.start_velocity.position,
            orientation: learned.start_velocity.orientation,
            posture: learned.start_velocity.posture,
            hand: learned.start_velocity.hand,
        },
        goal: waypoint(&learned.goal),
        weights: learned.weights.chunks(learned.options.kernel_count).map(<[f64]>::to_vec).collect(),
        feedback: None,
        expectation: None,
        experience: None,
        provenance: None,
    })
}

fn waypoint(configuration: &Configuration<f64>) -> Waypoint {
    Waypoint {
        position: configuration.position,
        orientation: configuration.orientation.to_array(),
        posture: configuration.posture,
        hand: configuration.hand,
    }
}
