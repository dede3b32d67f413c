//! From a demonstration to a primitive: filter, fit, roll out, compare.
//!
//! The fit itself (derivatives, zero-phase filter, ridge regression of Eq (2) on the inverted Eqs (1) and (6)) is
//! `dmp::fit`. Here the rows are gathered: position and orientation of the tool frame, the posture from the joint
//! angles, the fingers from a generated movement. What is reported is not the residual of the regression but the
//! error of the primitive that was made, rolled out from the demonstration's start and compared sample by sample.

mod calibration;
pub mod feedback;
mod fit;
pub mod hand;
pub mod memory;
mod range;
pub mod report;

use std::path::{Path, PathBuf};

use control::plan::bounds::{DISPLACEMENT, GAIN};
use control::plan::load::{LONGEST_MOVEMENT, SHORTEST_MOVEMENT};
use control::plan::primitive::Reference;
use dmp::fit::{LARGEST_ANGLE, LARGEST_ROTATION_VECTOR, WARNING_ANGLE};
use thiserror::Error;

use crate::demonstration::{
    Demonstration, DemonstrationError, PoseSource, Preparation, RATE, Recording, angle_between,
};
use crate::plan;
use crate::plot::movement::rotation_vectors;
use crate::primitive_file::{KERNEL_CAPACITY, OrientationError, PrimitiveFile, PrimitiveFileError, Provenance};
use feedback::{FeedbackOptions, FeedbackReport};
use hand::HandMotion;
use report::{FitReport, RowError, row_error, wrench_statistics};

/// Distance by which an arm must creep to be told of, m: less is no reason to weigh it.
const LEAST_CREPT: f64 = 0.5e-3;

/// Distance that the arm may move slowly before or behind what is learned without being told of, m: what a run may end
/// beside its goal.
const LEAST_LEFT_OUT: f64 = 3e-3;

/// Speed of the tool (turning counted, m/s) above which a demonstration does not begin or end at rest.
const MOVING_END: f64 = 0.01;

/// Fastest speed that may count as standing still, m/s: no movement that is shown by hand is faster all along.
const FASTEST_STILL: f64 = 1.0;

/// Speeds at which a movement can be learned, of the one that was shown.
pub const SPEEDS: std::ops::RangeInclusive<f64> = 0.1..=10.0;

/// Longest rest at the goal, s.
const LONGEST_DWELL: f64 = 60.0;

/// Arm posture for recordings without joint angles, rad: the middle of every joint's range but the elbow bent by a
/// right angle, far from every limit and every singularity.
pub const DEFAULT_POSTURE: [f64; 7] = [0.0, 0.0, 0.0, std::f64::consts::FRAC_PI_2, 0.0, 0.0, 0.0];

/// Options for learning a primitive.
#[derive(Debug, Clone, PartialEq)]
pub struct LearnOptions {
    /// Name of the primitive.
    pub name: String,
    /// Kernels of each row.
    pub kernels: usize,
    /// Cut-off of the zero-phase filter on the demonstration, Hz.
    pub cutoff: f64,
    /// Trimming.
    pub preparation: Preparation,
    /// Speed of the movement that is learned, of the one that was shown. People lead an arm slowly.
    pub speed: f64,
    /// Orientation error.
    pub orientation_error: OrientationError,
    /// Rest at the goal that is appended to the demonstration, s: time for the fingers to close.
    pub dwell: f64,
    /// Movement of the fingers, in fractions of the duration with the dwell.
    pub hand: HandMotion,
    /// Springs, sensitivity and limits.
    pub feedback: FeedbackOptions,
}

impl LearnOptions {
    /// The recommended values: 50 kernels, 7.5 Hz, quaternion error, an open hand. `tactus learn` repeats them as the
    /// defaults of its options.
    pub fn named(name: impl Into<String>) -> LearnOptions {
        LearnOptions {
            name: name.into(),
            kernels: 50,
            cutoff: 7.5,
            preparation: Preparation::default(),
            speed: 1.0,
            orientation_error: OrientationError::Quaternion,
            dwell: 0.0,
            hand: HandMotion::default(),
            feedback: FeedbackOptions::default(),
        }
    }
}

