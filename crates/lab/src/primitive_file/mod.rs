//! A movement primitive as a text file: TOML with units in the names of the keys, double precision, guarded by a
//! check sum.
//!
//! The file is what a person reads, compares and keeps under version control; the binary image that a device stores
//! is made from it when it is uploaded. Numbers are written with as many digits as it takes to read the same number
//! back. The check sum covers values, not text: comments and spaces may be changed, a number may not.

mod convert;
mod error;
mod readback;
mod text;

use std::path::{Path, PathBuf};

use control::plan::primitive::{HAND_ROWS, ORIENTATION_ROWS, POSITION_ROWS, POSTURE_ROWS};
use dmp::Gain;
use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};

pub use convert::{HostPrimitive, KERNEL_CAPACITY};
pub use dmp::{Hemisphere, OrientationError};
pub use error::PrimitiveFileError;

use crate::demonstration::recording::checksum;
use crate::{input_file, output_file};

/// Version of the layout. A file that names another one is refused.
pub const SCHEMA: &str = "tactus-primitive/1";

/// Largest deviation of the duration from the recorded one at which an expectation means anything; `dmp` gives no trust
/// to one beyond it.
pub const LARGEST_DURATION_DEVIATION: f64 = 0.5;

/// Pose, posture and hand of one moment.
pub type Waypoint = link::image::Waypoint<f64>;

/// Velocities at one moment.
pub type WaypointVelocity = link::image::WaypointVelocity<f64>;

/// Timing and coordinates of the movement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MovementSection {
    /// Duration as taught, s.
    #[serde(rename = "duration_s")]
    pub duration: f64,
    /// Decay of the phase, Eq (3).
    pub alpha: f64,
    /// Activation of a kernel at the next centre, Eq (2).
    pub activation: f64,
    /// Kernels of each row of the weights.
    pub kernels: usize,
    /// Orientation error.
    pub orientation_error: OrientationError,
    /// Signs of the quaternions.
    pub hemisphere: Hemisphere,
}

/// A value for each group of rows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Groups<T> {
    /// Of the position.
    pub position: T,
    /// Of the orientation.
    pub orientation: T,
    /// Of the posture.
    pub posture: T,
    /// Of the hand.
    pub hand: T,
}

impl<T> Groups<T> {
    /// The values in the order position, orientation, posture, hand.
    pub fn in_order(&self) -> [&T; 4] {
        [&self.position, &self.orientation, &self.posture, &self.hand]
    }
}

impl Groups<Vec<Vec<f64>>> {
    /// All rows in their order.
    pub fn rows(&self) -> impl Iterator<Item = &Vec<f64>> {
        self.in_order().into_iter().flatten()
    }
}

/// Names of the groups, and the number of rows of each.
const GROUPS: Groups<(&str, usize)> = Groups {
    position: ("position", POSITION_ROWS),
    orientation: ("orientation", ORIENTATION_ROWS),
    posture: ("posture", POSTURE_ROWS),
    hand: ("hand", HAND_ROWS),
};

/// Sensory feedback, Eq (8).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FeedbackTables {
    /// Largest displacement of the planned position at rest, m.
    #[serde(rename = "clamp_position_m")]
    pub clamp_position: f64,
    /// Largest displacement of the planned orientation at rest, rad.
    #[serde(rename = "clamp_orientation_rad")]
    pub clamp_orientation: f64,
    /// Largest displacement of the planned hand at rest, rad.
    #[serde(rename = "clamp_hand_rad")]
    pub clamp_hand: f64,
    /// K1 by phase, 10 task rows a point, first point at the start of the movement. One point: constant.
    pub k1: Vec<Vec<f64>>,
    /// K2 by phase, 9 sensor rows a point.
    pub k2: Vec<Vec<f64>>,
}

/// Expected sensor values by phase.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExpectationTable {
    /// Hash of the robot model it was recorded with.
    #[serde(with = "text::hexadecimal")]
    pub model_hash: u32,
    /// Duration of the recorded runs, s.
    #[serde(rename = "recorded_duration_s")]
    pub recorded_duration: f64,
    /// Mass carried while recording beyond the hand, kg.
    #[serde(rename = "payload_mass_kg")]
    pub payload_mass: f64,
    /// Centre of that mass in the tool frame, m.
    #[serde(rename = "payload_centre_m")]
    pub payload_centre: [f64; 3],
    /// Cut-off of the causal filter on the recorded wrench, Hz.
    #[serde(rename = "filter_cutoff_hz")]
    pub filter_cutoff: f64,
    /// Runs that were averaged.
    pub trials: u32,
    /// Relative spread below which no sensor is trusted more, 1.
    pub spread_floor: f64,
    /// Mean by phase, 9 sensor rows a point: force N (world), torque N m, finger gauges N m.
    pub mean: Vec<Vec<f64>>,
    /// Standard deviation, same shape; empty where it is not known. It stays on the host: K2 was made from it, and a
    /// primitive that was read back from a device has none.
    pub spread: Vec<Vec<f64>>,
}

