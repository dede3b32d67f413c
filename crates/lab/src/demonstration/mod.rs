//! Demonstrations: recordings of a movement that was shown by hand, made ready to be learned from.
//!
//! [`Recording`] is what stands in a file, checked value by value; [`Demonstration`] is the movement in it: a pose
//! at each instant, 300 times a second, without the time in which the arm stood still before and after.
//! The layout of the files is described in `docs/recording-format.md`.

pub mod error;
pub mod layout;
mod leap;
pub mod origin;
pub mod recording;
pub mod resample;
mod runs;
pub mod writer;

pub use error::{DemonstrationError, Place, RecordingError};
pub use layout::RecordingRow;
pub use origin::{Origin, Played};
pub use recording::{FEWEST_SAMPLES, Recording};
pub use writer::RecordingWriter;

use crate::arm;

/// Rate at which a primitive is learned and played, Hz. Another value would change what 7.5 Hz means to the filter.
pub const RATE: f64 = control::RATE;

/// Samples further apart than this (s) in the mean are of a clock that counts milliseconds: 300 Hz are 3.3 of them, and
/// nothing that records an arm is slower than once in a second.
const LONGEST_STEP: f64 = 1.0;

/// Longest gap that is bridged by a straight line, s. A hand can change direction within a tenth of a second; what
/// happened in a longer gap is not known.
pub const LONGEST_GAP: f64 = 0.1;

/// Error of a difference of two times, s: those of a computer's clock, counted from 1970, are a quarter of it.
const TIME_ROUNDING: f64 = 1e-6;

/// Options for making a demonstration of a recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Preparation {
    /// Speed of the tool frame below which the arm counts as still, m/s; turning counts with [`TURN_RADIUS`].
    /// `None` keeps the whole recording.
    pub still_speed: Option<f64>,
}

impl Default for Preparation {
    fn default() -> Preparation {
        Preparation { still_speed: Some(0.005) }
    }
}

/// Radius at which a rotation of the tool frame counts as speed, m: about the reach of the fingers beyond the grasp
/// point, so that a movement of the wrist alone is not cut off.
pub const TURN_RADIUS: f64 = 0.1;

/// Rest that is kept before and behind the movement, samples (0.3 s).
///
/// A primitive begins and ends at rest. Cut at the first and last movement, the demonstration ends with a few mm/s, the
/// forcing term is fitted to that, and behind the end the plan coasts on: 8 mm beyond a goal that the fit itself meets
/// to 0.01 mm, coming back only over several seconds.
const REST: usize = 90;

/// Samples on either side over which the speed is averaged: encoder steps and tremor of one sample are not movement.
const SPEED_HALF_WINDOW: usize = 15;

/// Longest time for which an arm creeps away at the end of a recording, samples (1.5 s), and how far (m, turning counts
/// with [`TURN_RADIUS`]). What lasts longer or goes farther is movement.
const CREEPING: (usize, f64) = (450, 0.03);

/// Rest before that, samples (0.1 s): one that only turns back stands still for less.
const REST_BEFORE_CREEPING: usize = 30;

/// A movement on a uniform grid of [`RATE`].
#[derive(Debug, Clone, PartialEq)]
pub struct Demonstration {
    /// Time since its beginning, s.
    pub time: Vec<f64>,
    /// Position of the tool frame, world, m.
    pub position: Vec<[f64; 3]>,
    /// Orientation of the tool frame, unit quaternion (w, x, y, z), sign-continuous.
    pub orientation: Vec<[f64; 4]>,
    /// Joint angles, rad, if they were recorded.
    pub q: Option<Vec<[f64; layout::JOINTS]>>,
    /// Wrench of the environment on the robot, if it was recorded: N (world), N m.
    pub wrench: Option<Vec<[f64; 6]>>,
    /// Time that was cut off at the beginning and at the end, s.
    pub trimmed: (f64, f64),
    /// Distance by which the arm crept away at the end, once it was let go, m; that is cut off.
    pub crept: Option<f64>,
    /// Distance by which the arm moved in what was cut off before and behind the movement, m, turning counted at
    /// [`TURN_RADIUS`]; what [`crept`](Self::crept) tells is not counted.
    pub left_out: (f64, f64),
    /// Where the pose comes from.
    pub pose_source: PoseSource,
}

/// Where the pose of a demonstration comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PoseSource {
    /// Computed from the recorded joint angles by the forward kinematics of the arm's model.
    JointAngles,
    /// The pose columns as they are.
    PoseColumns,
}