/// Why nothing was learned.
#[derive(Debug, Error)]
pub enum LearnError {
    /// The recording is no demonstration.
    #[error(transparent)]
    Demonstration(#[from] DemonstrationError),
    /// The movement turns too far from its goal for the orientation error that was chosen.
    #[error("{file}: line {line}: the movement turns {degrees:.1} degrees away from its goal, at most {limit:.0} can be followed", file = file.display())]
    TurnsTooFar {
        /// The recording.
        file: PathBuf,
        /// Line near which the angle is largest.
        line: u64,
        /// Largest angle, degrees.
        degrees: f64,
        /// Largest angle that can be followed, degrees.
        limit: f64,
        /// True if the rotation vector would follow it.
        rotation_vector_helps: bool,
    },
    /// An option is out of range.
    #[error("{option}: {reason}")]
    Option {
        /// Name of the option.
        option: &'static str,
        /// The reason.
        reason: String,
    },
    /// The regression failed.
    #[error("{file}: cannot be fitted: {reason}", file = file.display())]
    Fit {
        /// The recording.
        file: PathBuf,
        /// The reason that `dmp::fit` gives.
        reason: String,
    },
    /// The primitive leaves the way that was shown.
    #[error(
        "{file}: the primitive leaves the way that was shown by {:.0} mm and {:.0} degrees, at most {:.0} mm and {:.0} degrees are accepted",
        position * 1e3,
        orientation.to_degrees(),
        WORST_REPRODUCTION.0 * 1e3,
        WORST_REPRODUCTION.1.to_degrees(),
        file = file.display()
    )]
    Poor {
        /// The recording.
        file: PathBuf,
        /// Largest distance, m.
        position: f64,
        /// Largest angle, rad.
        orientation: f64,
    },
    /// The fitted primitive is no valid primitive.
    #[error(transparent)]
    Primitive(#[from] PrimitiveFileError),
}

/// A primitive and how well it fits.
#[derive(Debug, Clone)]
pub struct Learned {
    /// The primitive.
    pub primitive: PrimitiveFile,
    /// The report.
    pub report: FitReport,
    /// The demonstration it was fitted to.
    pub demonstration: Demonstration,
}

/// Reproductions worse than this (m, RMS) deserve more kernels.
const COARSE_POSITION: f64 = 2e-3;
/// Reproductions worse than this (rad, RMS: half a degree) deserve more kernels.
const COARSE_ORIENTATION: f64 = 0.5 * std::f64::consts::PI / 180.0;

/// Time behind the end of the movement at which its plan should have come to its goal, s.
const BEHIND: f64 = 1.0;

/// Reproductions that leave the way by more than this somewhere (m, rad) are no reproductions: 3 cm, 10 degrees.
const WORST_REPRODUCTION: (f64, f64) = (0.03, 10.0 * std::f64::consts::PI / 180.0);