/// Sensor values and finger angles of successful runs, by phase: the device watches a run by them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StatisticsTable {
    /// Successful runs it was made from.
    pub trials: u32,
    /// Mean by phase, 12 channels a point: the 9 sensor rows of the expectation, then fingers F1 to F3, rad.
    pub mean: Vec<Vec<f64>>,
    /// Standard deviation, same shape, positive.
    pub spread: Vec<Vec<f64>>,
}

/// Speed of a movement that is learned as it was shown.
fn as_shown() -> f64 {
    1.0
}

/// True for that speed.
fn is_as_shown(speed: &f64) -> bool {
    *speed == as_shown()
}

/// Where a primitive comes from: not part of its content, not covered by the check sum.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// File name of the demonstration, without its folder.
    pub demonstration: String,
    /// CRC-32 of the demonstration's bytes.
    #[serde(rename = "demonstration_crc32", with = "text::hexadecimal")]
    pub demonstration_checksum: u32,
    /// Samples the primitive was fitted to.
    pub samples: usize,
    /// Time cut off before and behind the movement, s.
    #[serde(rename = "trimmed_s")]
    pub trimmed: [f64; 2],
    /// Speed of the movement, of the one that was shown; a file of one that is as fast does not have it.
    #[serde(default = "as_shown", skip_serializing_if = "is_as_shown")]
    pub speed: f64,
    /// Largest angle of the demonstration to its goal, rad.
    #[serde(rename = "largest_angle_rad")]
    pub largest_angle: f64,
    /// Reproduction error of the position: maximum and RMS over time, m.
    #[serde(rename = "position_error_m")]
    pub position_error: [f64; 2],
    /// Reproduction error of the orientation: maximum and RMS over time, rad.
    #[serde(rename = "orientation_error_rad")]
    pub orientation_error: [f64; 2],
    /// Reproduction error of the posture: maximum and RMS over time and joints, rad.
    #[serde(rename = "posture_error_rad")]
    pub posture_error: [f64; 2],
    /// Version of the tool.
    pub tool: String,
}

/// One movement primitive with everything that belongs to it, in the order of the text.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PrimitiveFile {
    /// The file it was read from or will be written to, for messages.
    #[serde(skip)]
    pub file: PathBuf,
    // The first two keys of the text are read and written by `text`.
    #[serde(skip_serializing)]
    pub(crate) schema: IgnoredAny,
    #[serde(skip_serializing)]
    pub(crate) content_crc32: IgnoredAny,
    /// Name on the device: 1 to 32 of `A-Z a-z 0-9 - _ .`.
    #[serde(deserialize_with = "text::name")]
    pub name: String,
    /// Hash of the robot model it was learned with.
    #[serde(with = "text::hexadecimal")]
    pub model_hash: u32,
    /// Timing and coordinates.
    pub movement: MovementSection,
    /// Stiffness and damping of each group of rows, Eq (1): dimensionless.
    pub gains: Groups<Gain<f64>>,
    /// Start of the demonstration.
    pub start: Waypoint,
    /// Velocity there.
    pub start_velocity: WaypointVelocity,
    /// Goal of the demonstration.
    pub goal: Waypoint,
    /// Weights theta, rows of equal length. Position rows m, others rad.
    pub weights: Groups<Vec<Vec<f64>>>,
    /// Sensory feedback, if the primitive has any.
    pub feedback: Option<FeedbackTables>,
    /// Expected sensor values, if they were recorded.
    pub expectation: Option<ExpectationTable>,
    /// Sensor values of successful runs, if any were gathered; `experience` in files of earlier versions.
    #[serde(alias = "experience")]
    pub statistics: Option<StatisticsTable>,
    /// Where it comes from.
    pub provenance: Option<Provenance>,
}

impl PrimitiveFile {
    /// Reads and checks a file: schema, shapes, finite numbers, check sum. The model is compared by
    /// [`PrimitiveFile::require_model`].
    ///
    /// # Errors
    /// The first thing that is wrong.
    pub fn read(file: &Path) -> Result<PrimitiveFile, PrimitiveFileError> {
        PrimitiveFile::read_with_text(file).map(|(primitive, _)| primitive)
    }

    /// The same, with the text: of a pipe it cannot be read a second time.
    ///
    /// # Errors
    /// The first thing that is wrong.
    pub fn read_with_text(file: &Path) -> Result<(PrimitiveFile, String), PrimitiveFileError> {
        let text =
            input_file::read_text(file).map_err(|cause| PrimitiveFileError::Io { file: file.to_owned(), cause })?;
        Ok((PrimitiveFile::parse(file, &text)?, text))
    }

