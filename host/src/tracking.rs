//! How well an execution kept to its plan: the figures that the run's report, the figure and the demo's table show.

use serde::Serialize;
use thiserror::Error;

use crate::demonstration::{Recording, angle_between};

/// Tracking of one run: measured against desired pose, cycle by cycle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Tracking {
    /// Samples compared.
    pub samples: usize,
    /// Root mean square distance, m.
    pub position_rms_m: f64,
    /// Largest distance, m.
    pub position_max_m: f64,
    /// Distance at the last sample, m.
    pub position_end_m: f64,
    /// Root mean square angle, rad.
    pub orientation_rms_rad: f64,
    /// Largest angle, rad.
    pub orientation_max_rad: f64,
    /// Angle at the last sample, rad.
    pub orientation_end_rad: f64,
}

/// Why a recording cannot be compared with its plan.
#[derive(Debug, Error)]
pub enum TrackingError {
    /// The recording lacks the measured or the desired pose.
    #[error("{file}: the columns of the measured and of the desired pose (x_m..qz, x_d_m..qz_d) are both needed", file = file.display())]
    Columns {
        /// The file.
        file: std::path::PathBuf,
    },
    /// No sample is left to compare.
    #[error("{file}: there is no sample in state `run`", file = file.display())]
    NoRun {
        /// The file.
        file: std::path::PathBuf,
    },
}

impl Tracking {
    /// Compares the part of a recording in which a plan was played (all of it, if it has no states).
    ///
    /// # Errors
    /// [`TrackingError`].
    pub fn of_run(recording: &Recording) -> Result<Tracking, TrackingError> {
        let run = recording.running();
        let errors = errors(&run).ok_or_else(|| TrackingError::Columns { file: recording.file.clone() })?;
        let (Some(last), count) = (errors.last(), errors.len() as f64) else {
            return Err(TrackingError::NoRun { file: recording.file.clone() });
        };
        let square =
            |pick: fn(&(f64, f64)) -> f64| (errors.iter().map(|error| pick(error).powi(2)).sum::<f64>() / count).sqrt();
        let largest = |pick: fn(&(f64, f64)) -> f64| errors.iter().map(pick).fold(0.0, f64::max);
        Ok(Tracking {
            samples: errors.len(),
            position_rms_m: square(|error| error.0),
            position_max_m: largest(|error| error.0),
            position_end_m: last.0,
            orientation_rms_rad: square(|error| error.1),
            orientation_max_rad: largest(|error| error.1),
            orientation_end_rad: last.1,
        })
    }
}

/// Distance (m) and angle (rad) between measured and desired pose at each sample; `None` without those columns.
pub fn errors(run: &Recording) -> Option<Vec<(f64, f64)>> {
    let position = run.position.as_ref()?.iter().zip(run.position_d.as_ref()?);
    let orientation = run.orientation.as_ref()?.iter().zip(run.orientation_d.as_ref()?);
    Some(
        position
            .zip(orientation)
            .map(|((x, x_d), (q, q_d))| {
                let distance = (0..3).map(|axis| (x[axis] - x_d[axis]).powi(2)).sum::<f64>().sqrt();
                (distance, angle_between(q, q_d))
            })
            .collect(),
    )
}