/// Learns a primitive from a recording; `file` is where the primitive will be written.
///
/// # Errors
/// [`LearnError`].
pub fn learn(recording: &Recording, file: &Path, options: &LearnOptions) -> Result<Learned, LearnError> {
    check_options(options)?;
    let mut demonstration = Demonstration::prepare(recording, &options.preparation)?;
    if options.dwell > 0.0 && demonstration.speed().last().is_some_and(|speed| *speed > MOVING_END) {
        return Err(LearnError::Option {
            option: "--dwell",
            reason: "the demonstration ends in motion, and nothing can rest behind that".to_owned(),
        });
    }
    let mut warnings: Vec<String> = slow_ends(&demonstration).collect();
    if let Some(crept) = demonstration.crept.filter(|crept| *crept >= LEAST_CREPT) {
        warnings.push(format!(
            "the arm crept away by {:.0} mm once it was let go, which is left out; `tactus calibrate gravity` weighs it",
            crept * 1e3
        ));
    }
    let largest_angle = check_angle(recording, &demonstration, options, &mut warnings)?;
    demonstration.hasten(options.speed);
    demonstration.rest(options.dwell);
    check_duration(recording, demonstration.duration())?;
    let posture = match &demonstration.q {
        Some(q) => q.clone(),
        None => {
            warnings.push(
                "the recording has no joint angles: the posture rows hold a bent elbow, which is not that of its poses, so that `tactus check` and the device refuse the primitive; record q1_rad to q7_rad as well"
                    .to_owned(),
            );
            vec![DEFAULT_POSTURE; demonstration.len()]
        }
    };
    warnings.extend(range::warnings(&posture));
    warnings.extend(moving_ends(&demonstration.speed()));
    warnings.extend(options.hand.warnings(recording, demonstration.trimmed));
    if demonstration.pose_source == PoseSource::JointAngles && recording.position.is_some() {
        check_pose_columns(recording, &mut warnings);
    }
    let hand = options.hand.samples(demonstration.len());
    let fitted = fit::fit(&demonstration, &posture, &hand, options)
        .map_err(|reason| LearnError::Fit { file: recording.file.clone(), reason })?;
    let mut primitive = PrimitiveFile {
        file: file.to_owned(),
        name: options.name.clone(),
        model_hash: control::MODEL_HASH,
        provenance: None,
        ..fitted
    };
    primitive.feedback = Some(feedback::tables(&primitive, options));
    let mut report = compare(&primitive, recording, &demonstration, &posture, &hand, largest_angle, warnings)?;
    report.feedback = FeedbackReport::of(&primitive);
    report.warnings.extend(report.feedback.as_ref().map(FeedbackReport::warnings).unwrap_or_default());
    let (position, orientation) = (report.position_max_m, report.orientation_max_rad);
    if position > WORST_REPRODUCTION.0 || orientation > WORST_REPRODUCTION.1 {
        return Err(LearnError::Poor { file: recording.file.clone(), position, orientation });
    }
    report.warnings.extend(few_kernels(&report, &primitive, options));
    primitive.provenance = Some(Provenance {
        demonstration: recording.file.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default(),
        demonstration_checksum: recording.checksum,
        samples: demonstration.len(),
        trimmed: demonstration.trimmed.into(),
        speed: options.speed,
        largest_angle,
        position_error: [report.position_max_m, report.position_rms_m],
        orientation_error: [report.orientation_max_rad, report.orientation_rms_rad],
        posture_error: group_error(&report, 6..13),
        tool: format!("tactus {}", env!("CARGO_PKG_VERSION")),
    });
    Ok(Learned { primitive, report, demonstration })
}

/// Warning of too few kernels: the plan leaves the way that was shown, or, where the last part of a long movement is
/// fast, its goal behind the end. There its last kernel acts alone, and fades within a fifth of the duration.
fn few_kernels(report: &FitReport, primitive: &PrimitiveFile, options: &LearnOptions) -> Option<String> {
    if options.kernels >= KERNEL_CAPACITY {
        return None;
    }
    let words = |off: &str, metres: f64, radians: f64| {
        let (mm, degrees) = (metres * 1e3, radians.to_degrees());
        format!(
            "{} kernels are too few for this movement: {off} by {mm:.1} mm and {degrees:.1} degrees; learn it with \
             --kernels {KERNEL_CAPACITY}",
            options.kernels
        )
    };
    if report.position_rms_m > COARSE_POSITION || report.orientation_rms_rad > COARSE_ORIENTATION {
        return Some(words("the RMS of the reproduction is off", report.position_rms_m, report.orientation_rms_rad));
    }
    let (away, turned) = plan::left_behind(&primitive.to_primitive().ok()?, BEHIND).ok()?;
    (away > COARSE_POSITION || turned > COARSE_ORIENTATION)
        .then(|| words("a second behind its end the plan is off its goal", away, turned))
}