    /// Checks text that was read from `file`.
    ///
    /// # Errors
    /// The first thing that is wrong.
    pub fn parse(file: &Path, text: &str) -> Result<PrimitiveFile, PrimitiveFileError> {
        let (primitive, stored) = text::parse(file, text)?;
        primitive.check_values()?;
        let computed = primitive.checksum();
        if computed == stored {
            Ok(primitive)
        } else {
            Err(PrimitiveFileError::Checksum { file: file.to_owned(), computed, stored })
        }
    }

    /// Writes the file in one piece: a reader sees the old content or the new, never half of it.
    ///
    /// # Errors
    /// A number is not finite, a table has the wrong size, or the operating system refuses.
    pub fn write(&self, file: &Path) -> Result<(), PrimitiveFileError> {
        let text = self.checked_text()?;
        output_file::replace(file, text.as_bytes()).map_err(PrimitiveFileError::Output)
    }

    /// The text of the file, its values checked.
    ///
    /// # Errors
    /// A number is not finite, or a table has the wrong size.
    pub fn checked_text(&self) -> Result<String, PrimitiveFileError> {
        self.check_values()?;
        Ok(self.to_text())
    }

    /// The text of the file.
    pub fn to_text(&self) -> String {
        text::render(self)
    }

    /// Refuses a primitive that was learned with another model than `expected`: its torques and its kinematics
    /// would not be those of this arm.
    ///
    /// # Errors
    /// [`PrimitiveFileError::Model`] naming both.
    pub fn require_model(&self, expected: u32) -> Result<(), PrimitiveFileError> {
        if self.model_hash == expected {
            Ok(())
        } else {
            Err(PrimitiveFileError::Model { file: self.file.clone(), found: self.model_hash, expected })
        }
    }

    /// Refuses an expectation that is not that of this movement on this arm: recorded at a duration more than half away
    /// from that of the movement (the inertial part of a wrench goes with the square of the speed), or with another
    /// model.
    ///
    /// # Errors
    /// [`PrimitiveFileError::ExpectationDuration`], [`PrimitiveFileError::ExpectationModel`].
    pub fn require_expectation(&self) -> Result<(), PrimitiveFileError> {
        let Some(expectation) = &self.expectation else { return Ok(()) };
        if expectation.model_hash != self.model_hash {
            return Err(PrimitiveFileError::ExpectationModel {
                file: self.file.clone(),
                found: expectation.model_hash,
                expected: self.model_hash,
            });
        }
        let recorded = expectation.recorded_duration;
        // Both are finite: a file with another number is not read.
        if (recorded - self.movement.duration).abs() > LARGEST_DURATION_DEVIATION * recorded {
            return Err(PrimitiveFileError::ExpectationDuration {
                file: self.file.clone(),
                recorded,
                duration: self.movement.duration,
            });
        }
        Ok(())
    }

    /// The movement alone, as it can be rehearsed: without expectation and statistics.
    pub fn without_memory(&self) -> PrimitiveFile {
        PrimitiveFile { expectation: None, statistics: None, ..self.clone() }
    }

    /// Check sum of the movement alone: what is remembered of it, and the weights that follow from that, do not change
    /// it. It is that of the numbers as a device holds them, in 32 bits: a primitive that was read back from one is the
    /// same movement.
    pub fn movement_checksum(&self) -> u32 {
        let movement = PrimitiveFile { feedback: None, ..self.without_memory() };
        movement.checksum_of(|value| f64::from(value as f32))
    }

    /// Number of kernels of each row.
    pub fn kernels(&self) -> usize {
        self.weights.position.first().map_or(0, Vec::len)
    }

    /// CRC-32/ISCSI of everything that determines the movement.
    pub fn checksum(&self) -> u32 {
        self.checksum_of(|value| value)
    }

    fn checksum_of(&self, number: impl Fn(f64) -> f64) -> u32 {
        let mut bytes = self.name.as_bytes().to_vec();
        bytes.push(0);
        bytes.extend(self.model_hash.to_le_bytes());
        bytes.push(self.movement.orientation_error as u8);
        bytes.push(self.movement.hemisphere as u8);
        for (key, values) in self.tables() {
            // Counted under the name of earlier versions: their check sums hold.
            let key = key.strip_prefix("statistics").map_or(key.clone(), |rest| format!("experience{rest}"));
            bytes.extend(key.as_bytes());
            bytes.extend((values.len() as u32).to_le_bytes());
            for value in values {
                bytes.extend(number(value).to_le_bytes());
            }
        }
        checksum(&bytes)
    }

