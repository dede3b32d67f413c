//! `GoalFilter`: leads the goal of a run to the one that was commanded, no faster than the arm may follow.
//!
//! Eq (9) draws the plan to `g (1 - s) + x_0 s`. What is bounded is therefore the speed of `w = (g - g_0)(1 - s)`: the
//! plan follows `w` through a spring that does not swing, so the change adds no more than that to its speed.

use dmp::{Pose, Quaternion};
use nalgebra::Vector3;

use crate::real::{Real, sqrt};
use crate::time::{PERIOD, periods};

/// Largest speed that a change of goal adds to the plan (m/s, rad/s).
const GOAL_SPEED: (f64, f64) = (0.15, 0.5);

/// Share of the speed limits from which a goal moves slower, and from which it waits.
const CROWDED: (f64, f64) = (0.5, 0.8);

/// Below this `1 - s` a goal does not act yet.
const NO_EFFECT: f64 = 1e-3;

/// Above this `1 - s` a goal that is there stays there: what a faster run has yet to move is little.
const SETTLED: f64 = 0.95;

/// Longest way to a commanded goal: 30 s, in control periods. One that the arm cannot follow to is left.
const GOAL_TIME: u16 = periods(30.0);

/// The goal of the pose, and the way it has yet to go.
#[derive(Clone, Debug)]
pub(crate) struct GoalFilter<R: Real> {
    base: Pose<R>,
    commanded: Pose<R>,
    /// `w` of position (m) and orientation (rad, axes of the base).
    shift: (Vector3<R>, Vector3<R>),
    /// Control periods for which the goal may still move; 0 once it is there for good.
    left: u16,
    /// True while it is behind what the phase asks for.
    lags: bool,
    /// True if an orientation was commanded.
    turns: bool,
}

impl<R: Real> GoalFilter<R> {
    /// The goal rests here.
    pub(crate) fn at(goal: Pose<R>) -> Self {
        let shift = (Vector3::zeros(), Vector3::zeros());
        GoalFilter { base: goal, commanded: goal, shift, left: 0, lags: false, turns: false }
    }

    /// Begins to move to another goal; what is not given stays.
    pub(crate) fn command(&mut self, position: Option<[R; 3]>, orientation: Option<Quaternion<R>>) {
        self.commanded.position = position.unwrap_or(self.commanded.position);
        self.commanded.orientation = orientation.unwrap_or(self.commanded.orientation);
        self.turns |= orientation.is_some();
        (self.left, self.lags) = (GOAL_TIME, true);
    }

    /// True if an orientation was commanded: only then is that of the goal to be set.
    pub(crate) fn turns(&self) -> bool {
        self.turns
    }

    /// True until the commanded goal is reached for good.
    pub(crate) fn moves(&self) -> bool {
        self.left > 0
    }

    /// True while the goal is behind what the phase asks for: the run waits for it.
    pub(crate) fn lags(&self) -> bool {
        self.lags
    }

    /// Moves for one control period at the phase `s`, while the plan uses the part `load` of the speed limits; returns
    /// the goal, `None` where it stays as it was.
    pub(crate) fn step(&mut self, s: R, load: R) -> Option<Pose<R>> {
        let part = R::constant(1.0) - s;
        if self.left == 0 || part < R::constant(NO_EFFECT) {
            return None;
        }
        let free = (R::constant(CROWDED.1) - load) * R::constant(1.0 / (CROWDED.1 - CROWDED.0));
        // Of a NaN neither holds, and the goal waits.
        let share = if free >= R::constant(1.0) {
            R::constant(1.0)
        } else if free > R::constant(0.0) {
            free
        } else {
            R::constant(0.0)
        };
        let step = (share * R::constant(GOAL_SPEED.0 * PERIOD), share * R::constant(GOAL_SPEED.1 * PERIOD));
        let turn =
            self.base.orientation.conjugate().product(&self.commanded.orientation.aligned_with(&self.base.orientation));
        let way = Vector3::from(self.commanded.position) - Vector3::from(self.base.position);
        let moved = approach(&mut self.shift.0, way * part, step.0);
        let turned = approach(&mut self.shift.1, Vector3::from(turn.rotation_vector()) * part, step.1);
        self.lags = !(moved && turned);
        if !self.lags {
            // In a slow run it is there at once, and has most of its way before it once that is made fast.
            if part > R::constant(SETTLED) {
                self.left = 0;
            }
            return Some(self.commanded);
        }
        self.left -= 1;
        let scale = R::constant(1.0) / part;
        let position = Vector3::from(self.base.position) + self.shift.0 * scale;
        let turn = Quaternion::from_rotation_vector(&(self.shift.1 * scale).into());
        Some(Pose { position: position.into(), orientation: self.base.orientation.product(&turn).renormalised() })
    }
}

/// Moves a vector towards another by at most a length; true if it is there.
fn approach<R: Real>(from: &mut Vector3<R>, to: Vector3<R>, longest: R) -> bool {
    let way = to - *from;
    let squared = way.norm_squared();
    if squared <= longest * longest {
        *from = to;
        return true;
    }
    if longest > R::constant(0.0) {
        *from += way * (longest / sqrt(squared));
    }
    false
}
