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

#[cfg(test)]
mod tests {
    use super::*;

    const HERE: [f64; 3] = [0.4, -0.1, 0.3];
    const STEP: f64 = GOAL_SPEED.0 * PERIOD;
    const TURN: f64 = GOAL_SPEED.1 * PERIOD;

    /// A goal at rest, turned by 0.4 rad about z.
    fn goal() -> GoalFilter<f64> {
        GoalFilter::at(Pose { position: HERE, orientation: turned(0.4) })
    }

    fn turned(angle: f64) -> Quaternion<f64> {
        Quaternion::from_rotation_vector(&[0.0, 0.0, angle])
    }

    /// Angle about z (rad) of an orientation.
    fn angle(orientation: &Quaternion<f64>) -> f64 {
        orientation.rotation_vector()[2]
    }

    /// Steps at a phase and a load until the goal is there, at most 20 000.
    fn steps(goal: &mut GoalFilter<f64>, s: f64, load: f64) -> usize {
        (0..20_000).take_while(|_| goal.lags() && goal.step(s, load).is_some()).count()
    }

    /// The change that makes it fail: a goal that nobody commanded is moved or turned.
    #[test]
    fn a_goal_at_rest_stays_and_one_that_does_not_act_yet_waits() {
        let mut at_rest = goal();
        assert!(!at_rest.moves() && !at_rest.lags() && !at_rest.turns());
        assert_eq!(at_rest.step(0.5, 0.0), None);
        let mut early = goal();
        early.command(Some([0.5, -0.1, 0.3]), None);
        assert!(early.moves() && early.lags() && !early.turns());
        assert_eq!(early.step(0.9995, 0.0), None, "1 - s is not yet a thousandth");
        assert!(early.moves() && early.lags() && early.step(0.99, 0.0).is_some());
        early.command(None, Some(turned(0.5)));
        assert!(early.turns());
        early.command(None, None);
        assert!(early.turns(), "once commanded, it goes on turning");
    }

    /// The change that makes it fail: a step of `w` is longer or shorter than 0.15 m/s, or the goal goes elsewhere.
    #[test]
    fn a_goal_moves_by_its_speed_over_the_part_that_acts() {
        for part in [1.0, 0.5, 0.1] {
            let mut goal = goal();
            goal.command(Some([0.4, 0.1, 0.3]), None);
            let pose = goal.step(1.0 - part, 0.0).expect("it moves");
            let moved = Vector3::from(pose.position) - Vector3::from(HERE);
            assert!((moved - Vector3::new(0.0, STEP / part, 0.0)).amax() < 1e-12, "{part}: {moved}");
            assert!((angle(&pose.orientation) - 0.4).abs() < 1e-12);
            let (way, before) = (0.2 * part, 1);
            let rest = steps(&mut goal, 1.0 - part, 0.0);
            let expected = (way / STEP).ceil() as usize;
            assert!((rest + before).abs_diff(expected) <= 1, "{part}: {rest} steps, {expected}");
        }
    }

    /// The change that makes it fail: an orientation is reached faster than with 0.5 rad/s, or never.
    #[test]
    fn an_orientation_turns_by_its_speed_and_is_waited_for() {
        let mut goal = goal();
        goal.command(None, Some(turned(1.0)));
        let pose = goal.step(0.5, 0.0).expect("it turns");
        assert!((angle(&pose.orientation) - 0.4 - TURN / 0.5).abs() < 1e-9 && pose.position == HERE);
        let rest = steps(&mut goal, 0.5, 0.0);
        assert!((rest + 1).abs_diff((0.3 / TURN).ceil() as usize) <= 1, "{rest}");
        let reached = goal.step(0.5, 0.0).expect("it is held there while it may still move");
        assert!((angle(&reached.orientation) - 1.0).abs() < 1e-9 && !goal.lags());
    }

    /// The change that makes it fail: a plan that uses its speed limits gets a goal that moves on, or one with room
    /// waits.
    #[test]
    fn a_goal_moves_slower_from_half_of_the_speed_limits_and_waits_from_four_fifths() {
        for (load, share) in [(0.0, 1.0), (0.5, 1.0), (0.65, 0.5), (0.71, 0.3), (0.8, 0.0), (2.0, 0.0), (f64::NAN, 0.0)]
        {
            let mut goal = goal();
            goal.command(Some([0.5, -0.1, 0.3]), Some(turned(0.9)));
            let pose = goal.step(0.5, load).expect("it is under way");
            let (moved, turn) = (pose.position[0] - HERE[0], angle(&pose.orientation) - 0.4);
            assert!((moved - 2.0 * share * STEP).abs() < 1e-9, "{load}: {moved} m");
            assert!((turn - 2.0 * share * TURN).abs() < 1e-9, "{load}: {turn} rad");
            assert!(goal.lags() && goal.moves());
        }
    }

    /// The change that makes it fail: a goal is there for good before it acts in full, or one that cannot be followed
    /// to is followed without end.
    #[test]
    fn a_goal_is_there_for_good_once_nearly_all_of_it_acts_or_its_time_is_over() {
        let mut early = goal();
        early.command(Some([0.401, -0.1, 0.3]), None);
        steps(&mut early, 0.1, 0.0);
        assert!(early.moves() && !early.lags(), "what is there at s = 0.1 has a little left to go");
        assert_eq!(early.step(0.04, 0.0).map(|pose| pose.position), Some([0.401, -0.1, 0.3]));
        assert!(!early.moves() && early.step(0.04, 0.0).is_none());
        let mut held_up = goal();
        held_up.command(Some([0.5, -0.1, 0.3]), None);
        assert_eq!(steps(&mut held_up, 0.0, 1.0), usize::from(GOAL_TIME));
        assert!(!held_up.moves() && held_up.step(0.0, 0.0).is_none());
    }
}
