//! `HandMotion`: a move of the hand along a minimum-jerk path, as `control::plan::HandMotion`, in fixed point.

use dmp::Scalar;

use crate::DIGITS;
use crate::controller::HandReference;
use crate::number::{Number, ONE, ZERO, at_least, at_most, constant, constants, magnitude, share, whole};

/// Longest move (s).
const LONGEST: Number = constant(control::plan::hand::LONGEST_MOVE);
/// Shortest move (s).
const SHORTEST: Number = constant(0.3);

/// Time per angle that keeps the peak speed of a minimum jerk, 1.875 times its mean, at 3 rad/s (spread) and 1.5
/// (fingers).
const SLOWNESS: [Number; DIGITS] = constants([1.875 / 3.0, 1.875 / 1.5, 1.875 / 1.5, 1.875 / 1.5]);

/// A move in progress.
#[derive(Clone, Copy, Debug)]
pub struct HandMotion {
    start: [Number; DIGITS],
    way: [Number; DIGITS],
    /// Control periods of the whole move, and passed.
    length: i32,
    passed: i32,
    /// 1/length, and 300 Hz over it.
    step: Number,
    rate: Number,
}

impl HandMotion {
    /// A move from `start` to `goal` (rad) in `duration` (s) or, where the speed limits ask for it, longer.
    pub fn new(start: &[Number; DIGITS], goal: &[Number; DIGITS], duration: Number) -> Self {
        let way: [Number; DIGITS] = core::array::from_fn(|digit| goal[digit] - start[digit]);
        let mut needed = at_least(duration, SHORTEST);
        for (way, slowness) in way.iter().zip(SLOWNESS) {
            needed = at_least(needed, magnitude(*way) * slowness);
        }
        let periods = (at_most(needed, LONGEST) * constant(control::RATE)).to_index();
        let length = i32::try_from(periods).unwrap_or(0) + 1;
        let step = share(ONE, whole(length));
        HandMotion { start: *start, way, length, passed: 0, step, rate: step * constant(control::RATE) }
    }

    /// Where the hand should be at the end (rad).
    pub fn goal(&self) -> [Number; DIGITS] {
        core::array::from_fn(|digit| self.start[digit] + self.way[digit])
    }

    /// True if the path has ended.
    pub fn is_finished(&self) -> bool {
        self.passed >= self.length
    }

    /// Where the hand should be now; then one control period passes.
    pub fn step(&mut self) -> HandReference {
        let reference = self.now();
        if self.passed < self.length {
            self.passed += 1;
        }
        reference
    }

    /// Where the hand should be now.
    pub fn now(&self) -> HandReference {
        if self.is_finished() {
            return HandReference { q: self.goal(), dq: [ZERO; DIGITS] };
        }
        let t = whole(self.passed) * self.step;
        // 10 t^3 - 15 t^4 + 6 t^5 and 30 t^2 (1 - t)^2.
        let rest = ONE - t;
        let position = t * t * t * (whole(10) - t * (whole(15) - whole(6) * t));
        let speed = whole(30) * (t * rest) * (t * rest) * self.rate;
        HandReference {
            q: core::array::from_fn(|digit| self.start[digit] + self.way[digit] * position),
            dq: core::array::from_fn(|digit| self.way[digit] * speed),
        }
    }
}
