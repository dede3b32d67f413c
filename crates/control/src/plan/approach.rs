//! `Approach`: a joint-space move along a minimum-jerk path.
//!
//! `q(u) = q_0 + (q_1 - q_0)(10 u^3 - 15 u^4 + 6 u^5)`, `u = t/T`. The duration is long enough that no joint exceeds
//! half of its speed limit, neither the elbow nor the point 0.35 m beyond it exceeds 0.35 m/s (the safety module faults
//! at 1.0 m/s), and the hand does not exceed 0.6 m/s.

use crate::guard::monitor::TIP_REACH;
use crate::model::arm::ArmModel;
use crate::model::kinematics::Frames;
use crate::model::wam7;
use crate::plan::reference::JointReference;
use crate::real::{Real, at_least};
use crate::time::{PERIOD, RATE, periods};
use crate::units::{JointAccelerations, JointPositions, JointVelocities, Vector7};

/// Largest speed of the elbow and of the point beyond it during an approach (m/s).
pub const TIP_SPEED: f64 = 0.35;

/// Largest speed of the hand during an approach (m/s), which no plan of a person has checked.
pub const HAND_SPEED: f64 = 0.6;

/// Part of the joint speed limits that an approach uses.
const SPEED_FRACTION: f64 = 0.5;

/// Postures along the path at which the speeds are computed. An odd number: the path is fastest in its middle.
const SAMPLES: usize = 7;

/// Allowance for peaks between the samples.
const SAMPLE_MARGIN: f64 = 1.02;

/// Longest approach that may be asked for (s).
pub const LONGEST_APPROACH: f64 = 120.0;

/// Longest time that the arm may take to close in on the target after the path has ended: 1 s, in control periods.
pub const SETTLING: u16 = periods(1.0);

/// Shortest approach (s), so that a move over no distance still begins and ends.
const SHORTEST: f64 = 1.0;

/// Parts of a control period. A move goes on by all of them; by half of them while it is held back, half a second later
/// than that is asked for.
const PARTS: i32 = 2 * CHANGE * periods(0.5) as i32;

/// Change of the pace in a control period, in parts of it. Two, of which half acts within that period.
const CHANGE: i32 = 2;

/// A joint-space move in progress.
#[derive(Clone, Copy, Debug)]
pub struct Approach<R: Real> {
    start: Vector7<R>,
    way: Vector7<R>,
    /// Parts of control periods of the whole move.
    length: i32,
    /// Those passed.
    passed: i32,
    /// Those by which it goes on in this control period.
    pace: i32,
    /// It is held back.
    slow: bool,
    /// Control periods at the target since then, saturating.
    settled: u16,
    /// 1/T (1/s).
    rate: R,
}

impl<R: Real> Approach<R> {
    /// A move from `start` to `goal` in `duration` (s) or, where the speed limits ask for it, longer.
    pub fn new(model: &ArmModel<R>, start: &JointPositions<R>, goal: &JointPositions<R>, duration: R) -> Self {
        let way = goal.0 - start.0;
        let mut needed = at_least(duration, R::constant(SHORTEST));
        for (way, limit) in way.iter().zip(&wam7::VELOCITY_MAX) {
            // The peak speed of a minimum jerk is 1.875 times the mean.
            let magnitude = if *way < R::constant(0.0) { -*way } else { *way };
            needed = at_least(needed, magnitude * R::constant(1.875 / (SPEED_FRACTION * limit)));
        }
        for sample in 0..SAMPLES {
            let u = (sample as f64 + 0.5) / SAMPLES as f64;
            let (position, speed, _) = minimum_jerk(R::constant(u));
            let frames = Frames::new(model, &JointPositions(start.0 + way * position));
            let [elbow, tip, hand] = frames.watched_speeds(&JointVelocities(way * speed), R::constant(TIP_REACH));
            let tips = at_least(elbow, tip) * R::constant(SAMPLE_MARGIN / TIP_SPEED);
            let hand = hand * R::constant(SAMPLE_MARGIN / HAND_SPEED);
            needed = at_least(needed, at_least(tips, hand));
        }
        let longest = R::constant(LONGEST_APPROACH);
        let needed = crate::real::at_most(needed, longest);
        let length = (needed * R::constant(RATE)).to_whole() + 1;
        Approach {
            start: start.0,
            way,
            length: length * PARTS,
            passed: 0,
            pace: PARTS,
            slow: false,
            settled: 0,
            rate: R::constant(RATE) / R::from_counts(length),
        }
    }

    /// Holds the move to half of its speed, or lets it go back to all of it. One that has not begun is slow at once.
    pub fn hold_back(&mut self, slow: bool) {
        self.slow = slow;
        if self.begins() {
            self.pace = self.wanted_pace();
        }
    }

    fn wanted_pace(&self) -> i32 {
        if self.slow { PARTS / 2 } else { PARTS }
    }

