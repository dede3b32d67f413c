//! Tracking of the plan by an execution: the figures that the run's report, the figure and the demo's table show.

use schemars::JsonSchema;
use serde::Serialize;
use thiserror::Error;

use crate::demonstration::{Recording, angle_between};

/// Tracking of one run: measured against desired pose, cycle by cycle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
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

/// Tracking of the hand's plan in one run: measured against desired digits, in the order spread, F1, F2, F3.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct HandTracking {
    /// Samples compared.
    pub samples: usize,
    /// Root mean square distance of each digit, rad.
    pub rms_rad: [f64; 4],
    /// Largest distance of each digit, rad.
    pub max_rad: [f64; 4],
    /// Distance of each digit at the last sample, rad.
    pub end_rad: [f64; 4],
}

/// Distance (m) and angle (rad) from the end of its plan within which an arm counts as arrived. Force control leaves
/// the plan by millimetres where the hand touches something; by more than this it was held up.
pub const GOAL_TOLERANCE: (f64, f64) = (0.05, 15.0 * std::f64::consts::PI / 180.0);

/// An arm that rests elsewhere than its plan ends.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error(
    "the arm ended {:.0} mm and {:.0} degrees away from its goal; at most {:.0} mm and {:.0} degrees count as there",
    .away * 1e3,
    .turned.to_degrees(),
    GOAL_TOLERANCE.0 * 1e3,
    GOAL_TOLERANCE.1.to_degrees()
)]
pub struct Missed {
    /// Distance from the goal, m.
    pub away: f64,
    /// Angle from the goal, rad.
    pub turned: f64,
}

/// Reason for which a run cannot be compared with its plan or with another run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum Lack {
    /// The measured or the desired pose.
    #[error("the columns of the measured and of the desired pose (x_m..qz, x_d_m..qz_d) are both needed")]
    Poses,
    /// The measured or the desired hand.
    #[error("the columns of the measured and of the desired hand (spread_rad.., spread_d_rad..) are both needed")]
    Hands,
    /// A column that two runs are compared by.
    #[error("joint angles, measured pose and wrench (q1_rad.., x_m..qz, fx_N..tz_Nm) are needed")]
    Columns,
    /// A sample to compare.
    #[error("there is no sample in state `run`")]
    Run,
}

/// A recording that cannot be compared.
#[derive(Debug, Error)]
#[error("{file}: {lack}", file = file.display())]
pub struct ComparisonError {
    /// The file.
    pub file: std::path::PathBuf,
    /// The data that it lacks.
    pub lack: Lack,
}

impl ComparisonError {
    /// The error of a recording.
    pub(crate) fn of(recording: &Recording, lack: Lack) -> ComparisonError {
        ComparisonError { file: recording.file.clone(), lack }
    }
}

