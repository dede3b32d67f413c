//! `OrientationRows`: the orientation of a run, in the coordinates that its primitive chose.
//!
//! Here the signs of start and goal are decided, once: never per tick, because a path may exceed 180 degrees.

use crate::orientation::is_near_enough;
use crate::point_rows::{PointRows, Tick, takes_the_rest};
use crate::vector::scale;
use crate::{
    Hemisphere, LogMap, OrientationError, OrientationInput, OrientationReference, OrientationState, OrientationSystem,
    Quaternion, RolloutError, Scalar, TransformationSystem,
};

/// The orientation in the coordinates that the primitive chose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum OrientationRows<T> {
    /// Eqs. (4), (6), (7).
    Quaternion { state: OrientationState<T>, start: Quaternion<T>, goal: Quaternion<T>, commanded: Quaternion<T> },
    /// Eq. (1) on rotation vectors.
    Vector { map: LogMap<T>, rows: PointRows<T, 3> },
}

/// Orientations at the ends of a demonstration, and how they are meant.
pub(crate) struct Taught<T> {
    pub(crate) start: Quaternion<T>,
    pub(crate) goal: Quaternion<T>,
    pub(crate) duration: T,
    pub(crate) error: OrientationError,
    pub(crate) hemisphere: Hemisphere,
}

impl<T: Scalar> OrientationRows<T> {
    /// Not turned and not turning.
    pub(crate) const AT_REST: Self = Self::Quaternion {
        state: OrientationState { q: Quaternion::IDENTITY, omega: [T::ZERO; 3] },
        start: Quaternion::IDENTITY,
        goal: Quaternion::IDENTITY,
        commanded: Quaternion::IDENTITY,
    };

    /// # Errors
    /// [`RolloutError::TurnsTooFar`].
    pub(crate) fn start(taught: &Taught<T>, from: &Quaternion<T>, omega: &[T; 3]) -> Result<Self, RolloutError> {
        let Taught { start: demonstrated, goal, duration, error, hemisphere } = *taught;
        let nearest = hemisphere == Hemisphere::Nearest;
        if error == OrientationError::RotationVector {
            let goal = if nearest { goal.aligned_with(&demonstrated) } else { goal };
            let map = LogMap::between(&demonstrated, &goal);
            let y = map.vector(from, &map.start());
            let dy = map.velocity(&y, omega);
            return Ok(Self::Vector { map, rows: PointRows::new(y, dy, duration, map.goal()) });
        }
        let (start, goal) =
            if nearest { (*from, goal.aligned_with(from)) } else { (from.aligned_with(&demonstrated), goal) };
        if !is_near_enough(&start, &goal) {
            return Err(RolloutError::TurnsTooFar);
        }
        Ok(Self::Quaternion {
            state: OrientationState { q: start, omega: scale(omega, duration) },
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
        f: &[T; 3],
        zeta: &[T; 3],
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
                    *goal = turned(goal, commanded, tick.goal_fraction);
                }
                out
            }
            Self::Vector { map, rows } => {
                let y = rows.state.map(|state| state.x());
                let zeta = map.generalised(&y, zeta);
                let row = rows.step(|_| gains, tick, f, &zeta);
                let (omega, domega) = map.rates(&row.x, &row.v, &row.a);
                OrientationReference { quaternion: map.orientation(&row.x), omega, domega }
            }
        }
    }

    /// # Errors
    /// [`RolloutError::TurnsTooFar`]; the goal stays as it was.
    pub(crate) fn command(
        &mut self,
        taught: &Taught<T>,
        new: &Quaternion<T>,
        filtered: bool,
    ) -> Result<(), RolloutError> {
        match self {
            Self::Quaternion { state, goal, commanded, .. } => {
                let new = match taught.hemisphere {
                    Hemisphere::Demonstrated => new.aligned_with(&taught.goal),
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
            Self::Vector { map, rows } => {
                rows.commanded = map.vector(new, &map.goal());
                if !filtered {
                    rows.goal = rows.commanded;
                }
            }
        }
        Ok(())
    }

    pub(crate) fn arrive(&mut self) {
        match self {
            Self::Quaternion { goal, commanded, .. } => *goal = *commanded,
            Self::Vector { rows, .. } => rows.goal = rows.commanded,
        }
    }

    /// The present orientation becomes the goal.
    pub(crate) fn settle(&mut self) {
        match self {
            // Of the sign that the path has now: it is the near one by itself.
            Self::Quaternion { state, goal, commanded, .. } => (*goal, *commanded) = (state.q, state.q),
            Self::Vector { rows, .. } => rows.settle(),
        }
    }
}

/// The goal after a tick of the filter. Not inlined: most runs have no goal filter.
#[inline(never)]
fn turned<T: Scalar>(goal: &Quaternion<T>, commanded: &Quaternion<T>, fraction: T) -> Quaternion<T> {
    let rest = goal.conjugate().product(commanded).rotation_vector();
    let turn = Quaternion::from_rotation_vector(&scale(&rest, fraction));
    let next = goal.product(&turn).renormalised();
    // What is less than the last digit of the goal would be lost.
    if next == *goal && takes_the_rest(fraction) { *commanded } else { next }
}
