//! A movement primitive as a text file: TOML with units in the names of the keys, double precision, guarded by a
//! check sum.
//!
//! The file is what a person reads, compares and keeps under version control; the binary image that a device stores
//! is made from it when it is uploaded. Numbers are written with as many digits as it takes to read the same number
//! back. The check sum covers values, not text: comments and spaces may be changed, a number may not.

mod convert;
mod document;
mod error;
mod text;

use std::path::{Path, PathBuf};

use control::plan::primitive;

pub use convert::{HostPrimitive, KERNEL_CAPACITY};
pub use error::PrimitiveFileError;

use crate::demonstration::recording::checksum;

/// Version of the layout. A file that names another one is refused.
pub const SCHEMA: &str = "tactus-primitive/1";

/// Largest deviation of the duration from the recorded one at which an expectation means anything; `dmp` gives no trust
/// to one beyond it.
pub const LARGEST_DURATION_DEVIATION: f64 = 0.5;

/// Rows of weights by group: position, orientation, posture, hand.
pub const GROUPS: [(&str, usize); 4] = [
    ("position", primitive::POSITION_ROWS),
    ("orientation", primitive::ORIENTATION_ROWS),
    ("posture", primitive::POSTURE_ROWS),
    ("hand", primitive::HAND_ROWS),
];

/// Which orientation error the movement uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OrientationErrorKind {
    /// Eq (4); the movement stays within 175 degrees of its goal.
    Quaternion,
    /// Twice the logarithm of the quaternion difference; the movement may turn as far as it likes.
    RotationVector,
}

/// What the signs of start and goal quaternion mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HemisphereKind {
    /// They carry the signs of a sign-continuous demonstration.
    Demonstrated,
    /// The nearer way round is meant.
    Nearest,
}

/// Stiffness and damping of one group of rows, Eq (1): dimensionless.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gain {
    /// Spring K.
    pub stiffness: f64,
    /// Damper D.
    pub damping: f64,
}

/// Pose, posture and hand at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Waypoint {
    /// Tool frame in the world frame, m.
    pub position: [f64; 3],
    /// Tool to world, unit quaternion (w, x, y, z).
    pub orientation: [f64; 4],
    /// Joint angles, rad.
    pub posture: [f64; 7],
    /// Spread and fingers 1 to 3, rad.
    pub hand: [f64; 4],
}

/// Velocities at one moment.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct WaypointVelocity {
    /// World frame, m/s.
    pub position: [f64; 3],
    /// Body frame, rad/s.
    pub orientation: [f64; 3],
    /// rad/s.
    pub posture: [f64; 7],
    /// rad/s.
    pub hand: [f64; 4],
}

/// Sensory feedback, Eq (8).
#[derive(Debug, Clone, PartialEq)]
pub struct FeedbackTables {
    /// Largest displacement of the plan at rest: position m, orientation rad, hand rad.
    pub clamps: [f64; 3],
    /// K1 by phase, 10 task rows a point, first point at the start of the movement. One point: constant.
    pub k1: Vec<Vec<f64>>,
    /// K2 by phase, 9 sensor rows a point.
    pub k2: Vec<Vec<f64>>,
}

/// What the sensors should feel, by phase.
#[derive(Debug, Clone, PartialEq)]
pub struct ExpectationTable {
    /// Hash of the robot model it was recorded with.
    pub model_hash: u32,
    /// Duration of the recorded runs, s.
    pub recorded_duration: f64,
    /// Mass carried while recording beyond the hand, kg.
    pub payload_mass: f64,
    /// Centre of that mass in the tool frame, m.
    pub payload_centre: [f64; 3],
    /// Cut-off of the causal filter on the recorded wrench, Hz.
    pub filter_cutoff: f64,
    /// Runs that were averaged.
    pub trials: u32,
    /// Relative spread below which no sensor is trusted more, 1.
    pub spread_floor: f64,
    /// Mean by phase, 9 sensor rows a point: force N (world), torque N m, finger gauges N m.
    pub mean: Vec<Vec<f64>>,
    /// Standard deviation, same shape.
    pub spread: Vec<Vec<f64>>,
}

/// How successful runs felt and where the fingers stood, by phase: what the device watches a run by.
#[derive(Debug, Clone, PartialEq)]
pub struct ExperienceTable {
    /// Successful runs it was made from.
    pub trials: u32,
    /// Mean by phase, 12 channels a point: the 9 sensor rows of the expectation, then fingers F1 to F3, rad.
    pub mean: Vec<Vec<f64>>,
    /// Standard deviation, same shape, positive.
    pub spread: Vec<Vec<f64>>,
}

/// Where a primitive comes from: not part of its content, not covered by the check sum.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Provenance {
    /// File name of the demonstration, without its folder.
    pub demonstration: String,
    /// CRC-32 of the demonstration's bytes.
    pub demonstration_checksum: u32,
    /// Samples the primitive was fitted to.
    pub samples: usize,
    /// Time cut off before and behind the movement, s.
    pub trimmed: [f64; 2],
    /// Largest angle of the demonstration to its goal, rad.
    pub largest_angle: f64,
    /// Reproduction error of the position: maximum and RMS over time, m.
    pub position_error: [f64; 2],
    /// Reproduction error of the orientation: maximum and RMS over time, rad.
    pub orientation_error: [f64; 2],
    /// Reproduction error of the posture: maximum and RMS over time and joints, rad.
    pub posture_error: [f64; 2],
    /// Version of the tool.
    pub tool: String,
}