/// Warnings of a slow approach or departure that counted as rest: the primitive would end short of where it was led.
fn slow_ends(demonstration: &Demonstration) -> impl Iterator<Item = String> {
    let (before, behind) = demonstration.left_out;
    [(before, "before"), (behind, "behind")].into_iter().filter(|(moved, _)| *moved > LEAST_LEFT_OUT).map(
        |(moved, side)| {
            format!(
                "{side} the movement the arm moved by another {:.0} mm, so slowly that it counts as rest: that is left out; a lower `--still-speed` or `--no-trim` keeps it",
                moved * 1e3
            )
        },
    )
}

/// Refuses what the control code would not play.
fn check_duration(recording: &Recording, duration: f64) -> Result<(), DemonstrationError> {
    if (SHORTEST_MOVEMENT..=LONGEST_MOVEMENT).contains(&duration) {
        return Ok(());
    }
    Err(DemonstrationError::Duration { file: recording.file.clone(), duration })
}

/// Warnings of a movement that begins or ends with one of these speeds (m/s), and not at rest.
fn moving_ends(speed: &[f64]) -> impl Iterator<Item = String> {
    let ends = [("begins", speed.first()), ("ends", speed.last())];
    ends.into_iter().filter_map(|(end, speed)| {
        let speed = speed.filter(|speed| **speed > MOVING_END)?;
        Some(format!(
            "the demonstration {end} in motion, at {speed:.3} m/s: a run starts and ends at rest, hold the arm still for half a second before and after"
        ))
    })
}

/// Softest spring that a primitive can have.
const SOFTEST: f64 = 0.1;

/// Refuses values that are out of range.
fn check_options(options: &LearnOptions) -> Result<(), LearnError> {
    let wrong = |option: &'static str, reason: &str| Err(LearnError::Option { option, reason: reason.to_owned() });
    if !options.hand.is_valid() {
        return wrong("--hand-window", "two fractions of the duration in order, between 0 and 1, are expected");
    }
    if !(0.0..=LONGEST_DWELL).contains(&options.dwell) {
        return wrong("--dwell", &format!("a time between 0 and {LONGEST_DWELL} s is expected"));
    }
    if options.preparation.still_speed.is_some_and(|speed| !(speed > 0.0 && speed <= FASTEST_STILL)) {
        return wrong(
            "--still-speed",
            &format!("a speed between 0 and {FASTEST_STILL} m/s is expected; 0.005 is usual"),
        );
    }
    if !SPEEDS.contains(&options.speed) {
        return wrong("--speed", &format!("a factor from {} to {} is expected", SPEEDS.start(), SPEEDS.end()));
    }
    let highest = RATE / 2.0 / options.speed.max(1.0);
    if !(options.cutoff > 0.0 && options.cutoff < highest) {
        return wrong("--cutoff", &format!("a frequency between 0 and {highest} Hz is expected; 7.5 Hz is usual"));
    }
    let feedback = &options.feedback;
    let positive = |value: Option<f64>| value.is_none_or(|value| (SOFTEST..=GAIN).contains(&value));
    if !positive(feedback.stiffness) {
        return wrong("--stiffness", "a number from 0.1 to 1e4 is expected");
    }
    if !positive(feedback.orientation_stiffness) {
        return wrong("--orientation-stiffness", "a number from 0.1 to 1e4 is expected");
    }
    if feedback.sensitivity.is_some_and(|k1| !k1.iter().all(|k1| (0.0..=1e6).contains(k1))) {
        return wrong("--k1", "numbers between 0 and 1e6 are expected: a negative one would run towards what pushes");
    }
    match feedback.limits {
        Some([metres, degrees, hand])
            if !(0.0..=DISPLACEMENT[0]).contains(&metres)
                || !(0.0..=DISPLACEMENT[1]).contains(&degrees.to_radians())
                || !(0.0..=DISPLACEMENT[2]).contains(&hand) =>
        {
            wrong("--clamp", "metres up to 1, degrees up to 180 and radians up to 3 are expected")
        }
        _ => Ok(()),
    }
}

