//! The report of `learn`: reproduction error of the primitive, row by row, and the recorded wrench.

use serde::Serialize;

use super::feedback::FeedbackReport;
use crate::table::Table;

/// Names of the 17 rows with the unit of their error.
pub const ROW_NAMES: [(&str, &str); control::plan::primitive::ROWS] = [
    ("position x", "m"),
    ("position y", "m"),
    ("position z", "m"),
    ("orientation x", "rad"),
    ("orientation y", "rad"),
    ("orientation z", "rad"),
    ("posture J1", "rad"),
    ("posture J2", "rad"),
    ("posture J3", "rad"),
    ("posture J4", "rad"),
    ("posture J5", "rad"),
    ("posture J6", "rad"),
    ("posture J7", "rad"),
    ("hand spread", "rad"),
    ("hand F1", "rad"),
    ("hand F2", "rad"),
    ("hand F3", "rad"),
];

/// Names of the wrench's rows with their unit.
pub const WRENCH_NAMES: [(&str, &str); 6] = [
    ("force x", "N"),
    ("force y", "N"),
    ("force z", "N"),
    ("torque x", "N m"),
    ("torque y", "N m"),
    ("torque z", "N m"),
];

/// Reproduction error of one row.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct RowError {
    /// Name of the row.
    pub row: &'static str,
    /// Unit of the errors.
    pub unit: &'static str,
    /// Largest error.
    pub max: f64,
    /// Root mean square error.
    pub rms: f64,
    /// RMS error relative to the row's extent in the demonstration, 1; absent where the row does not move.
    pub relative: Option<f64>,
}

/// Statistics of one axis of the recorded wrench.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct WrenchStatistics {
    /// Name of the axis.
    pub axis: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub deviation: f64,
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
}

/// Everything `learn` reports.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct FitReport {
    /// Name of the primitive.
    pub name: String,
    /// Kernels of each row.
    pub kernels: usize,
    /// Samples at the control rate that were fitted.
    pub samples: usize,
    /// Duration, s.
    pub duration_s: f64,
    /// Time cut off before and behind the movement, s.
    pub trimmed_s: (f64, f64),
    /// Gaps in the recording and samples missing in them.
    pub gaps: (usize, usize),
    /// Phase at the start and at the end.
    pub phase: (f64, f64),
    /// Largest angle of the demonstration to its goal, rad.
    pub largest_angle_rad: f64,
    /// Reproduction of the position: largest and RMS distance, m.
    pub position_max_m: f64,
    /// Root mean square of the distance, m.
    pub position_rms_m: f64,
    /// RMS distance relative to the largest extent of the movement, 1.
    pub position_relative: f64,
    /// Reproduction of the orientation: largest angle, rad.
    pub orientation_max_rad: f64,
    /// Root mean square of the angle, rad.
    pub orientation_rms_rad: f64,
    /// Length of the reproduced path of orientation relative to the demonstrated one, 1.
    pub orientation_path_ratio: f64,
    /// Errors of the rows.
    pub rows: Vec<RowError>,
    /// Wrench that was measured while the movement was shown; empty if it was not recorded.
    pub wrench: Vec<WrenchStatistics>,
    /// Physical meaning of the feedback's gains.
    pub feedback: Option<FeedbackReport>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
}

impl FitReport {
    /// The report as text for a terminal.
    pub fn to_text(&self) -> String {
        let mut text = format!(
            "{}: {} kernels, {} samples, {:.3} s, phase {:.3} to {:.3}\n\
             trimmed {:.3} s before and {:.3} s behind; {} gaps with {} missing samples\n\
             position {:.3} mm RMS, {:.3} mm max ({:.2} % of the extent); \
             orientation {:.3} deg RMS, {:.3} deg max, path {:.4} of the demonstrated, largest angle to the goal {:.1} deg\n\n",
            self.name,
            self.kernels,
            self.samples,
            self.duration_s,
            self.phase.0,
            self.phase.1,
            self.trimmed_s.0,
            self.trimmed_s.1,
            self.gaps.0,
            self.gaps.1,
            self.position_rms_m * 1e3,
            self.position_max_m * 1e3,
            self.position_relative * 100.0,
            self.orientation_rms_rad.to_degrees(),
            self.orientation_max_rad.to_degrees(),
            self.orientation_path_ratio,
            self.largest_angle_rad.to_degrees(),
        );
        let mut rows = Table::new(["reproduction", "max", "RMS", "unit", "RMS/extent"]);
        for row in &self.rows {
            rows.row([
                row.row.to_owned(),
                format!("{:.6}", row.max),
                format!("{:.6}", row.rms),
                row.unit.to_owned(),
                row.relative.map_or_else(|| "-".to_owned(), |relative| format!("{:.3} %", relative * 100.0)),
            ]);
        }
        text += &rows.to_string();
        if !self.wrench.is_empty() {
            let mut wrench = Table::new(["measured", "mean", "deviation", "min", "max", "unit"]);
            for axis in &self.wrench {
                wrench.row([
                    axis.axis.to_owned(),
                    format!("{:.3}", axis.mean),
                    format!("{:.3}", axis.deviation),
                    format!("{:.3}", axis.min),
                    format!("{:.3}", axis.max),
                    axis.unit.to_owned(),
                ]);
            }
            text += &format!("\n{wrench}");
        }
        if let Some(feedback) = &self.feedback {
            text += &format!("\n{}", feedback.to_text());
        }
        text
    }
}

/// Statistics of a recorded wrench, axis by axis.
pub fn wrench_statistics(wrench: &[[f64; 6]]) -> Vec<WrenchStatistics> {
    let count = wrench.len().max(1) as f64;
    WRENCH_NAMES
        .iter()
        .enumerate()
        .map(|(index, (axis, unit))| {
            let values = || wrench.iter().map(|sample| sample[index]);
            let mean = values().sum::<f64>() / count;
            WrenchStatistics {
                axis,
                unit,
                mean,
                deviation: (values().map(|value| (value - mean).powi(2)).sum::<f64>() / count).sqrt(),
                min: values().fold(f64::INFINITY, f64::min),
                max: values().fold(f64::NEG_INFINITY, f64::max),
            }
        })
        .collect()
}

/// Largest and RMS value of errors, and the latter relative to the extent of `shown`.
pub fn row_error(index: usize, errors: &[f64], shown: &[f64]) -> RowError {
    let (row, unit) = ROW_NAMES[index];
    let max = errors.iter().fold(0.0_f64, |max, error| max.max(error.abs()));
    let rms = (errors.iter().map(|error| error * error).sum::<f64>() / errors.len().max(1) as f64).sqrt();
    let low = shown.iter().copied().fold(f64::INFINITY, f64::min);
    let high = shown.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    // A row that moves less than this (1 um, 1 urad) stands still: a ratio to it says nothing.
    let extent = high - low;
    RowError { row, unit, max, rms, relative: (extent > 1e-6).then(|| rms / extent) }
}