impl Demonstration {
    /// Rests at the end for another `seconds`, to the nearest sample.
    pub fn rest(&mut self, seconds: f64) {
        let samples = (seconds * RATE).round() as usize;
        fn hold<T: Clone>(values: &mut Vec<T>, samples: usize) {
            if let Some(last) = values.last().cloned() {
                values.resize(values.len() + samples, last);
            }
        }
        for _ in 0..samples {
            self.time.push(self.time.len() as f64 / RATE);
        }
        hold(&mut self.position, samples);
        hold(&mut self.orientation, samples);
        if let Some(q) = &mut self.q {
            hold(q, samples);
        }
        if let Some(wrench) = &mut self.wrench {
            hold(wrench, samples);
        }
    }

    /// Goes the same way `speed` times as fast as it was shown.
    pub fn hasten(&mut self, speed: f64) {
        let shown: Vec<f64> = self.time.iter().map(|time| time / speed).collect();
        let grid = resample::grid(&shown, 1.0 / RATE);
        self.position = resample::vectors(&shown, &self.position, &grid);
        self.orientation = resample::quaternions(&shown, &self.orientation, &grid);
        self.q = self.q.as_ref().map(|q| resample::vectors(&shown, q, &grid));
        self.wrench = self.wrench.as_ref().map(|wrench| resample::vectors(&shown, wrench, &grid));
        self.time = grid;
    }

    /// Resamples, finds the pose and trims.
    ///
    /// Joint angles count more than pose columns: they are what the arm measured, and the pose that the controller
    /// will see is the one its own kinematics makes of them.
    ///
    /// # Errors
    /// The recording has no pose, is shorter than a control period, has a gap longer than [`LONGEST_GAP`], or the arm
    /// hardly moves in it.
    pub fn prepare(recording: &Recording, preparation: &Preparation) -> Result<Demonstration, DemonstrationError> {
        let (gap, behind) = recording.longest_gap;
        // Times of few digits: a tenth of a second of a recording at 10 Hz is not more than one.
        if gap > LONGEST_GAP + TIME_ROUNDING {
            let steps = recording.len().saturating_sub(1).max(1) as f64;
            let step = (recording.time[recording.len() - 1] - recording.time[0]) / steps;
            if step > LONGEST_STEP {
                return Err(RecordingError::NoSeconds { place: recording.place(behind, layout::TIME), step }.into());
            }
            return Err(RecordingError::GapTooLong {
                place: recording.place(behind, layout::TIME),
                gap,
                longest: LONGEST_GAP,
            }
            .into());
        }
        leap::refuse(recording)?;
        let grid = resample::grid(&recording.time, 1.0 / RATE);
        if grid.len() < 2 {
            // Nothing lies between one point and none, and no speed can be told.
            let duration = recording.time[recording.len() - 1] - recording.time[0];
            return Err(DemonstrationError::Duration { file: recording.file.clone(), duration });
        }
        let q = recording.q.as_ref().map(|values| resample::vectors(&recording.time, values, &grid));
        let (position, orientation, pose_source) = match (&q, &recording.position, &recording.orientation) {
            (Some(q), _, _) => {
                let (position, mut orientation): (Vec<_>, Vec<_>) = q.iter().map(arm::tool_pose).unzip();
                recording::make_sign_continuous(&mut orientation);
                (position, orientation, PoseSource::JointAngles)
            }
            (None, Some(position), Some(orientation)) => (
                resample::vectors(&recording.time, position, &grid),
                resample::quaternions(&recording.time, orientation, &grid),
                PoseSource::PoseColumns,
            ),
            _ => {
                return Err(DemonstrationError::NoPose {
                    file: recording.file.clone(),
                    line: recording.header_line,
                    column: recording.names.len() + 1,
                });
            }
        };
        let wrench = recording.wrench.as_ref().map(|values| resample::vectors(&recording.time, values, &grid));
        let whole = Demonstration {
            time: grid.iter().map(|t| t - grid[0]).collect(),
            position,
            orientation,
            q,
            wrench,
            trimmed: (0.0, 0.0),
            crept: None,
            left_out: (0.0, 0.0),
            pose_source,
        };
        whole.trim(recording, preparation)
    }

