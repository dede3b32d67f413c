//! Hands a demonstration to `dmp::fit` and turns what comes back into the content of a primitive file.

use control::plan::primitive::{Configuration, points, posture_and_hand};
use dmp::fit::{Demonstration as Samples, FitOptions, PoseSamples};
use dmp::{Hemisphere, Quaternion, Stiffness};
use serde::de::IgnoredAny;

use super::{LearnOptions, feedback};
use crate::demonstration::{Demonstration, RATE};
use crate::primitive_file::{Groups, MovementSection, PrimitiveFile, Waypoint, WaypointVelocity};

/// The fitted primitive, without name and provenance.
pub(super) fn fit(
    demonstration: &Demonstration,
    posture: &[[f64; 7]],
    hand: &[[f64; 4]],
    options: &LearnOptions,
) -> Result<PrimitiveFile, String> {
    let orientation = demonstration.orientation.iter().map(|[w, x, y, z]| Quaternion::new(*w, *x, *y, *z)).collect();
    let pose = PoseSamples { position: demonstration.position.clone(), orientation };
    let rows = posture.iter().zip(hand).map(|(posture, hand)| points(*posture, *hand)).collect();
    let samples = Samples::new(1.0 / RATE, [pose], rows).map_err(|error| error.to_string())?;
    let [position, orientation, posture, hand] = feedback::stiffness(&options.feedback, samples.duration());
    let learned = dmp::fit::fit(
        &samples,
        &FitOptions {
            kernel_count: options.kernels,
            // What trembled while it was shown trembles that much faster now.
            cutoff: Some(options.cutoff * options.speed),
            control_period: Some(control::PERIOD),
            stiffness: Stiffness { poses: [[position, orientation]], points: points([posture; 7], [hand; 4]) },
            orientation_error: options.orientation_error,
            ..FitOptions::default()
        },
    )
    .map_err(|error| error.to_string())?;
    let ([gains], ([posture, ..], [hand, ..])) = (learned.gains.poses, posture_and_hand(&learned.gains.points));
    let [twist] = learned.start_velocity.poses;
    let (posture_velocity, hand_velocity) = posture_and_hand(&learned.start_velocity.points);
    let rows: Vec<Vec<f64>> = learned.weights.chunks(learned.options.kernel_count).map(<[f64]>::to_vec).collect();
    let group = |rows: &[Vec<f64>]| rows.to_vec();
    Ok(PrimitiveFile {
        file: std::path::PathBuf::new(),
        schema: IgnoredAny,
        content_crc32: IgnoredAny,
        name: String::new(),
        model_hash: 0,
        movement: MovementSection {
            duration: learned.duration,
            alpha: learned.options.alpha,
            activation: learned.options.activation,
            kernels: learned.options.kernel_count,
            orientation_error: options.orientation_error,
            hemisphere: Hemisphere::Demonstrated,
        },
        gains: Groups { position: gains.position, orientation: gains.orientation, posture, hand },
        start: waypoint(&learned.start),
        start_velocity: WaypointVelocity {
            position: twist.linear,
            orientation: twist.angular,
            posture: posture_velocity,
            hand: hand_velocity,
        },
        goal: waypoint(&learned.goal),
        weights: Groups {
            position: group(&rows[..3]),
            orientation: group(&rows[3..6]),
            posture: group(&rows[6..13]),
            hand: group(&rows[13..]),
        },
        feedback: None,
        expectation: None,
        statistics: None,
        provenance: None,
    })
}

fn waypoint(configuration: &Configuration<f64>) -> Waypoint {
    let ([pose], (posture, hand)) = (&configuration.poses, posture_and_hand(&configuration.points));
    Waypoint { position: pose.position, orientation: pose.orientation.to_array(), posture, hand }
}