    /// Way of each joint (rad).
    pub fn way(&self) -> &Vector7<R> {
        &self.way
    }

    /// Duration of the move while nothing holds it back (s).
    pub fn duration(&self) -> R {
        R::from_counts(self.length / PARTS) * R::constant(PERIOD)
    }

    /// True before the first control period.
    pub fn begins(&self) -> bool {
        self.passed == 0
    }

    /// Fraction of the move passed, 0 to 1.
    pub fn progress(&self) -> R {
        R::from_counts(self.passed) / R::from_counts(self.length)
    }

    /// True if the path has ended at the target.
    pub fn is_finished(&self) -> bool {
        self.passed >= self.length
    }

    /// True if the time to settle at the target is over.
    pub fn is_overdue(&self) -> bool {
        self.settled >= SETTLING
    }

    /// Returns the reference of this control period and goes on to the next.
    pub fn step(&mut self) -> JointReference<R> {
        let (position, speed, acceleration) = minimum_jerk(self.progress());
        let change = (self.wanted_pace() - self.pace).signum() * CHANGE;
        let rate = self.rate * (R::from_counts(self.pace) * R::constant(1.0 / PARTS as f64));
        let slowing = self.rate * (R::from_counts(change) * R::constant(RATE / PARTS as f64));
        if self.passed < self.length {
            self.passed = (self.passed + self.pace + change / 2).min(self.length);
        } else {
            self.settled = self.settled.saturating_add(1);
        }
        self.pace += change;
        let dq = JointVelocities(self.way * (speed * rate));
        JointReference {
            q: JointPositions(self.start + self.way * position),
            dq,
            planned: dq,
            ddq: JointAccelerations(self.way * (acceleration * rate * rate + speed * slowing)),
        }
    }
}

/// Minimum-jerk path over unit time: position and its first two derivatives.
pub(crate) fn minimum_jerk<R: Real>(u: R) -> (R, R, R) {
    let n = R::constant;
    let rest = n(1.0) - u;
    let position = u * u * u * (n(10.0) - u * (n(15.0) - u * n(6.0)));
    let speed = n(30.0) * u * u * rest * rest;
    let acceleration = n(60.0) * u * rest * (n(1.0) - u * n(2.0));
    (position, speed, acceleration)
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::vec::Vec;

    use super::*;

    const START: [f64; 7] = [0.0, -1.2, 0.0, 2.4, 0.0, 0.5, 0.0];
    const GOAL: [f64; 7] = [0.6, -0.6, 0.3, 1.8, -0.4, 0.2, 0.5];

    /// The references of a move of 4 s that is held back in these control periods.
    fn references(slow: core::ops::Range<usize>) -> Vec<JointReference<f64>> {
        let model = ArmModel::new(crate::Payload::None);
        let [start, goal] = [START, GOAL].map(|q| JointPositions(q.into()));
        let mut approach = Approach::new(&model, &start, &goal, 4.0);
        let mut references = Vec::new();
        while !approach.is_finished() {
            approach.hold_back(slow.contains(&references.len()));
            references.push(approach.step());
        }
        references
    }

    /// The change that makes it fail: the pace steps, or its change is not in the acceleration.
    #[test]
    fn g14_a_move_that_is_held_back_keeps_its_way_and_has_the_derivatives_of_it() {
        for slow in [0..0, 0..usize::MAX, 400..usize::MAX, 400..900, 500..520] {
            let references = references(slow.clone());
            let (mut q, mut dq) = (Vector7::from(START), Vector7::zeros());
            for (number, pair) in references.windows(2).enumerate() {
                let [before, after] = pair else { unreachable!() };
                q += (before.dq.0 + after.dq.0) * (PERIOD / 2.0);
                dq += (before.ddq.0 + after.ddq.0) * (PERIOD / 2.0);
                let [way, speed] = [after.q.0 - q, after.dq.0 - dq].map(|error| error.amax());
                assert!(way < 1e-5 && speed < 1e-3, "{slow:?}, cycle {number}: {way} rad, {speed} rad/s");
            }
            let last = references.last().unwrap();
            assert!((last.q.0 - Vector7::from(GOAL)).amax() < 1e-6, "{slow:?}: {:?}", last.q);
        }
    }

    #[test]
    fn g14_a_move_is_held_back_within_half_a_second_and_let_go_again() {
        let length = |slow| references(slow).len();
        let free = length(0..0);
        assert!((free..free + 2).contains(&1201), "{free}");
        assert!((2 * free - 2..2 * free + 2).contains(&length(0..usize::MAX)), "half of its speed from the beginning");
        // 150 cycles on the way to half, then all of the rest at half.
        let late = length(400..usize::MAX);
        assert!((400 + 150 + 2 * (free - 400 - 113)).abs_diff(late) < 4, "{late}");
        let between = length(400..900);
        assert!((free + 250).abs_diff(between) < 4, "{between}");
    }
}
