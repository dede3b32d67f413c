//! A mean over arms and demonstrations with the interval in which it lies.

use serde::Serialize;

use super::seed::mix;

/// Drawings from the arms and demonstrations that were tried.
const DRAWINGS: u64 = 10_000;
/// Probability that the mean lies in the interval.
const CONFIDENCE: f64 = 0.95;

/// A mean with the 95 % interval of the bootstrap (percentiles): what it would be with other arms and demonstrations of
/// the same kind.
///
/// Arms and demonstrations are drawn anew, each with replacement and independently, and every demonstration meets the
/// arms that were drawn. Cells are not drawn: they are chosen, not found. Of five arms the interval is rough and rather
/// too narrow.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Interval {
    /// Mean.
    pub mean: f64,
    /// 2.5 % of the drawings lie below.
    pub low: f64,
    /// 2.5 % of the drawings lie above.
    pub high: f64,
}

impl Interval {
    /// From counts, demonstration by demonstration, of the same arms in the same order; `None` of one arm with one
    /// demonstration.
    pub fn of(counts: &[Vec<usize>]) -> Option<Interval> {
        let arms = counts.iter().map(Vec::len).min()?;
        if arms == 0 || (arms < 2 && counts.len() < 2) {
            return None;
        }
        let at = |demonstration: usize, arm: usize| counts[demonstration][arm] as f64;
        let mean_of = |demonstrations: &[usize], drawn: &[usize]| {
            let sum: f64 = demonstrations
                .iter()
                .flat_map(|&demonstration| drawn.iter().map(move |&arm| at(demonstration, arm)))
                .sum();
            sum / (demonstrations.len() * drawn.len()) as f64
        };
        let all = |count: usize| (0..count).collect::<Vec<_>>();
        let mut state = 0;
        let mut draw = |count: usize| -> Vec<usize> {
            (0..count)
                .map(|_| {
                    state += 1;
                    (mix(state) % count as u64) as usize
                })
                .collect()
        };
        let mut means: Vec<f64> = (0..DRAWINGS).map(|_| mean_of(&draw(counts.len()), &draw(arms))).collect();
        means.sort_by(f64::total_cmp);
        let tail = (0.5 * (1.0 - CONFIDENCE) * DRAWINGS as f64) as usize;
        Some(Interval {
            mean: mean_of(&all(counts.len()), &all(arms)),
            low: means[tail],
            high: means[means.len() - 1 - tail],
        })
    }

    /// Its ends in words, `45.2 to 47.0`.
    pub fn bounds(&self) -> String {
        format!("{:.1} to {:.1}", self.low, self.high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arms_that_agree_leave_no_doubt_and_one_arm_leaves_all() {
        let agreed = Interval::of(&[vec![46; 5]]).unwrap();
        assert_eq!((agreed.mean, agreed.low, agreed.high), (46.0, 46.0, 46.0));
        assert_eq!(Interval::of(&[vec![46]]), None);
        assert_eq!(Interval::of(&[]), None);
        assert_eq!(Interval::of(&[Vec::new(), Vec::new()]), None);
    }

    #[test]
    fn the_interval_is_that_of_the_standard_error() {
        // 100 arms, half at 40 and half at 44: standard error 2/sqrt(100), 95 % within 1.96 of them.
        let counts: Vec<usize> = (0..100).map(|arm| 40 + 4 * (arm % 2)).collect();
        let interval = Interval::of(&[counts]).unwrap();
        assert_eq!(interval.mean, 42.0);
        assert!((interval.low - 41.608).abs() < 0.03 && (interval.high - 42.392).abs() < 0.03, "{interval:?}");
    }

    #[test]
    fn lessons_that_differ_widen_it_where_the_arms_agree() {
        let interval = Interval::of(&[vec![40; 4], vec![44; 4], vec![48; 4]]).unwrap();
        assert_eq!((interval.mean, interval.low, interval.high), (44.0, 40.0, 48.0));
    }
}