    fn trim(self, recording: &Recording, preparation: &Preparation) -> Result<Demonstration, DemonstrationError> {
        let Some(threshold) = preparation.still_speed else {
            return Ok(self);
        };
        let speed = self.speed();
        let (end, crept) = match self.let_go(&speed, threshold) {
            Some((end, crept)) => (end, Some(crept)),
            None => (speed.len() - 1, None),
        };
        let first = speed.iter().position(|speed| *speed > threshold);
        let last = speed[..=end].iter().rposition(|speed| *speed > threshold);
        let (first, last) = match (first, last) {
            (Some(first), Some(last)) => (first, last),
            _ => (0, 0),
        };
        if last - first + 1 < FEWEST_SAMPLES {
            return Err(DemonstrationError::Still {
                file: recording.file.clone(),
                first_line: recording.lines.first().copied().unwrap_or_default(),
                last_line: recording.lines.last().copied().unwrap_or_default(),
                moving: (last - first) as f64 / RATE,
                needed: FEWEST_SAMPLES as f64 / RATE,
                threshold,
                extent: self.extent(),
                duration: self.duration(),
            });
        }
        let (first, last) = (first.saturating_sub(REST), (last + REST).min(end));
        let trimmed = (self.time[first], self.time[self.time.len() - 1] - self.time[last]);
        let left_out = (self.distance(0, first), self.distance(last, end));
        let range = first..=last;
        Ok(Demonstration {
            time: (0..=last - first).map(|index| index as f64 / RATE).collect(),
            position: self.position[range.clone()].to_vec(),
            orientation: self.orientation[range.clone()].to_vec(),
            q: self.q.map(|values| values[range.clone()].to_vec()),
            wrench: self.wrench.map(|values| values[range.clone()].to_vec()),
            trimmed,
            crept,
            left_out,
            pose_source: self.pose_source,
        })
    }

    /// The last sample at which the arm stood still, and how far it crept away from there until the end (m): an arm
    /// that nobody holds any more and that weighs otherwise than its model. `None` where it did not.
    fn let_go(&self, speed: &[f64], threshold: f64) -> Option<(usize, f64)> {
        let end = speed.len() - 1;
        let still = speed.iter().rposition(|speed| *speed <= threshold)?;
        let rested = speed[..=still].iter().rev().take_while(|speed| **speed <= threshold).count();
        let crept = self.distance(still, end);
        let (longest, farthest) = CREEPING;
        let is_creeping = (1..=longest).contains(&(end - still)) && rested >= REST_BEFORE_CREEPING && crept <= farthest;
        is_creeping.then_some((still, crept))
    }

    /// Distance of the tool frame between two samples, m, turning included at [`TURN_RADIUS`].
    fn distance(&self, from: usize, to: usize) -> f64 {
        let moved =
            (0..3).map(|axis| (self.position[to][axis] - self.position[from][axis]).powi(2)).sum::<f64>().sqrt();
        moved + TURN_RADIUS * angle_between(&self.orientation[from], &self.orientation[to])
    }

    /// Speed of the tool frame at each sample, m/s, turning included at [`TURN_RADIUS`].
    pub fn speed(&self) -> Vec<f64> {
        let last = self.time.len() - 1;
        (0..=last)
            .map(|index| {
                let before = index.saturating_sub(SPEED_HALF_WINDOW);
                let after = (index + SPEED_HALF_WINDOW).min(last);
                self.distance(before, after) / (self.time[after] - self.time[before])
            })
            .collect()
    }

    /// Length of the movement, s.
    pub fn duration(&self) -> f64 {
        self.time.last().copied().unwrap_or(0.0)
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.time.len()
    }

    /// True if there are no samples; a demonstration that was prepared is never empty.
    pub fn is_empty(&self) -> bool {
        self.time.is_empty()
    }

    /// Largest extent of the position along any axis, m.
    pub fn extent(&self) -> f64 {
        (0..3)
            .map(|axis| {
                let values = self.position.iter().map(|position| position[axis]);
                let (low, high) = values
                    .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
                high - low
            })
            .fold(0.0, f64::max)
    }
}

/// Angle of the rotation between two orientations, rad, 0 to pi.
pub fn angle_between(a: &[f64; 4], b: &[f64; 4]) -> f64 {
    let dot: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
    let sign = if dot < 0.0 { -1.0 } else { 1.0 };
    // The distance keeps its digits where the cosine has none left: at small angles.
    let distance = a.iter().zip(b).map(|(a, b)| (a - sign * b).powi(2)).sum::<f64>().sqrt();
    4.0 * (distance / 2.0).min(1.0).asin()
}
