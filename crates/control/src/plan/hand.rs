//! `HandMotion`: a move of the hand along a minimum-jerk path.

use crate::model::hand::DIGITS;
use crate::plan::approach::minimum_jerk;
use crate::plan::reference::HandReference;
use crate::real::{Real, at_least, at_most};
use crate::time::RATE;

/// Relation of the hand to what it closes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grasp {
    /// No finger closes, and at most one stands on something.
    Open,
    /// A finger closes along a plan.
    Closing,
    /// Two fingers or more stand on something on their way along a plan.
    Gripping,
}

/// Longest move that may be asked for (s).
pub const LONGEST_MOVE: f64 = 60.0;

/// Shortest move (s).
const SHORTEST: f64 = 0.3;

/// Largest speeds of spread and inner links on the way (rad/s), some six tenths of what the drives reach without load.
const SPEED_LIMIT: [f64; DIGITS] = [3.0, 1.5, 1.5, 1.5];

/// Peak speed of a minimum jerk over its mean.
const PEAK: f64 = 1.875;

/// A move of the hand in progress.
#[derive(Clone, Copy, Debug)]
pub struct HandMotion<R: Real> {
    start: [R; DIGITS],
    way: [R; DIGITS],
    /// Control periods of the whole move.
    length: i32,
    /// Control periods passed.
    passed: i32,
}

impl<R: Real> HandMotion<R> {
    /// A move from `start` to `goal` (rad) in `duration` (s) or, where the speed limits ask for it, longer.
    pub fn new(start: &[R; DIGITS], goal: &[R; DIGITS], duration: R) -> Self {
        let mut way = *goal;
        let mut needed = at_least(duration, R::constant(SHORTEST));
        for ((way, start), limit) in way.iter_mut().zip(start).zip(SPEED_LIMIT) {
            *way -= *start;
            let magnitude = if *way < R::constant(0.0) { -*way } else { *way };
            needed = at_least(needed, magnitude * R::constant(PEAK / limit));
        }
        let needed = at_most(needed, R::constant(LONGEST_MOVE));
        HandMotion { start: *start, way, length: (needed * R::constant(RATE)).to_whole() + 1, passed: 0 }
    }

    /// Returns the goal (rad).
    pub fn goal(&self) -> [R; DIGITS] {
        core::array::from_fn(|digit| self.start[digit] + self.way[digit])
    }

    /// True if the path has ended.
    pub fn is_finished(&self) -> bool {
        self.passed >= self.length
    }

    /// Returns the reference of this control period and goes on to the next.
    pub fn step(&mut self) -> HandReference<R> {
        let reference = self.now();
        if self.passed < self.length {
            self.passed += 1;
        }
        reference
    }

    /// Returns the reference of this control period.
    pub fn now(&self) -> HandReference<R> {
        let length = R::from_counts(self.length);
        let (position, speed, _) = minimum_jerk(R::from_counts(self.passed) / length);
        let rate = R::constant(RATE) / length;
        HandReference {
            q: core::array::from_fn(|digit| self.start[digit] + self.way[digit] * position),
            dq: core::array::from_fn(|digit| self.way[digit] * (speed * rate)),
        }
    }
}
