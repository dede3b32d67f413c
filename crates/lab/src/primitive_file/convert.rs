//! From the file to what a controller runs: `dmp::Primitive` on the host, the image for a device.

use control::LoadError;
use control::plan::bounds;
use control::plan::primitive::{
    Configuration, ExpectedWrench, Feedback, GainSchedule, MovementTables, Primitive, SensorStatistics, configuration,
    gains, limits, velocity,
};
use dmp::TableError;
use link::image::{ExpectationMarks, FeedbackClamps, IMAGE_BYTES_LIMIT, ImageContent, PrimitiveImage};

use super::{PrimitiveFile, PrimitiveFileError, Waypoint};

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
        let weights: Vec<f64> = self.weights.rows().flatten().copied().collect();
        let (movement, velocities) = (&self.movement, &self.start_velocity);
        let feedback = self
            .feedback
            .as_ref()
            .map(|tables| -> Result<Feedback<f64>, TableError> {
                Feedback::new(
                    GainSchedule::new(&points(&tables.k1))?,
                    GainSchedule::new(&points(&tables.k2))?,
                    limits(tables.clamp_position, tables.clamp_orientation, tables.clamp_hand),
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
        if let Some(table) = &self.expectation {
            let (mass, centre) = (table.payload_mass as f32, table.payload_centre.map(|value| value as f32));
            bounds::check_marks(mass, &centre, table.trials as f32, table.spread_floor as f32)
                .map_err(|quantity| refused(quantity.to_string()))?;
        }
        let statistics = self
            .statistics
            .as_ref()
            .map(|table| {
                let trials = u16::try_from(table.trials).unwrap_or(u16::MAX);
                SensorStatistics::new(&points(&table.mean), &points(&table.spread), trials)
            })
            .transpose()
            .map_err(|error| refused(format!("statistics: {error}")))?;
        let tables = MovementTables {
            control_period: control::PERIOD,
            duration: movement.duration,
            alpha: movement.alpha,
            activation: movement.activation,
            kernel_count: self.kernels(),
            weights: &weights,
            gains: gains(
                self.gains.in_order().map(|gain| gain.stiffness),
                self.gains.in_order().map(|gain| gain.damping),
            ),
            orientation_error: movement.orientation_error,
            hemisphere: movement.hemisphere,
            start: waypoint(&self.start),
            goal: waypoint(&self.goal),
            start_velocity: velocity(velocities.position, velocities.orientation, velocities.posture, velocities.hand),
        };
        let mut primitive =
            Primitive::new(&tables).map_err(|error| refused(LoadError::Primitive(error).to_string()))?;
        primitive.set_feedback(feedback.as_ref());
        primitive.set_expected(expected.as_ref());
        primitive.set_statistics(statistics.as_ref());
        Ok(primitive)
    }

    /// The image that is uploaded: single precision, checked by reading it back.
    ///
    /// # Errors
    /// [`PrimitiveFileError::Image`], for example for more kernels than an image can hold;
    /// [`PrimitiveFileError::StatisticsAlone`] and [`PrimitiveFileError::ExpectationFilter`], which no device takes.
    pub fn to_image(&self) -> Result<Vec<u8>, PrimitiveFileError> {
        self.require_expectation()?;
        let refused = |cause| PrimitiveFileError::Image { file: self.file.clone(), cause };
        fn single<'a>(rows: impl IntoIterator<Item = &'a Vec<f64>>) -> Vec<f32> {
            rows.into_iter().flatten().map(|value| *value as f32).collect()
        }
        let (movement, feedback) = (&self.movement, self.feedback.as_ref());
        let (expectation, statistics) = (self.expectation.as_ref(), self.statistics.as_ref());
        if statistics.is_some() && expectation.is_none() {
            return Err(PrimitiveFileError::StatisticsAlone { file: self.file.clone() });
        }
        let cut_off = expectation.map(|table| table.filter_cutoff);
        if let Some(found) = cut_off.filter(|cut_off| device::recorded_filter::check(*cut_off as f32).is_err()) {
            let expected = control::sense::wrench::WRENCH_CUT_OFF;
            return Err(PrimitiveFileError::ExpectationFilter { file: self.file.clone(), found, expected });
        }
        let content = ImageContent::<&[f32]> {
            model_hash: self.model_hash,
            duration: movement.duration as f32,
            alpha: movement.alpha as f32,
            activation: movement.activation as f32,
            stiffness: self.gains.in_order().map(|gain| gain.stiffness as f32),
            damping: self.gains.in_order().map(|gain| gain.damping as f32),
            orientation_error: movement.orientation_error,
            hemisphere: movement.hemisphere,
            start: self.start.single(),
            start_velocity: self.start_velocity.single(),
            goal: self.goal.single(),
            clamps: feedback.map_or_else(FeedbackClamps::default, |tables| FeedbackClamps {
                position: tables.clamp_position as f32,
                orientation: tables.clamp_orientation as f32,
                hand: tables.clamp_hand as f32,
            }),
            marks: expectation.map_or_else(ExpectationMarks::default, |table| ExpectationMarks {
                recorded_duration: table.recorded_duration as f32,
                payload_mass: table.payload_mass as f32,
                payload_centre: table.payload_centre.map(|value| value as f32),
                filter_cutoff: table.filter_cutoff as f32,
                trials: table.trials as f32,
                spread_floor: table.spread_floor as f32,
            }),
            kernels: self.kernels(),
            k1: &single(feedback.iter().flat_map(|tables| &tables.k1)),
            k2: &single(feedback.iter().flat_map(|tables| &tables.k2)),
            weights: &single(self.weights.rows()),
            expected_mean: &single(expectation.iter().flat_map(|table| &table.mean)),
            statistics_trials: statistics.map_or(0, |table| u16::try_from(table.trials).unwrap_or(u16::MAX)),
            statistics_mean: &single(statistics.iter().flat_map(|table| &table.mean)),
            statistics_spread: &single(statistics.iter().flat_map(|table| &table.spread)),
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
