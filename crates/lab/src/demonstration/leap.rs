//! Leaps in a recording: outliers and wrapped angles; and degrees. Fitted, each would be a movement that nobody has
//! shown.

use std::f64::consts::TAU;

use super::error::RecordingError;
use super::recording::Recording;
use super::{angle_between, layout};

/// Bound of a value from one line to the next: this far at once, and this fast. Encoders, times and numbers of few
/// digits stay below the first part.
///
/// Measured as the largest share of the bound that a recording uses. The example demonstration and four movements
/// of the simulated teacher, at 50 and 300 Hz: 4 % of a joint's, 1 % of the position's. Three recordings of an arm that
/// a person led, 1800 lines each at 300 Hz: 1 % of the position's, 4 % of the turn's. At 300 Hz nothing shorter than
/// 0.13 rad, 67 mm or 0.27 rad in one line is a leap: what is smaller is fitted as a movement.
#[derive(Clone, Copy)]
struct Bound {
    at_once: f64,
    per_second: f64,
    unit: &'static str,
}

const JOINT: Bound = Bound { at_once: 0.1, per_second: 10.0, unit: "rad" };
const POSITION: Bound = Bound { at_once: 0.05, per_second: 5.0, unit: "m" };
const TURN: Bound = Bound { at_once: 0.2, per_second: 20.0, unit: "rad" };

/// A leap this near to whole turns is an angle that was wrapped, rad.
const WHOLE_TURN: f64 = 0.2;

/// No joint of the arm goes farther, rad: a whole turn, and a wrapped angle's beyond it.
const LARGEST_ANGLE: f64 = 2.0 * TAU;

/// Refuses a recording whose joint angles are too large for radians, or whose pose leaps: that of the joint angles, or
/// of the pose columns where there are none.
///
/// # Errors
/// [`RecordingError::Leap`] with the first line behind a leap; [`RecordingError::NoRadians`].
pub(super) fn refuse(recording: &Recording) -> Result<(), RecordingError> {
    let is_alias = recording.names.iter().any(|name| name == layout::POSITION_ALIAS[0]);
    let position = if is_alias { layout::POSITION_ALIAS } else { layout::POSITION };
    for index in 1..recording.len() {
        if let Some(q) = &recording.q {
            for (joint, name) in layout::JOINT_POSITIONS.iter().enumerate() {
                let (angle, leap) = (q[index][joint], (q[index][joint] - q[index - 1][joint]).abs());
                if angle.abs() > LARGEST_ANGLE {
                    return Err(RecordingError::NoRadians { place: recording.place(index, name), angle });
                }
                check(recording, index, name, leap, JOINT)?;
            }
        } else if let (Some(x), Some(turned)) = (&recording.position, &recording.orientation) {
            for (axis, name) in position.iter().enumerate() {
                check(recording, index, name, (x[index][axis] - x[index - 1][axis]).abs(), POSITION)?;
            }
            let leap = angle_between(&turned[index - 1], &turned[index]);
            check(recording, index, layout::ORIENTATION[0], leap, TURN)?;
        }
    }
    Ok(())
}

fn check(recording: &Recording, index: usize, name: &str, leap: f64, bound: Bound) -> Result<(), RecordingError> {
    let seconds = recording.time[index] - recording.time[index - 1];
    if leap <= bound.at_once + bound.per_second * seconds {
        return Ok(());
    }
    let turns = (leap / TAU).round();
    let wrapped = bound.unit == JOINT.unit && turns >= 1.0 && (leap - turns * TAU).abs() < WHOLE_TURN;
    Err(RecordingError::Leap {
        place: recording.place(index, name),
        leap,
        unit: bound.unit,
        seconds,
        guess: if wrapped {
            "it is a whole turn, the angle was wrapped; unwrap it, or show the movement again"
        } else {
            "correct the value, or show the movement again"
        },
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn the_example_demonstration_uses_a_twentieth_of_the_bound_of_a_leap() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples/reach.csv");
        let recording = Recording::read(&file).unwrap();
        let q = recording.q.as_ref().unwrap();
        let share = |index: usize| {
            let seconds = recording.time[index] - recording.time[index - 1];
            let farthest = (0..7).map(|joint| (q[index][joint] - q[index - 1][joint]).abs()).fold(0.0, f64::max);
            farthest / (JOINT.at_once + JOINT.per_second * seconds)
        };
        let largest = (1..recording.len()).map(share).fold(0.0, f64::max);
        assert!((0.03..0.05).contains(&largest), "{largest}");
    }
}
