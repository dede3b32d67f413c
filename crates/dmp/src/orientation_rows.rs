//! `Turn`: the orientation of a run, in the coordinates that its primitive chose.
//!
//! Here the signs of start and goal are decided, once: never per tick, because a path may exceed 180 degrees.

use crate::orientation::is_near_enough;
use crate::point_rows::{Group, Tick};
use crate::vector::scale;
use crate::{
    Hemisphere, ORIENTATION_ROWS, OrientationError, OrientationInput, OrientationReference, OrientationState,
    OrientationSystem, Primitive, Quaternion, RolloutError, RotationChart, Scalar, TransformationSystem,
};

/// The orientation in the coordinates that the primitive chose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Turn<T> {
    /// Eqs. (4), (6), (7).
    Quaternion { state: OrientationState<T>, start: Quaternion<T>, goal: Quaternion<T>, commanded: Quaternion<T> },
    /// Eq. (1) on rotation vectors.
    Vector { chart: RotationChart<T>, group: Group<T, ORIENTATION_ROWS> },
}

impl<T: Scalar> Turn<T> {
    /// # Errors
    /// [`RolloutError::TurnsTooFar`].
    pub(crate) fn start<const N: usize>(
        primitive: &Primitive<T, N>,
        from: &Quaternion<T>,
        omega: &[T; ORIENTATION_ROWS],
    ) -> Result<Self, RolloutError> {
        let (demonstrated, goal) = (primitive.start().orientation, primitive.goal().orientation);
        let tau = primitive.duration();
        let nearest = primitive.hemisphere() == Hemisphere::Nearest;
        if primitive.orientation_error() == OrientationError::RotationVector {
            let goal = if nearest { goal.aligned_with(&demonstrated) } else { goal };
            let chart = RotationChart::between(&demonstrated, &goal);
            let y = chart.vector(from, &chart.start());
            let dy = chart.velocity(&y, omega);
            return Ok(Self::Vector { chart, group: Group::new(y, dy, tau, chart.goal()) });
        }
        let (start, goal) =
            if nearest { (*from, goal.aligned_with(from)) } else { (from.aligned_with(&demonstrated), goal) };
        if !is_near_enough(&start, &goal) {
            return Err(RolloutError::TurnsTooFar);
        }
        Ok(Self::Quaternion {
            state: OrientationState { q: start, omega: scale(omega, tau) },
            start,
            goal,
            commanded: goal,
        })
    }

    #[inline]
    pub(crate) fn step(
        &mut self,
        gains: &TransformationSystem<T>,
        tick: &Tick<T>,
        f: &[T; ORIENTATION_ROWS],
        zeta: &[T; ORIENTATION_ROWS],
    ) -> OrientationReference<T> {
        match self {
            Self::Quaternion { state, start, goal, commanded } => {
                let input = OrientationInput { start: *start, goal: *goal, s: tick.s, f: *f, zeta: *zeta };
                let rhs = OrientationSystem::new(*gains).right_hand_side(state, &input);
                let out = OrientationReference {
                    quaternion: state.q,
                    omega: scale(&state.omega, tick.rate),
                    domega: core::array::from_fn(|i| rhs[i] * tick.rate_squared + state.omega[i] * tick.rate_slope),
                };
                state.step(&rhs, tick.h);
                if tick.goal_fraction > T::ZERO {
                    let rest = goal.conjugate().product(commanded).rotation_vector();
                    let turn = Quaternion::from_rotation_vector(&scale(&rest, tick.goal_fraction));
                    *goal = goal.product(&turn).renormalised();
                }
                out
            }
            Self::Vector { chart, group } => {
                let y = group.state.map(|state| state.x());
                let zeta = chart.generalised(&y, zeta);
                let row = group.step(gains, tick, f, &zeta);
                let (omega, domega) = chart.rates(&row.x, &row.v, &row.a);
                OrientationReference { quaternion: chart.orientation(&row.x), omega, domega }
            }
        }
    }

    /// # Errors
    /// [`RolloutError::TurnsTooFar`]; the goal stays as it was.
    pub(crate) fn command<const N: usize>(
        &mut self,
        primitive: &Primitive<T, N>,
        new: &Quaternion<T>,
        filtered: bool,
    ) -> Result<(), RolloutError> {
        match self {
            Self::Quaternion { state, goal, commanded, .. } => {
                let new = match primitive.hemisphere() {
                    Hemisphere::Demonstrated => new.aligned_with(&primitive.goal().orientation),
                    Hemisphere::Nearest => new.aligned_with(&state.q),
                };
                if !is_near_enough(&state.q, &new) {
                    return Err(RolloutError::TurnsTooFar);
                }
                *commanded = new;
                if !filtered {
                    *goal = *commanded;
                }
            }
            Self::Vector { chart, group } => {
                group.commanded = chart.vector(new, &chart.goal());
                if !filtered {
                    group.goal = group.commanded;
                }
            }
        }
        Ok(())
    }

    pub(crate) fn arrive(&mut self) {
        match self {
            Self::Quaternion { goal, commanded, .. } => *goal = *commanded,
            Self::Vector { group, .. } => group.goal = group.commanded,
        }
    }

    /// The present orientation becomes the goal.
    pub(crate) fn settle(&mut self) {
        match self {
            // Of the sign that the path has now: it is the near one by itself.
            Self::Quaternion { state, goal, commanded, .. } => (*goal, *commanded) = (state.q, state.q),
            Self::Vector { group, .. } => group.settle(),
        }
    }
}