/// Largest angle to the goal along the way that was shown, rad, or why it is too large.
fn check_angle(
    recording: &Recording,
    demonstration: &Demonstration,
    options: &LearnOptions,
    warnings: &mut Vec<String>,
) -> Result<f64, LearnError> {
    let goal = demonstration.orientation[demonstration.len() - 1];
    let angles = rotation_vectors(&goal, &demonstration.orientation)
        .into_iter()
        .map(|vector| vector.iter().map(|part| part * part).sum::<f64>().sqrt());
    let (worst, angle) =
        angles.enumerate().fold((0, 0.0), |worst, (index, angle)| if angle > worst.1 { (index, angle) } else { worst });
    let limit = match options.orientation_error {
        OrientationError::Quaternion => LARGEST_ANGLE,
        OrientationError::RotationVector => LARGEST_ROTATION_VECTOR,
    };
    if angle > limit {
        // The demonstration was resampled and trimmed: find the recorded line at the same time.
        let time = recording.time[0] + demonstration.trimmed.0 + demonstration.time[worst];
        let sample = recording.time.partition_point(|t| *t < time).min(recording.len() - 1);
        return Err(LearnError::TurnsTooFar {
            file: recording.file.clone(),
            line: recording.lines[sample],
            degrees: angle.to_degrees(),
            limit: limit.to_degrees(),
            rotation_vector_helps: options.orientation_error == OrientationError::Quaternion
                && angle <= LARGEST_ROTATION_VECTOR,
        });
    }
    if angle > WARNING_ANGLE && options.orientation_error == OrientationError::Quaternion {
        warnings.push(format!(
            "the movement turns {:.1} degrees away from its goal: beyond 150 degrees the spring of the quaternion error grows weak, consider --rotation-vector",
            angle.to_degrees()
        ));
    }
    Ok(angle)
}

/// Warns if pose columns contradict the joint angles: another tool frame, or another model of the arm.
fn check_pose_columns(recording: &Recording, warnings: &mut Vec<String>) {
    let (Some(q), Some(position), Some(orientation)) = (&recording.q, &recording.position, &recording.orientation)
    else {
        return;
    };
    let mut worst = (0.0_f64, 0.0_f64);
    for ((q, x), orientation) in q.iter().zip(position).zip(orientation) {
        let (computed, turned) = crate::arm::tool_pose(q);
        let distance = (0..3).map(|axis| (computed[axis] - x[axis]).powi(2)).sum::<f64>().sqrt();
        worst = (worst.0.max(distance), worst.1.max(angle_between(&turned, orientation)));
    }
    if worst.0 > 1e-3 || worst.1 > 0.5_f64.to_radians() {
        warnings.push(format!(
            "the pose columns differ from the kinematics of the joint angles by up to {:.1} mm and {:.2} degrees; the joint angles were used",
            worst.0 * 1e3,
            worst.1.to_degrees()
        ));
    }
}

