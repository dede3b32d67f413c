//! The movement of the fingers: generated, not shown, because nobody moves non-backdrivable fingers by hand.
//!
//! A minimum jerk from one hand posture to another within a window of the movement, so that all fingers close
//! together: `b(r) = 10 r^3 - 15 r^4 + 6 r^5`.

use super::Recording;

/// A digit that stands this far, rad, from where the primitive begins, or moves so far, is another hand's.
const OTHERWISE: f64 = 0.3;

/// Movement of the fingers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HandMotion {
    /// Spread and fingers 1 to 3 at the start, rad.
    pub start: [f64; 4],
    /// The same at the end, rad.
    pub goal: [f64; 4],
    /// Fractions of the duration at which they begin and end to move.
    pub window: (f64, f64),
}

impl Default for HandMotion {
    /// An open hand that stays open.
    fn default() -> HandMotion {
        HandMotion { start: [0.0; 4], goal: [0.0; 4], window: (0.6, 1.0) }
    }
}

impl HandMotion {
    /// True if the numbers are finite and the window lies in order within the movement.
    pub fn is_valid(&self) -> bool {
        let (begin, end) = self.window;
        self.start.iter().chain(&self.goal).all(|value| value.is_finite())
            && (0.0..1.0).contains(&begin)
            && begin < end
            && end <= 1.0
    }

    /// Warnings of a hand that stood or moved otherwise in a recording, but for these times (s) at its beginning and
    /// end: the fingers are not learned from it.
    pub(super) fn warnings(&self, recording: &Recording, (before, behind): (f64, f64)) -> Vec<String> {
        let [begun, ended] = [recording.time.first(), recording.time.last()].map(|time| time.copied().unwrap_or(0.0));
        let (from, to) = (begun + before, ended - behind);
        let shown: Vec<[f64; 4]> = recording
            .hand
            .iter()
            .flatten()
            .zip(&recording.time)
            .filter(|(_, time)| (from..=to).contains(*time))
            .map(|(hand, _)| *hand)
            .collect();
        let (Some(first), Some(last)) = (shown.first(), shown.last()) else { return Vec::new() };
        let apart = |one: &[f64; 4], other: &[f64; 4]| {
            one.iter().zip(other).map(|(one, other)| (one - other).abs()).fold(0.0, f64::max)
        };
        let mut warnings = Vec::new();
        if apart(first, &self.start) > OTHERWISE {
            let words = |hand: &[f64; 4]| hand.map(|angle| format!("{angle:.2}")).join(",");
            warnings.push(format!(
                "the hand stood otherwise when the movement was shown than the primitive begins with; `--hand-start {} --hand-goal {}` begins and ends as shown",
                words(first),
                words(last)
            ));
        }
        let moved = shown.iter().map(|hand| apart(hand, first)).fold(0.0, f64::max);
        if moved > OTHERWISE && apart(&self.start, &self.goal) == 0.0 {
            warnings.push(format!(
                "the fingers moved by up to {moved:.2} rad while the movement was shown, which is not learned; `--hand-goal` says where they go, once, and `--hand-window` when"
            ));
        }
        warnings
    }

    /// The hand at `samples` instants, evenly spaced over the movement.
    pub fn samples(&self, samples: usize) -> Vec<[f64; 4]> {
        let (begin, end) = self.window;
        (0..samples)
            .map(|index| {
                let fraction = index as f64 / (samples.max(2) - 1) as f64;
                let r = ((fraction - begin) / (end - begin)).clamp(0.0, 1.0);
                let blend = r * r * r * (10.0 + r * (6.0 * r - 15.0));
                std::array::from_fn(|joint| self.start[joint] + blend * (self.goal[joint] - self.start[joint]))
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fingers_move_within_their_window_only_and_at_most_at_the_minimum_jerk_speed() {
        let motion = HandMotion { start: [0.0, 0.1, 0.1, 0.1], goal: [0.0, 2.1, 2.1, 2.1], window: (0.5, 0.9) };
        let samples = motion.samples(1001);
        assert_eq!(samples[500], motion.start);
        assert_eq!(samples[900], motion.goal);
        assert_eq!(samples[1000], motion.goal);
        let fastest = samples.windows(2).map(|pair| pair[1][1] - pair[0][1]).fold(0.0, f64::max);
        // Peak speed of a minimum jerk: 1.875 times the mean speed, here 2 rad in 400 steps.
        assert!((fastest - 1.875 * 2.0 / 400.0).abs() < 1e-5, "{fastest}");
    }
}
