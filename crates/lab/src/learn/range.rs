//! Warnings of joints that were recorded where the arm may not be: the device refuses what is learned from that.

use std::f64::consts::{PI, TAU};

use control::model::{SOFT_MAX, SOFT_MIN};

/// Angle beyond a soft limit that is told, rad: an arm that was led against it is a little beyond.
const BEYOND: f64 = 0.01;

/// Warnings of these postures (rad), one a joint at most.
pub(super) fn warnings(posture: &[[f64; 7]]) -> impl Iterator<Item = String> {
    (0..7).filter_map(|joint| {
        let (min, max) = (SOFT_MIN[joint], SOFT_MAX[joint]);
        let outside = |q: &f64| (q - max).max(min - q);
        let farthest = posture.iter().map(|q| q[joint]).max_by(|a, b| outside(a).total_cmp(&outside(b)))?;
        // Further out than half a turn no stop lets a joint go: its zero was lost, or another program counted turns.
        let advice = if outside(&farthest) > PI {
            let turns = (farthest / TAU).round().abs();
            format!("that is {turns} times round, so its zero was wrong; zero the arm and show the movement again")
        } else {
            "show the movement again, farther from the stop".to_owned()
        };
        (outside(&farthest) > BEYOND).then(|| {
            format!(
                "J{} was shown at {farthest:.2} rad, outside of its soft limits, {min:.2} to {max:.2} rad: `tactus check` and the device refuse the primitive; {advice}",
                joint + 1
            )
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_that_was_shown_beyond_its_limits_is_told_with_what_to_do() {
        let within = [0.0, 0.5, 0.0, 1.5, 0.0, 0.0, 1.4];
        assert_eq!(warnings(&[within, SOFT_MAX, SOFT_MIN]).count(), 0);
        let (mut turned, mut led) = (within, within);
        turned[6] += TAU;
        led[5] = SOFT_MIN[5] - 0.05;
        let told: Vec<String> = warnings(&[within, turned, led]).collect();
        assert_eq!(told.len(), 2, "{told:?}");
        assert!(told[0].starts_with("J6 was shown at") && told[0].ends_with("farther from the stop"), "{}", told[0]);
        assert!(told[1].starts_with("J7 was shown at 7.68 rad") && told[1].contains("is 1 times round"), "{}", told[1]);
    }
}
