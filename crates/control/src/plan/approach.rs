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

/// A joint-space move in progress.
#[derive(Clone, Copy, Debug)]
pub struct Approach<R: Real> {
    start: Vector7<R>,
    way: Vector7<R>,
    /// Control periods of the whole move.
    length: i32,
    /// Control periods passed.
    passed: i32,
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
            length,
            passed: 0,
            settled: 0,
            rate: R::constant(RATE) / R::from_counts(length),
        }
    }

    /// The same move in twice the time, or in [`LONGEST_APPROACH`].
    #[must_use]
    pub fn slowed(self) -> Self {
        let longest = (LONGEST_APPROACH * RATE) as i32 + 1;
        let length = (2 * self.length).min(longest);
        Approach { length, rate: R::constant(RATE) / R::from_counts(length), ..self }
    }

    /// Way of each joint (rad).
    pub fn way(&self) -> &Vector7<R> {
        &self.way
    }

    /// Duration of the move (s).
    pub fn duration(&self) -> R {
        R::from_counts(self.length) * R::constant(PERIOD)
    }

    /// True before the first control period.
    pub fn begins(&self) -> bool {
        self.passed == 0
    }

    /// Fraction of the time passed, 0 to 1.
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
        if self.passed < self.length {
            self.passed += 1;
        } else {
            self.settled = self.settled.saturating_add(1);
        }
        let dq = JointVelocities(self.way * (speed * self.rate));
        JointReference {
            q: JointPositions(self.start + self.way * position),
            dq,
            planned: dq,
            ddq: JointAccelerations(self.way * (acceleration * self.rate * self.rate)),
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
