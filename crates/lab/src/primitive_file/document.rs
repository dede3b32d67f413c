//! The shape of the text: what serde reads, turned into a [`PrimitiveFile`].

use std::path::Path;

use serde::Deserialize;

use super::{
    ExpectationTable, ExperienceTable, FeedbackTables, Gain, HemisphereKind, OrientationErrorKind, PrimitiveFile,
    PrimitiveFileError, Provenance, SCHEMA, Waypoint, WaypointVelocity,
};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    schema: String,
    name: String,
    model_hash: String,
    content_crc32: String,
    movement: MovementSection,
    gains: GainsSection,
    start: WaypointSection,
    start_velocity: VelocitySection,
    goal: WaypointSection,
    weights: WeightsSection,
    feedback: Option<FeedbackSection>,
    expectation: Option<ExpectationSection>,
    experience: Option<ExperienceSection>,
    provenance: Option<ProvenanceSection>,
}

/// Read before everything else, so that a file of another version is named as such.
#[derive(Deserialize)]
struct SchemaOnly {
    schema: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MovementSection {
    duration_s: f64,
    alpha: f64,
    activation: f64,
    kernels: usize,
    orientation_error: String,
    hemisphere: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GainsSection {
    position: GainSection,
    orientation: GainSection,
    posture: GainSection,
    hand: GainSection,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GainSection {
    stiffness: f64,
    damping: f64,
}

impl From<GainSection> for Gain {
    fn from(section: GainSection) -> Gain {
        Gain { stiffness: section.stiffness, damping: section.damping }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WaypointSection {
    position_m: [f64; 3],
    orientation_wxyz: [f64; 4],
    posture_rad: [f64; 7],
    hand_rad: [f64; 4],
}

impl From<WaypointSection> for Waypoint {
    fn from(section: WaypointSection) -> Waypoint {
        Waypoint {
            position: section.position_m,
            orientation: section.orientation_wxyz,
            posture: section.posture_rad,
            hand: section.hand_rad,
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct VelocitySection {
    position_m_s: [f64; 3],
    orientation_rad_s: [f64; 3],
    posture_rad_s: [f64; 7],
    hand_rad_s: [f64; 4],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WeightsSection {
    position: Vec<Vec<f64>>,
    orientation: Vec<Vec<f64>>,
    posture: Vec<Vec<f64>>,
    hand: Vec<Vec<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FeedbackSection {
    clamp_position_m: f64,
    clamp_orientation_rad: f64,
    clamp_hand_rad: f64,
    k1: Vec<Vec<f64>>,
    k2: Vec<Vec<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ExpectationSection {
    model_hash: String,
    recorded_duration_s: f64,
    payload_mass_kg: f64,
    payload_centre_m: [f64; 3],
    filter_cutoff_hz: f64,
    trials: u32,
    spread_floor: f64,
    mean: Vec<Vec<f64>>,
    spread: Vec<Vec<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ExperienceSection {
    trials: u32,
    mean: Vec<Vec<f64>>,
    spread: Vec<Vec<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ProvenanceSection {
    demonstration: String,
    demonstration_crc32: String,
    samples: usize,
    trimmed_s: [f64; 2],
    largest_angle_rad: f64,
    position_error_m: [f64; 2],
    orientation_error_rad: [f64; 2],
    posture_error_rad: [f64; 2],
    tool: String,
}

/// Reads text; gives the primitive and the check sum that stands in the file.
pub(super) fn parse(file: &Path, text: &str) -> Result<(PrimitiveFile, u32), PrimitiveFileError> {
    let syntax = |error: toml::de::Error| PrimitiveFileError::Syntax {
        file: file.to_owned(),
        message: error.to_string().trim_end().to_owned(),
    };
    let schema: SchemaOnly = toml::from_str(text).map_err(syntax)?;
    if schema.schema != SCHEMA {
        return Err(PrimitiveFileError::Schema { file: file.to_owned(), found: schema.schema, expected: SCHEMA });
    }
    let document: Document = toml::from_str(text).map_err(syntax)?;
    debug_assert_eq!(document.schema, SCHEMA);
    let hexadecimal = |key: &'static str, found: &str| {
        found.strip_prefix("0x").and_then(|digits| u32::from_str_radix(digits, 16).ok()).ok_or_else(|| {
            PrimitiveFileError::Word {
                file: file.to_owned(),
                key,
                found: found.to_owned(),
                expected: "a hexadecimal number of up to 8 digits, as in \"0x1234abcd\"",
            }
        })
    };
    let movement = &document.movement;
    let orientation_error = match movement.orientation_error.as_str() {
        "quaternion" => OrientationErrorKind::Quaternion,
        "rotation-vector" => OrientationErrorKind::RotationVector,
        other => {
            return Err(PrimitiveFileError::Word {
                file: file.to_owned(),
                key: "movement.orientation_error",
                found: other.to_owned(),
                expected: "\"quaternion\" or \"rotation-vector\"",
            });
        }
    };
    let hemisphere = match movement.hemisphere.as_str() {
        "demonstrated" => HemisphereKind::Demonstrated,
        "nearest" => HemisphereKind::Nearest,
        other => {
            return Err(PrimitiveFileError::Word {
                file: file.to_owned(),
                key: "movement.hemisphere",
                found: other.to_owned(),
                expected: "\"demonstrated\" or \"nearest\"",
            });
        }
    };
    if let Err(error) = link::Name::new(&document.name) {
        return Err(PrimitiveFileError::Word {
            file: file.to_owned(),
            key: "name",
            found: document.name,
            expected: match error {
                link::NameError::Empty => "a name: it is empty",
                link::NameError::TooLong => "a name of at most 32 characters",
                link::NameError::BadCharacter => {
                    "a name of letters, digits, '-', '_' and '.', starting with a letter, digit or '_'"
                }
            },
        });
    }
    let weights = &document.weights;
    let groups = [&weights.position, &weights.orientation, &weights.posture, &weights.hand];
    for ((group, rows), found) in super::GROUPS.iter().zip(groups) {
        if found.len() != *rows {
            return Err(PrimitiveFileError::Shape {
                file: file.to_owned(),
                key: format!("weights.{group}"),
                found: found.len(),
                expected: *rows,
            });
        }
    }
    let kernels = weights.position[0].len();
    if kernels != movement.kernels {
        return Err(PrimitiveFileError::Shape {
            file: file.to_owned(),
            key: "weights.position, row 1".to_owned(),
            found: kernels,
            expected: movement.kernels,
        });
    }
    let stored = hexadecimal("content_crc32", &document.content_crc32)?;
    let provenance = document
        .provenance
        .map(|section| -> Result<Provenance, PrimitiveFileError> {
            Ok(Provenance {
                demonstration_checksum: hexadecimal("provenance.demonstration_crc32", &section.demonstration_crc32)?,
                demonstration: section.demonstration,
                samples: section.samples,
                trimmed: section.trimmed_s,
                largest_angle: section.largest_angle_rad,
                position_error: section.position_error_m,
                orientation_error: section.orientation_error_rad,
                posture_error: section.posture_error_rad,
                tool: section.tool,
            })
        })
        .transpose()?;
    let expectation = document
        .expectation
        .map(|section| -> Result<ExpectationTable, PrimitiveFileError> {
            Ok(ExpectationTable {
                model_hash: hexadecimal("expectation.model_hash", &section.model_hash)?,
                recorded_duration: section.recorded_duration_s,
                payload_mass: section.payload_mass_kg,
                payload_centre: section.payload_centre_m,
                filter_cutoff: section.filter_cutoff_hz,
                trials: section.trials,
                spread_floor: section.spread_floor,
                mean: section.mean,
                spread: section.spread,
            })
        })
        .transpose()?;
    let gains = document.gains;
    let velocity = document.start_velocity;
    let primitive = PrimitiveFile {
        file: file.to_owned(),
        name: document.name,
        model_hash: hexadecimal("model_hash", &document.model_hash)?,
        duration: movement.duration_s,
        alpha: movement.alpha,
        activation: movement.activation,
        orientation_error,
        hemisphere,
        gains: [gains.position.into(), gains.orientation.into(), gains.posture.into(), gains.hand.into()],
        start: document.start.into(),
        start_velocity: WaypointVelocity {
            position: velocity.position_m_s,
            orientation: velocity.orientation_rad_s,
            posture: velocity.posture_rad_s,
            hand: velocity.hand_rad_s,
        },
        goal: document.goal.into(),
        weights: groups.into_iter().flatten().cloned().collect(),
        feedback: document.feedback.map(|section| FeedbackTables {
            clamps: [section.clamp_position_m, section.clamp_orientation_rad, section.clamp_hand_rad],
            k1: section.k1,
            k2: section.k2,
        }),
        expectation,
        experience: document.experience.map(|section| ExperienceTable {
            trials: section.trials,
            mean: section.mean,
            spread: section.spread,
        }),
        provenance,
    };
    Ok((primitive, stored))
}
