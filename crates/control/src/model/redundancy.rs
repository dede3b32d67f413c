//! Rates of the other joints instead of one: the arm has one joint more than its tool needs.

use crate::model::kinematics::DampedInverse;
use crate::real::{Real, at_least};
use crate::units::{JOINTS, Vector6, Vector7};

/// Least square of the part that a joint has in the motion in which the tool stands: where it is less, nothing makes up
/// for the joint but others that are more than seven times as fast.
const LEAST_SPARED: f64 = 0.02;

impl<R: Real> DampedInverse<'_, R> {
    /// Rates of the other joints for each rate that a joint (0 to 6) loses, and none for that one: the tool moves on as
    /// before, as far as they can do without the joint.
    ///
    /// Not inlined: it is asked near a limit.
    #[inline(never)]
    pub fn instead_of(&self, joint: usize) -> Vector7<R> {
        let joint = joint % JOINTS;
        let column = Vector6::from(self.jacobian.0.data.0[joint]);
        let mut rates = self.resolve(&column, &Vector7::zeros());
        // The square of the part that the joint has in the motion in which the tool stands.
        let spared = R::constant(1.0) - rates[joint];
        rates *= R::constant(1.0) / at_least(spared, R::constant(LEAST_SPARED));
        rates[joint] = R::constant(0.0);
        rates
    }
}
