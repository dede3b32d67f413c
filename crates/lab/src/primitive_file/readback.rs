//! From the image that a device stores back to a file.

use std::path::Path;

use dmp::Gain;
use link::PrimitiveImage;
use link::image::{COUPLED_ROWS, Reals, SENSOR_ROWS, STATISTICS_ROWS};
use serde::de::IgnoredAny;

use super::{
    ExpectationTable, FeedbackTables, GROUPS, Groups, MovementSection, PrimitiveFile, StatisticsTable, Waypoint,
    WaypointVelocity,
};

impl PrimitiveFile {
    /// The file of a stored image: the same numbers in the image's single precision, so that uploading it gives the
    /// same image. What an image does not hold is missing: provenance, and the spread of the expectation.
    pub fn from_image(file: &Path, image: &PrimitiveImage<'_>) -> PrimitiveFile {
        let content = image.content();
        let real = f64::from;
        let marks = &content.marks;
        let mut rows = table(&content.weights, content.kernels).into_iter();
        let mut group = |count: usize| rows.by_ref().take(count).collect();
        let weights = Groups {
            position: group(GROUPS.position.1),
            orientation: group(GROUPS.orientation.1),
            posture: group(GROUPS.posture.1),
            hand: group(GROUPS.hand.1),
        };
        let [position, orientation, posture, hand] = std::array::from_fn(|at| Gain {
            stiffness: real(content.stiffness[at]),
            damping: real(content.damping[at]),
        });
        PrimitiveFile {
            file: file.to_owned(),
            schema: IgnoredAny,
            content_crc32: IgnoredAny,
            name: image.name().to_string(),
            model_hash: content.model_hash,
            movement: MovementSection {
                duration: real(content.duration),
                alpha: real(content.alpha),
                activation: real(content.activation),
                kernels: content.kernels,
                orientation_error: content.orientation_error,
                hemisphere: content.hemisphere,
            },
            gains: Groups { position, orientation, posture, hand },
            start: waypoint(&content.start),
            start_velocity: WaypointVelocity {
                position: content.start_velocity.position.map(real),
                orientation: content.start_velocity.orientation.map(real),
                posture: content.start_velocity.posture.map(real),
                hand: content.start_velocity.hand.map(real),
            },
            goal: waypoint(&content.goal),
            weights,
            feedback: (!content.k1.is_empty()).then(|| FeedbackTables {
                clamp_position: real(content.clamps.position),
                clamp_orientation: real(content.clamps.orientation),
                clamp_hand: real(content.clamps.hand),
                k1: table(&content.k1, COUPLED_ROWS),
                k2: table(&content.k2, SENSOR_ROWS),
            }),
            expectation: image.has_expectation().then(|| ExpectationTable {
                // An image has one model for all of it: a file with two is not made into one.
                model_hash: content.model_hash,
                recorded_duration: real(marks.recorded_duration),
                payload_mass: real(marks.payload_mass),
                payload_centre: marks.payload_centre.map(real),
                filter_cutoff: real(marks.filter_cutoff),
                trials: marks.trials as u32,
                spread_floor: real(marks.spread_floor),
                mean: table(&content.expected_mean, SENSOR_ROWS),
                spread: Vec::new(),
            }),
            statistics: image.has_statistics().then(|| StatisticsTable {
                trials: content.statistics_trials.into(),
                mean: table(&content.statistics_mean, STATISTICS_ROWS),
                spread: table(&content.statistics_spread, STATISTICS_ROWS),
            }),
            provenance: None,
        }
    }
}

/// Reals as rows of so many columns.
fn table(reals: &Reals<'_>, columns: usize) -> Vec<Vec<f64>> {
    let all: Vec<f64> = reals.iter().map(f64::from).collect();
    all.chunks(columns.max(1)).map(<[f64]>::to_vec).collect()
}

fn waypoint(stored: &link::image::Waypoint) -> Waypoint {
    Waypoint {
        position: stored.position.map(f64::from),
        orientation: stored.orientation.map(f64::from),
        posture: stored.posture.map(f64::from),
        hand: stored.hand.map(f64::from),
    }
}
