//! `reach`: how far the spring of a joint may be drawn, so that it throws nothing back.

use crate::real::{Real, at_least};
use crate::units::JOINTS;

/// Speeds of a joint towards the end of its drawn spring, beyond that of its plan, between which the spring is let go
/// of (rad/s): lower where the whole arm is the lever, which makes 0.25 m/s of 0.28 rad/s.
pub(crate) const LET_GO: [(f64, f64); JOINTS] = {
    let (arm, wrist) = ((0.12, 0.25), (0.15, 0.35));
    [arm, arm, arm, arm, wrist, wrist, wrist]
};

/// Returns how far a spring may be drawn (rad) whose end is `drawn` away from its joint: less than `clamp` the faster
/// the joint returns to it, `None` where it need not be let go of. `speed` is that of the joint beyond its plan,
/// `let_go` the entry of [`LET_GO`] (rad/s).
pub(crate) fn reach<R: Real>(drawn: R, speed: R, clamp: R, let_go: (f64, f64)) -> Option<R> {
    let (slow, fast) = let_go;
    let zero = R::constant(0.0);
    let back = if drawn < zero { -speed } else { speed };
    let share = |back: R| at_least((R::constant(fast) - back) * R::constant(1.0 / (fast - slow)), zero);
    (back > R::constant(slow)).then(|| share(back) * clamp)
}