impl Tracking {
    /// Compares the part of a recording in which a plan was played (all of it, if it has no states).
    ///
    /// # Errors
    /// [`ComparisonError`].
    pub fn of_run(recording: &Recording) -> Result<Tracking, ComparisonError> {
        let run = recording.running();
        let errors = errors(&run).ok_or_else(|| ComparisonError::of(recording, Lack::Poses))?;
        let (Some(last), count) = (errors.last(), errors.len() as f64) else {
            return Err(ComparisonError::of(recording, Lack::Run));
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

    /// Returns the distance of the arm from the end of its plan; `None` where it is at its goal.
    #[must_use]
    pub fn missed(&self) -> Option<Missed> {
        let missed = Missed { away: self.position_end_m, turned: self.orientation_end_rad };
        // Not a number is no goal reached either.
        let is_there = missed.away <= GOAL_TOLERANCE.0 && missed.turned <= GOAL_TOLERANCE.1;
        (!is_there).then_some(missed)
    }
}

impl HandTracking {
    /// Compares the part of a recording in which a plan was played (all of it, if it has no states).
    ///
    /// # Errors
    /// [`ComparisonError`].
    pub fn of_run(recording: &Recording) -> Result<HandTracking, ComparisonError> {
        let run = recording.running();
        let (Some(hand), Some(hand_d)) = (&run.hand, &run.hand_d) else {
            return Err(ComparisonError::of(recording, Lack::Hands));
        };
        let errors: Vec<[f64; 4]> = hand
            .iter()
            .zip(hand_d)
            .map(|(hand, hand_d)| std::array::from_fn(|digit| (hand[digit] - hand_d[digit]).abs()))
            .collect();
        let Some(end_rad) = errors.last().copied() else {
            return Err(ComparisonError::of(recording, Lack::Run));
        };
        let count = errors.len() as f64;
        let of_digits = |figure: &dyn Fn(usize) -> f64| std::array::from_fn(figure);
        Ok(HandTracking {
            samples: errors.len(),
            rms_rad: of_digits(&|digit| (errors.iter().map(|error| error[digit].powi(2)).sum::<f64>() / count).sqrt()),
            max_rad: of_digits(&|digit| errors.iter().map(|error| error[digit]).fold(0.0, f64::max)),
            end_rad,
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

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// A hand whose finger 2 is behind its plan by as much as the state says: 0.1 and 0.3 rad in turn, and far more
    /// before the run.
    fn recording(names: &str) -> Recording {
        let mut text = format!("t_s,state,{names}\n");
        for line in 0..120 {
            let (state, behind) = match line {
                0..20 => ("hold", 2.0),
                _ if line % 2 == 0 => ("run", 0.1),
                _ => ("coast", 0.3),
            };
            let time = f64::from(line) / 300.0;
            text += &format!("{time},{state},0.5,1,1,1,0.5,1,{},1\n", 1.0 + behind);
        }
        Recording::parse(Path::new("run.csv"), text.as_bytes()).unwrap()
    }

    const HAND: &str = "spread_rad,finger1_rad,finger2_rad,finger3_rad,\
                        spread_d_rad,finger1_d_rad,finger2_d_rad,finger3_d_rad";

    #[test]
    fn fingers_are_compared_with_their_plan_while_it_is_played() {
        let tracking = HandTracking::of_run(&recording(HAND)).unwrap();
        assert_eq!(tracking.samples, 100);
        let close = |found: [f64; 4], expected: f64| {
            (found[2] - expected).abs() < 1e-12 && [found[0], found[1], found[3]] == [0.0; 3]
        };
        assert!(close(tracking.rms_rad, 0.05_f64.sqrt()), "{tracking:?}");
        assert!(close(tracking.max_rad, 0.3) && close(tracking.end_rad, 0.3), "{tracking:?}");
    }

    #[test]
    fn without_a_hand_nothing_is_made_up() {
        let text = HAND.replace("_d_rad", "_x").replace("_rad", "_y");
        assert_eq!(HandTracking::of_run(&recording(&text)).unwrap_err().lack, Lack::Hands);
        assert_eq!(Tracking::of_run(&recording(HAND)).unwrap_err().lack, Lack::Poses);
    }

    #[test]
    fn an_arm_that_ends_away_from_its_goal_has_missed_it_and_the_distance_is_told() {
        let ended = |position_end_m: f64, orientation_end_rad: f64| {
            let tracking = Tracking {
                samples: 1,
                position_rms_m: 0.0,
                position_max_m: 0.0,
                position_end_m,
                orientation_rms_rad: 0.0,
                orientation_max_rad: 0.0,
                orientation_end_rad,
            };
            tracking.missed()
        };
        assert_eq!(ended(0.012, 0.05), None);
        let words = ended(0.22, 75f64.to_radians()).unwrap().to_string();
        assert!(words.contains("220 mm and 75 degrees away"), "{words}");
        assert!(ended(0.0, 0.3).is_some() && ended(0.06, 0.0).is_some() && ended(f64::NAN, 0.0).is_some());
    }
}