/// One movement primitive with everything that belongs to it.
#[derive(Debug, Clone, PartialEq)]
pub struct PrimitiveFile {
    /// The file it was read from or will be written to, for messages.
    pub file: PathBuf,
    /// Name on the device: 1 to 32 of `A-Z a-z 0-9 - _ .`.
    pub name: String,
    /// Hash of the robot model it was learned with.
    pub model_hash: u32,
    /// Duration as taught, s.
    pub duration: f64,
    /// Decay of the phase, Eq (3).
    pub alpha: f64,
    /// Activation of a kernel at the next centre, Eq (2).
    pub activation: f64,
    /// Orientation error.
    pub orientation_error: OrientationErrorKind,
    /// Signs of the quaternions.
    pub hemisphere: HemisphereKind,
    /// Gains of position, orientation, posture, hand.
    pub gains: [Gain; 4],
    /// Start of the demonstration.
    pub start: Waypoint,
    /// Velocity there.
    pub start_velocity: WaypointVelocity,
    /// Goal of the demonstration.
    pub goal: Waypoint,
    /// Weights theta, 17 rows of equal length: position, orientation, posture, hand. Position rows m, others rad.
    pub weights: Vec<Vec<f64>>,
    /// Sensory feedback, if the primitive has any.
    pub feedback: Option<FeedbackTables>,
    /// Expected sensor values, if they were recorded.
    pub expectation: Option<ExpectationTable>,
    /// How successful runs felt, if any were gathered.
    pub experience: Option<ExperienceTable>,
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
        let text =
            std::fs::read_to_string(file).map_err(|cause| PrimitiveFileError::Io { file: file.to_owned(), cause })?;
        PrimitiveFile::parse(file, &text)
    }

    /// Checks text that was read from `file`.
    ///
    /// # Errors
    /// The first thing that is wrong.
    pub fn parse(file: &Path, text: &str) -> Result<PrimitiveFile, PrimitiveFileError> {
        let (primitive, stored) = document::parse(file, text)?;
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
        self.check_values()?;
        let failed = |cause| PrimitiveFileError::Io { file: file.to_owned(), cause };
        let mut half_written = file.as_os_str().to_owned();
        half_written.push(".part");
        let half_written = PathBuf::from(half_written);
        std::fs::write(&half_written, self.to_text()).map_err(failed)?;
        std::fs::rename(&half_written, file).map_err(failed)
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
        if (recorded - self.duration).abs() > LARGEST_DURATION_DEVIATION * recorded {
            return Err(PrimitiveFileError::ExpectationDuration {
                file: self.file.clone(),
                recorded,
                duration: self.duration,
            });
        }
        Ok(())
    }

    /// The movement alone, as it can be rehearsed: without expectation and experience.
    pub fn without_memory(&self) -> PrimitiveFile {
        PrimitiveFile { expectation: None, experience: None, ..self.clone() }
    }

    /// Number of kernels of each row.
    pub fn kernels(&self) -> usize {
        self.weights.first().map_or(0, Vec::len)
    }

    /// CRC-32/ISCSI of everything that determines the movement.
    pub fn checksum(&self) -> u32 {
        let mut bytes = self.name.as_bytes().to_vec();
        bytes.push(0);
        bytes.extend(self.model_hash.to_le_bytes());
        bytes.push(self.orientation_error as u8);
        bytes.push(self.hemisphere as u8);
        for (key, values) in self.tables() {
            bytes.extend(key.as_bytes());
            bytes.extend((values.len() as u32).to_le_bytes());
            for value in values {
                bytes.extend(value.to_le_bytes());
            }
        }
        checksum(&bytes)
    }

    /// Every table of numbers with its key in the file.
    fn tables(&self) -> Vec<(String, Vec<f64>)> {
        let mut tables = vec![("movement".to_owned(), vec![self.duration, self.alpha, self.activation])];
        for ((group, _), gain) in GROUPS.iter().zip(&self.gains) {
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
        let mut row = 0;
        for (group, size) in GROUPS {
            for index in 0..size {
                let values = self.weights.get(row).cloned().unwrap_or_default();
                tables.push((format!("weights.{group}, row {}", index + 1), values));
                row += 1;
            }
        }
        if let Some(feedback) = &self.feedback {
            tables.push(("feedback.clamps".into(), feedback.clamps.to_vec()));
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
        if let Some(experience) = &self.experience {
            tables.push(("experience".into(), vec![f64::from(experience.trials)]));
            tables.push(("experience.mean".into(), experience.mean.concat()));
            tables.push(("experience.spread".into(), experience.spread.concat()));
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
        shape("weights", self.weights.len(), primitive::ROWS)?;
        for (key, values) in self.tables() {
            if key.starts_with("weights.") {
                shape(&key, values.len(), self.kernels())?;
            }
            if let Some(entry) = values.iter().position(|value| !value.is_finite()) {
                return Err(PrimitiveFileError::NotFinite { file: self.file.clone(), key, entry: entry + 1 });
            }
        }
        if let Some(feedback) = &self.feedback {
            for point in &feedback.k1 {
                shape("feedback.k1", point.len(), link::image::COUPLED_ROWS)?;
            }
            for point in &feedback.k2 {
                shape("feedback.k2", point.len(), link::image::SENSOR_ROWS)?;
            }
        }
        if let Some(expectation) = &self.expectation {
            shape("expectation.spread", expectation.spread.len(), expectation.mean.len())?;
            for point in expectation.mean.iter().chain(&expectation.spread) {
                shape("expectation", point.len(), link::image::SENSOR_ROWS)?;
            }
        }
        if let Some(experience) = &self.experience {
            shape("experience.spread", experience.spread.len(), experience.mean.len())?;
            for (key, rows) in [("experience.mean", &experience.mean), ("experience.spread", &experience.spread)] {
                for point in rows {
                    shape(key, point.len(), link::image::EXPERIENCE_ROWS)?;
                }
            }
        }
        Ok(())
    }
}
