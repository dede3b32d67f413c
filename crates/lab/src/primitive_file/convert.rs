//! From the file to what a controller runs: `dmp::Primitive` on the host, the image for a device.

use dmp::{
    Configuration, ExpectedWrench, Experience, Feedback, GainSchedule, Hemisphere, Limits, OrientationError, Primitive,
    PrimitiveTables, Quaternion, TableError, Velocity,
};
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
                    Limits { displacement: tables.clamps[0], rotation: tables.clamps[1], hand: tables.clamps[2] },
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
                Experience::new(&points(&table.mean), &points(&table.spread), trials)
            })
            .transpose()
            .map_err(|error| refused(format!("experience: {error}")))?;
        let tables = PrimitiveTables {
            duration: self.duration,
            alpha: self.alpha,
            activation: self.activation,
            kernel_count: self.kernels(),
            weights: &weights,
            stiffness: self.gains.map(|gain| gain.stiffness),
            damping: self.gains.map(|gain| gain.damping),
            orientation_error: match self.orientation_error {
                OrientationErrorKind::Quaternion => OrientationError::Quaternion,
                OrientationErrorKind::RotationVector => OrientationError::RotationVector,
            },
            hemisphere: match self.hemisphere {
                HemisphereKind::Demonstrated => Hemisphere::Demonstrated,
                HemisphereKind::Nearest => Hemisphere::Nearest,
            },
            start: configuration(&self.start),
            goal: configuration(&self.goal),
            start_velocity: velocity(&self.start_velocity),
            feedback: feedback.as_ref(),
            expected: expected.as_ref(),
            experience: experience.as_ref(),
        };
        Primitive::new(&tables).map_err(|error| refused(error.to_string()))
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

fn configuration(waypoint: &Waypoint) -> Configuration<f64> {
    let [w, x, y, z] = waypoint.orientation;
    Configuration {
        position: waypoint.position,
        orientation: Quaternion { w, x, y, z },
        posture: waypoint.posture,
        hand: waypoint.hand,
    }
}

fn velocity(velocity: &WaypointVelocity) -> Velocity<f64> {
    Velocity {
        position: velocity.position,
        orientation: velocity.orientation,
        posture: velocity.posture,
        hand: velocity.hand,
    }
}

fn image_waypoint(waypoint: &Waypoint) -> link::image::Waypoint {
    link::image::Waypoint {
        position: waypoint.position.map(|value| value as f32),
        orientation: waypoint.orientation.map(|value| value as f32),
        posture: waypoint.posture.map(|value| value as f32),
        hand: waypoint.hand.map(|value| value as f32),
    }
}
