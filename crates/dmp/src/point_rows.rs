//! `PointRows`: rows of Eq. (9) with start, goal and goal filter.

use crate::vector::all_finite;
use crate::{PointInput, PointState, RolloutError, Scalar, Trajectory, TransformationSystem, bounds};

/// `D` rows in motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PointRows<T, const D: usize> {
    pub(crate) state: [PointState<T>; D],
    pub(crate) start: [T; D],
    pub(crate) goal: [T; D],
    pub(crate) commanded: [T; D],
}

/// Values of one tick that all rows share.
pub(crate) struct Tick<T> {
    pub(crate) s: T,
    pub(crate) h: T,
    pub(crate) rate: T,
    pub(crate) rate_squared: T,
    pub(crate) rate_slope: T,
    /// Part of the way to the commanded goal that the goal filter goes in this tick.
    pub(crate) goal_fraction: T,
}

impl<T: Scalar, const D: usize> PointRows<T, D> {
    pub(crate) fn new(start: [T; D], velocity: [T; D], duration: T, goal: [T; D]) -> Self {
        Self {
            state: core::array::from_fn(|i| PointState::new(start[i], velocity[i] * duration)),
            start,
            goal,
            commanded: goal,
        }
    }

    #[inline]
    pub(crate) fn step<'a>(
        &mut self,
        system: impl Fn(usize) -> &'a TransformationSystem<T>,
        tick: &Tick<T>,
        f: &[T; D],
        zeta: &[T; D],
    ) -> Trajectory<T, D> {
        let mut out = Trajectory { x: [T::ZERO; D], v: [T::ZERO; D], a: [T::ZERO; D] };
        for i in 0..D {
            let state = &mut self.state[i];
            let input = PointInput { start: self.start[i], goal: self.goal[i], s: tick.s, f: f[i], zeta: zeta[i] };
            let rhs = system(i).right_hand_side(state, &input);
            out.x[i] = state.x();
            out.v[i] = state.v() * tick.rate;
            out.a[i] = rhs * tick.rate_squared + state.v() * tick.rate_slope;
            state.step(rhs, tick.h);
        }
        if tick.goal_fraction > T::ZERO {
            self.follow(tick.goal_fraction);
        }
        out
    }

    /// Lets the goals follow the commanded ones. Not inlined: most runs have no goal filter.
    #[inline(never)]
    fn follow(&mut self, fraction: T) {
        for (goal, commanded) in self.goal.iter_mut().zip(&self.commanded) {
            *goal = towards(*goal, *commanded, fraction);
        }
    }

    pub(crate) fn command(&mut self, goal: [T; D], filtered: bool) -> Result<(), RolloutError> {
        if !all_finite(&goal) {
            return Err(RolloutError::NotFinite);
        }
        if bounds::first_beyond(&goal, T::from_f64(bounds::LARGEST_VALUE)).is_some() {
            return Err(RolloutError::TooLarge);
        }
        self.commanded = goal;
        if !filtered {
            self.goal = goal;
        }
        Ok(())
    }

    /// The present values become the goal.
    pub(crate) fn settle(&mut self) {
        self.goal = self.state.map(|state| state.x());
        self.commanded = self.goal;
    }
}

/// Part of the way that the goal filter has to go in a tick for what its digits lose to be gone at once: in a movement
/// that hardly goes on it would be too much.
const LEAST_FRACTION: f64 = 1e-5;

/// The goal after a tick of the filter. What is less than its last digit would be lost, in f32 a part of the way that
/// a slow movement has left: that part is gone at once.
fn towards<T: Scalar>(goal: T, commanded: T, fraction: T) -> T {
    let next = goal + (commanded - goal) * fraction;
    if next == goal && takes_the_rest(fraction) { commanded } else { next }
}

/// True if a filter that goes so far in a tick loses little of the way to its digits.
pub(crate) fn takes_the_rest<T: Scalar>(fraction: T) -> bool {
    fraction > T::from_f64(LEAST_FRACTION)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_filter_takes_what_its_digits_lose_at_once_unless_the_movement_hardly_goes_on() {
        assert_eq!(towards(10.0f32, 10.01, 2e-5), 10.01, "0.2 um of 10 rad are no step");
        assert_eq!(towards(10.0f32, 10.3, 1e-8), 10.0, "nor here, and three tenths of a radian are no rest");
        assert!((towards(10.0f32, 11.0, 1e-3) - 10.001).abs() < 1e-6);
    }
}
