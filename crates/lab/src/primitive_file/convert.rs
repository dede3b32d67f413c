//! From the file to what a controller runs: `dmp::Primitive` on the host, the image for a device.

use control::LoadError;
use control::plan::primitive::{
    Configuration, ExpectedWrench, Feedback, GainSchedule, MovementTables, Primitive, SensorStatistics, configuration,
    gains, limits, velocity,
};
use dmp::{Hemisphere, OrientationError, TableError};
use link::image::{ExpectationMarks, FeedbackClamps, IMAGE_BYTES_LIMIT, ImageContent, PrimitiveImage};

use super::{
    ExperienceTable, HemisphereKind, OrientationErrorKind, PrimitiveFile, PrimitiveFileError, Waypoint,
    WaypointVelocity,
};

/// Most kernels of a row, the same as on a device.
pub const KERNEL_CAPACITY: usize = control::MAX_KERNELS;

/// A primitive in the precision of the host.
pub type HostPrimitive = Primitive<f64, KERNEL_CAPACITY>;

impl PrimitiveFile {
    /// The primitive, ready to be rolled out on the host in double precision.
    ///
    /// # Errors
    /// [`PrimitiveFileError::Invalid`] with the reason that `dmp` gives.
    pub fn to_primitive(&self) -> Result<HostPrimitive, PrimitiveFileError> {
        let refused = |reason: String| PrimitiveFileError::Invalid { file: self.file.clone(), reason };
        self.require_expectation()?;
        let weights = self.weights.concat();
        let feedback = self
            .feedback
            .as_ref()
            .map(|tables| -> Result<Feedback<f64>, TableError> {
                Feedback::new(
                    GainSchedule::new(&points(&tables.k1))?,
                    GainSchedule::new(&points(&tables.k2))?,
                    limits(tables.clamps[0], tables.clamps[1], tables.clamps[2]),
                )
            })
            .transpose()
            .map_err(|error| refused(format!("feedback: {error}")))?;
        let expected = self
            .expectation
            .as_ref()
            .map(|table| ExpectedWrench::new(&points(&table.mean), table.recorded_duration))
            .transpose()
            .map_err(|error| refused(format!("expectation: {error}")))?;
        let experience = self
            .experience
            .as_ref()
            .map(|table| {
                let trials = u16::try_from(table.trials).unwrap_or(u16::MAX);
                SensorStatistics::new(&points(&table.mean), &points(&table.spread), trials)
            })
            .transpose()
            .map_err(|error| refused(format!("experience: {error}")))?;
        let tables = MovementTables {
            control_period: control::PERIOD,
            duration: self.duration,
            alpha: self.alpha,
            activation: self.activation,
            kernel_count: self.kernels(),
            weights: &weights,
            gains: gains(self.gains.map(|gain| gain.stiffness), self.gains.map(|gain| gain.damping)),
            orientation_error: match self.orientation_error {
                OrientationErrorKind::Quaternion => OrientationError::Quaternion,
                OrientationErrorKind::RotationVector => OrientationError::RotationVector,
            },
            hemisphere: match self.hemisphere {
                HemisphereKind::Demonstrated => Hemisphere::Demonstrated,
                HemisphereKind::Nearest => Hemisphere::Nearest,
            },
            start: waypoint(&self.start),
            goal: waypoint(&self.goal),
            start_velocity: start_velocity(&self.start_velocity),
        };
        let mut primitive =
            Primitive::new(&tables).map_err(|error| refused(LoadError::Primitive(error).to_string()))?;
        primitive.set_feedback(feedback.as_ref());
        primitive.set_expected(expected.as_ref());
        primitive.set_statistics(experience.as_ref());
        Ok(primitive)
    }

