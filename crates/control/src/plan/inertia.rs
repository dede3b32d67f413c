//! `Inertia`: the mass of a plan that bends.
//!
//! Pushed by a force, Eq (8) moves the plan like a mass `tau^2 / K1`: 0.45 kg with the gains for 12 s, 0.06 kg with
//! those for 3 s. The plan's acceleration is fed forward, and the wrist sensor feels the hand's 1.3 kg: a plan that is
//! lighter than the hand answers each swing of the hand with more than that swing, and J6 and J7 swing at 3 to 6 Hz
//! where there is no friction.
//! So what is fast in the force counts for no less than [`MASS`], and what is slow bends the plan as far as before:
//! `F' = slow + (F - slow) / m`, `m = MASS / (tau^2 / K1)`, `slow` a low-pass of `F'` as far as that bends the plan.

use nalgebra::Vector3;

use crate::plan::primitive::Primitive;
use crate::real::{Real, within};
use crate::time::PERIOD;

/// Least mass of a plan for what is fast (kg): the hand, and half of it again. Beyond 2 kg a standing object topples
/// before the hand gives way. K2 counts as 1, its mean.
pub const MASS: f64 = 2.0;

/// Rate from which on a change is fast (1/s).
const FAST: f64 = 4.5;

/// Mass of a plan.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Inertia<R: Real> {
    /// The slow part of the force (N).
    slow: Vector3<R>,
    /// The plan is lighter than [`MASS`] so many times, at a rate of 1/s.
    lighter: R,
    /// Force that bends the plan to its limit (N).
    most: R,
}

impl<R: Real> Inertia<R> {
    /// A plan that is left as it is.
    pub(crate) fn none() -> Self {
        Inertia { slow: Vector3::zeros(), lighter: R::constant(0.0), most: R::constant(0.0) }
    }

    /// Takes on a plan of this primitive. Not inlined, as `carry`: a run that begins is not to be copied for it.
    #[inline(never)]
    pub(crate) fn take_on<const N: usize>(&mut self, primitive: &Primitive<R, N>) {
        if let Some(feedback) = primitive.feedback() {
            let (k1, [stiffness]) = (feedback.largest(), primitive.movement().position_stiffness());
            self.lighter = k1 * R::constant(MASS);
            if k1 > R::constant(0.0) {
                self.most = feedback.limits().poses[0].displacement * stiffness / k1;
            }
        }
    }

    /// Makes a force (N) what bends a plan of this mass. `rate` is that of the rollout (1/s).
    ///
    /// Not inlined: it runs from flash on a board whose fast memory is full.
    #[inline(never)]
    pub(crate) fn carry(&mut self, force: &mut Vector3<R>, rate: R) {
        let times = self.lighter * rate * rate;
        if times > R::constant(1.0) {
            let share = R::constant(1.0) / times;
            for (force, slow) in force.iter_mut().zip(self.slow.iter_mut()) {
                *force = *slow + (*force - *slow) * share;
                *slow += (within(*force, self.most) - *slow) * R::constant(FAST * PERIOD);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rate of a movement of 12 s (1/s), and the gain that makes its plan 0.45 kg heavy.
    const RATE: f64 = 1.0 / 12.0;
    const LIGHT: f64 = 320.0;

    fn inertia(k1: f64) -> Inertia<f64> {
        Inertia { slow: Vector3::zeros(), lighter: k1 * MASS, most: 0.3 }
    }

    /// Force that bends the plan after so many control periods under this one (N).
    fn carried(inertia: &mut Inertia<f64>, force: f64, periods: u32) -> f64 {
        (0..periods).fold(0.0, |_, _| {
            let mut bending = Vector3::new(0.0, force, 0.0);
            inertia.carry(&mut bending, RATE);
            bending.y
        })
    }

    #[test]
    fn what_is_fast_moves_a_light_plan_as_one_of_its_mass_and_what_is_slow_as_before() {
        for force in [0.2, -0.2] {
            let mut inertia = inertia(LIGHT);
            let first = carried(&mut inertia, force, 1) * LIGHT * RATE * RATE;
            assert!((first - force / MASS).abs() < 1e-12, "{first} m/s^2");
            assert!((carried(&mut inertia, force, 3000) - force).abs() < 1e-3);
        }
    }

    #[test]
    fn a_plan_that_is_heavier_is_left_as_it_is() {
        assert_eq!(carried(&mut inertia(0.99 / (MASS * RATE * RATE)), 0.7, 10), 0.7);
    }

    #[test]
    fn a_force_that_bends_a_plan_to_its_limit_does_so_at_once_and_leaves_no_more_behind() {
        let mut inertia = inertia(LIGHT);
        assert!(carried(&mut inertia, 2.0, 1) > 0.3);
        carried(&mut inertia, 2.0, 3000);
        let left = carried(&mut inertia, 0.0, 1);
        assert!(left > 0.0 && left < 0.3, "{left} N");
    }
}
