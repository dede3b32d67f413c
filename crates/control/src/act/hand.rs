//! `HandLimiter`: the only maker of [`LimitedHandTorques`], and with it the only way to the hand's motors.

use crate::model::hand::DIGITS;
use crate::model::wam7::{FINGER_TORQUE_MAX, SPREAD_TORQUE_MAX};
use crate::real::{Real, within};
use crate::time::periods;

/// Largest torques (N m at the spread and at the inner links).
pub const TORQUE_LIMIT: [f64; DIGITS] = [SPREAD_TORQUE_MAX, FINGER_TORQUE_MAX, FINGER_TORQUE_MAX, FINGER_TORQUE_MAX];

/// Time in which a torque may go from zero to full scale: 50 ms, in control periods.
const FULL_SCALE_CYCLES: f64 = periods(0.05) as f64;

/// Torques of spread, F1, F2, F3 within every limit. No public constructor: the limiter makes them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimitedHandTorques<R: Real>([R; DIGITS]);

impl<R: Real> LimitedHandTorques<R> {
    /// The torques (N m), spread first.
    pub fn torques(&self) -> &[R; DIGITS] {
        &self.0
    }
}

/// Cuts torques to what the drives of the hand bear.
#[derive(Clone, Debug)]
pub struct HandLimiter<R: Real> {
    last: [R; DIGITS],
    /// The torques before the last, in case those do not leave.
    before: [R; DIGITS],
}

impl<R: Real> HandLimiter<R> {
    /// A limiter at zero torque.
    pub fn new() -> Self {
        HandLimiter { last: [R::constant(0.0); DIGITS], before: [R::constant(0.0); DIGITS] }
    }

    /// Back to zero torque at once: nothing is being sent.
    pub fn reset(&mut self) {
        *self = HandLimiter::new();
    }

    /// The torques of the last cycle did not leave: the next step counts from those before.
    pub fn not_sent(&mut self) {
        self.last = self.before;
    }

    /// The torques of the last cycle (N m).
    pub fn last(&self) -> &[R; DIGITS] {
        &self.last
    }

    /// Cuts the wanted torques (N m) of one cycle to magnitude and rate. What is not finite counts as zero: the worm
    /// holds.
    pub fn limit(&mut self, wanted: &[R; DIGITS]) -> LimitedHandTorques<R> {
        self.before = self.last;
        for ((last, wanted), limit) in self.last.iter_mut().zip(wanted).zip(TORQUE_LIMIT) {
            let finite = if wanted.is_finite_number() { *wanted } else { R::constant(0.0) };
            let step = within(finite, R::constant(limit)) - *last;
            *last = within(*last + within(step, R::constant(limit / FULL_SCALE_CYCLES)), R::constant(limit));
        }
        LimitedHandTorques(self.last)
    }
}

impl<R: Real> Default for HandLimiter<R> {
    fn default() -> Self {
        HandLimiter::new()
    }
}