/// Rolls the primitive out and compares it with what was shown.
fn compare(
    file: &PrimitiveFile,
    recording: &Recording,
    demonstration: &Demonstration,
    posture: &[[f64; 7]],
    hand: &[[f64; 4]],
    largest_angle: f64,
    warnings: Vec<String>,
) -> Result<FitReport, LearnError> {
    let primitive = file.to_primitive()?;
    let references = plan::roll_out(&primitive)
        .map_err(|error| LearnError::Fit { file: recording.file.clone(), reason: error.to_string() })?;
    let count = references.len().min(demonstration.len());
    let references = &references[..count];
    let orientation: Vec<[f64; 4]> = references.iter().map(plan::orientation).collect();
    let distances: Vec<f64> = references
        .iter()
        .zip(&demonstration.position)
        .map(|(reference, x)| {
            (0..3).map(|axis| (reference.poses[0].position.x[axis] - x[axis]).powi(2)).sum::<f64>().sqrt()
        })
        .collect();
    let angles: Vec<f64> = orientation
        .iter()
        .zip(&demonstration.orientation)
        .map(|(planned, shown)| angle_between(planned, shown))
        .collect();
    let path = |orientations: &[[f64; 4]]| -> f64 {
        orientations.windows(2).map(|pair| angle_between(&pair[0], &pair[1])).sum()
    };
    let shown_path = path(&demonstration.orientation[..count]);
    let position_rms = root_mean_square(&distances);
    Ok(FitReport {
        name: file.name.clone(),
        kernels: file.kernels(),
        samples: demonstration.len(),
        duration_s: file.movement.duration,
        trimmed_s: demonstration.trimmed,
        gaps: (recording.gaps, recording.missing_samples),
        phase: (1.0, (-file.movement.alpha).exp()),
        largest_angle_rad: largest_angle,
        position_max_m: largest(&distances),
        position_rms_m: position_rms,
        position_relative: position_rms / demonstration.extent().max(1e-9),
        orientation_max_rad: largest(&angles),
        orientation_rms_rad: root_mean_square(&angles),
        // Below a hundredth of a radian the path is noise: a ratio to it says nothing.
        orientation_path_ratio: if shown_path > 0.01 { path(&orientation) / shown_path } else { 1.0 },
        rows: row_errors(references, &orientation, demonstration, posture, hand),
        wrench: demonstration.wrench.as_deref().map(wrench_statistics).unwrap_or_default(),
        feedback: None,
        warnings,
    })
}

/// Reproduction errors of all rows, in the order of the weights.
fn row_errors(
    references: &[Reference<f64>],
    orientation: &[[f64; 4]],
    demonstration: &Demonstration,
    posture: &[[f64; 7]],
    hand: &[[f64; 4]],
) -> Vec<RowError> {
    type Shown<'a> = &'a dyn Fn(usize) -> f64;
    let count = references.len();
    let mut rows = Vec::with_capacity(control::plan::primitive::ROWS);
    let mut add = |shown: Shown<'_>, error: Shown<'_>| {
        let values = |of: Shown<'_>| (0..count).map(of).collect::<Vec<f64>>();
        rows.push(row_error(rows.len(), &values(error), &values(shown)));
    };
    for axis in 0..3 {
        let shown = |index: usize| demonstration.position[index][axis];
        add(&shown, &|index| references[index].poses[0].position.x[axis] - shown(index));
    }
    let goal = demonstration.orientation[demonstration.len() - 1];
    let shown = rotation_vectors(&goal, &demonstration.orientation);
    let errors: Vec<[f64; 3]> = demonstration
        .orientation
        .iter()
        .zip(orientation)
        .map(|(shown, planned)| rotation_vectors(shown, &[*planned])[0])
        .collect();
    for axis in 0..3 {
        add(&|index| shown[index][axis], &|index| errors[index][axis]);
    }
    for (joint, columns) in (0..7).map(|joint| (joint, 0)).chain((0..4).map(|joint| (joint, 7))) {
        let shown = |index: usize| if columns == 0 { posture[index][joint] } else { hand[index][joint] };
        add(&shown, &|index| references[index].points.x[columns + joint] - shown(index));
    }
    rows
}

fn group_error(report: &FitReport, rows: std::ops::Range<usize>) -> [f64; 2] {
    let rows = &report.rows[rows];
    let max = rows.iter().fold(0.0_f64, |max, row| max.max(row.max));
    let mean_square = rows.iter().map(|row| row.rms * row.rms).sum::<f64>() / rows.len() as f64;
    [max, mean_square.sqrt()]
}

fn largest(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

fn root_mean_square(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len().max(1) as f64).sqrt()
}