    /// Every table of numbers with its key in the file.
    fn tables(&self) -> Vec<(String, Vec<f64>)> {
        let movement = &self.movement;
        let mut tables = vec![("movement".to_owned(), vec![movement.duration, movement.alpha, movement.activation])];
        for ((group, _), gain) in GROUPS.in_order().into_iter().zip(self.gains.in_order()) {
            tables.push((format!("gains.{group}"), vec![gain.stiffness, gain.damping]));
        }
        for (key, waypoint) in [("start", &self.start), ("goal", &self.goal)] {
            tables.push((format!("{key}.position_m"), waypoint.position.to_vec()));
            tables.push((format!("{key}.orientation_wxyz"), waypoint.orientation.to_vec()));
            tables.push((format!("{key}.posture_rad"), waypoint.posture.to_vec()));
            tables.push((format!("{key}.hand_rad"), waypoint.hand.to_vec()));
        }
        let velocity = &self.start_velocity;
        tables.push(("start_velocity.position_m_s".into(), velocity.position.to_vec()));
        tables.push(("start_velocity.orientation_rad_s".into(), velocity.orientation.to_vec()));
        tables.push(("start_velocity.posture_rad_s".into(), velocity.posture.to_vec()));
        tables.push(("start_velocity.hand_rad_s".into(), velocity.hand.to_vec()));
        for ((group, _), rows) in GROUPS.in_order().into_iter().zip(self.weights.in_order()) {
            let rows = rows.iter().enumerate();
            tables.extend(rows.map(|(index, row)| (format!("weights.{group}, row {}", index + 1), row.clone())));
        }
        if let Some(feedback) = &self.feedback {
            let clamps = vec![feedback.clamp_position, feedback.clamp_orientation, feedback.clamp_hand];
            tables.push(("feedback.clamps".into(), clamps));
            tables.push(("feedback.k1".into(), feedback.k1.concat()));
            tables.push(("feedback.k2".into(), feedback.k2.concat()));
        }
        if let Some(expectation) = &self.expectation {
            let model = f64::from(expectation.model_hash);
            let mut marks = vec![model, expectation.recorded_duration, expectation.payload_mass];
            marks.extend(expectation.payload_centre);
            marks.extend([expectation.filter_cutoff, f64::from(expectation.trials), expectation.spread_floor]);
            tables.push(("expectation".into(), marks));
            tables.push(("expectation.mean".into(), expectation.mean.concat()));
            tables.push(("expectation.spread".into(), expectation.spread.concat()));
        }
        if let Some(statistics) = &self.statistics {
            tables.push(("statistics".into(), vec![f64::from(statistics.trials)]));
            tables.push(("statistics.mean".into(), statistics.mean.concat()));
            tables.push(("statistics.spread".into(), statistics.spread.concat()));
        }
        tables
    }

    fn check_values(&self) -> Result<(), PrimitiveFileError> {
        let shape = |key: &str, found: usize, expected: usize| {
            if found == expected {
                Ok(())
            } else {
                Err(PrimitiveFileError::Shape { file: self.file.clone(), key: key.to_owned(), found, expected })
            }
        };
        for ((group, rows), found) in GROUPS.in_order().into_iter().zip(self.weights.in_order()) {
            shape(&format!("weights.{group}"), found.len(), *rows)?;
        }
        for (key, values) in self.tables() {
            if key.starts_with("weights.") {
                shape(&key, values.len(), self.movement.kernels)?;
            }
            if let Some(entry) = values.iter().position(|value| !value.is_finite()) {
                return Err(PrimitiveFileError::NotFinite { file: self.file.clone(), key, entry: entry + 1 });
            }
        }
        let columns = |key: &str, points: &[Vec<f64>], expected: usize| {
            points.iter().try_for_each(|point| shape(key, point.len(), expected))
        };
        if let Some(feedback) = &self.feedback {
            columns("feedback.k1", &feedback.k1, link::image::COUPLED_ROWS)?;
            columns("feedback.k2", &feedback.k2, link::image::SENSOR_ROWS)?;
        }
        if let Some(expectation) = &self.expectation {
            if !expectation.spread.is_empty() {
                shape("expectation.spread", expectation.spread.len(), expectation.mean.len())?;
            }
            columns("expectation.mean", &expectation.mean, link::image::SENSOR_ROWS)?;
            columns("expectation.spread", &expectation.spread, link::image::SENSOR_ROWS)?;
        }
        if let Some(statistics) = &self.statistics {
            shape("statistics.spread", statistics.spread.len(), statistics.mean.len())?;
            columns("statistics.mean", &statistics.mean, link::image::STATISTICS_ROWS)?;
            columns("statistics.spread", &statistics.spread, link::image::STATISTICS_ROWS)?;
        }
        Ok(())
    }
}
