//! `PointRows`: rows of Eq. (9) with start, goal and goal filter.

use crate::vector::all_finite;
use crate::{PointInput, PointState, RolloutError, Scalar, Trajectory, TransformationSystem, bounds};

/// `D` rows in motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PointRows<T, const D: usize> {
    pub(crate) state: [PointState<T>; D],
    pub(crate) start: [T; D],
    pub(crate) goal: [T; D],
    commanded: [T; D],
    /// The part of the way to the commanded goal that the goal filter has not gone yet.
    rest: [T; D],
}

/// Values of one tick that all rows share.
pub(crate) struct Tick<T> {
    pub(crate) s: T,
    pub(crate) h: T,
    pub(crate) rate: T,
    pub(crate) rate_squared: T,
    pub(crate) rate_slope: T,
    /// Part of the rest of the way to the commanded goal that the goal filter goes in this tick.
    pub(crate) goal_fraction: T,
}

impl<T: Scalar, const D: usize> PointRows<T, D> {
    pub(crate) fn new(start: [T; D], velocity: [T; D], duration: T, goal: [T; D]) -> Self {
        Self {
            state: core::array::from_fn(|i| PointState::new(start[i], velocity[i] * duration)),
            start,
            goal,
            commanded: goal,
            rest: [T::ZERO; D],
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
            // By the rest and not by the goal: what a tick adds to that is soon less than the last digit of an f32, and
            // it would stop on the way.
            for ((goal, commanded), rest) in self.goal.iter_mut().zip(&self.commanded).zip(&mut self.rest) {
                *rest = *rest - *rest * tick.goal_fraction;
                *goal = *commanded - *rest;
            }
        }
        out
    }

    pub(crate) fn command(&mut self, goal: [T; D], filtered: bool) -> Result<(), RolloutError> {
        if !all_finite(&goal) {
            return Err(RolloutError::NotFinite);
        }
        if bounds::first_beyond(&goal, T::from_f64(bounds::LARGEST_VALUE)).is_some() {
            return Err(RolloutError::TooLarge);
        }
        self.set_goal(goal, filtered);
        Ok(())
    }

    /// A checked goal, at once or through the filter.
    pub(crate) fn set_goal(&mut self, goal: [T; D], filtered: bool) {
        self.commanded = goal;
        if filtered {
            self.rest = core::array::from_fn(|i| goal[i] - self.goal[i]);
        } else {
            self.arrive();
        }
    }

    /// The commanded goal acts at once.
    pub(crate) fn arrive(&mut self) {
        self.goal = self.commanded;
        self.rest = [T::ZERO; D];
    }

    /// The present values become the goal.
    pub(crate) fn settle(&mut self) {
        self.set_goal(self.state.map(|state| state.x()), false);
    }
}