    /// The image that is uploaded: single precision, checked by reading it back.
    ///
    /// # Errors
    /// [`PrimitiveFileError::Image`], for example for more kernels than an image can hold.
    pub fn to_image(&self) -> Result<Vec<u8>, PrimitiveFileError> {
        self.require_expectation()?;
        let refused = |cause| PrimitiveFileError::Image { file: self.file.clone(), cause };
        let single = |rows: &[Vec<f64>]| -> Vec<f32> { rows.iter().flatten().map(|value| *value as f32).collect() };
        let weights = single(&self.weights);
        let k1 = self.feedback.as_ref().map_or_else(Vec::new, |tables| single(&tables.k1));
        let k2 = self.feedback.as_ref().map_or_else(Vec::new, |tables| single(&tables.k2));
        let mean = self.expectation.as_ref().map_or_else(Vec::new, |table| single(&table.mean));
        let spread = self.expectation.as_ref().map_or_else(Vec::new, |table| single(&table.spread));
        let known = |pick: fn(&ExperienceTable) -> &Vec<Vec<f64>>| {
            self.experience.as_ref().map_or_else(Vec::new, |table| single(pick(table)))
        };
        let (experience_mean, experience_spread) = (known(|table| &table.mean), known(|table| &table.spread));
        let content = ImageContent::<&[f32]> {
            model_hash: self.model_hash,
            duration: self.duration as f32,
            alpha: self.alpha as f32,
            activation: self.activation as f32,
            stiffness: self.gains.map(|gain| gain.stiffness as f32),
            damping: self.gains.map(|gain| gain.damping as f32),
            orientation_error: match self.orientation_error {
                OrientationErrorKind::Quaternion => link::image::OrientationErrorKind::QuaternionDifference,
                OrientationErrorKind::RotationVector => link::image::OrientationErrorKind::RotationVector,
            },
            hemisphere: match self.hemisphere {
                HemisphereKind::Demonstrated => link::image::HemisphereKind::Demonstrated,
                HemisphereKind::Nearest => link::image::HemisphereKind::Nearest,
            },
            start: image_waypoint(&self.start),
            start_velocity: link::image::WaypointVelocity {
                position: self.start_velocity.position.map(|value| value as f32),
                orientation: self.start_velocity.orientation.map(|value| value as f32),
                posture: self.start_velocity.posture.map(|value| value as f32),
                hand: self.start_velocity.hand.map(|value| value as f32),
            },
            goal: image_waypoint(&self.goal),
            clamps: self.feedback.as_ref().map_or_else(FeedbackClamps::default, |tables| FeedbackClamps {
                position: tables.clamps[0] as f32,
                orientation: tables.clamps[1] as f32,
                hand: tables.clamps[2] as f32,
            }),
            marks: self.expectation.as_ref().map_or_else(ExpectationMarks::default, |table| ExpectationMarks {
                recorded_duration: table.recorded_duration as f32,
                payload_mass: table.payload_mass as f32,
                payload_centre: table.payload_centre.map(|value| value as f32),
                filter_cutoff: table.filter_cutoff as f32,
                trials: table.trials as f32,
                spread_floor: table.spread_floor as f32,
            }),
            kernels: self.kernels(),
            k1: &k1,
            k2: &k2,
            weights: &weights,
            expected_mean: &mean,
            expected_spread: &spread,
            experience_trials: self
                .experience
                .as_ref()
                .map_or(0, |table| u16::try_from(table.trials).unwrap_or(u16::MAX)),
            experience_mean: &experience_mean,
            experience_spread: &experience_spread,
        };
        let name = link::Name::new(&self.name).map_err(|_| refused(link::ImageError::Name))?;
        let mut bytes = vec![0; IMAGE_BYTES_LIMIT];
        let length = content.encode(&name, &mut bytes).map_err(refused)?;
        bytes.truncate(length);
        PrimitiveImage::parse(&bytes).map_err(refused)?;
        Ok(bytes)
    }
}

/// Rows of a table as arrays; shapes were checked when the file was read.
fn points<const SIZE: usize>(rows: &[Vec<f64>]) -> Vec<[f64; SIZE]> {
    rows.iter().map(|row| std::array::from_fn(|index| row.get(index).copied().unwrap_or(f64::NAN))).collect()
}

fn waypoint(waypoint: &Waypoint) -> Configuration<f64> {
    configuration(waypoint.position, waypoint.orientation, waypoint.posture, waypoint.hand)
}

fn start_velocity(at: &WaypointVelocity) -> control::plan::primitive::Velocity<f64> {
    velocity(at.position, at.orientation, at.posture, at.hand)
}

fn image_waypoint(waypoint: &Waypoint) -> link::image::Waypoint {
    link::image::Waypoint {
        position: waypoint.position.map(|value| value as f32),
        orientation: waypoint.orientation.map(|value| value as f32),
        posture: waypoint.posture.map(|value| value as f32),
        hand: waypoint.hand.map(|value| value as f32),
    }
}
