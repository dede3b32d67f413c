//! `Inertia`: the mass of a plan that bends.
//!
//! Pushed by a force, Eq (8) moves the plan like a mass `tau^2 / K1` (per `K2`): 0.45 kg with the gains for 12 s, 0.06
//! kg with those for 3 s. The plan's acceleration is fed forward, and the wrist sensor feels the hand's 1.3 kg: a plan
//! that is lighter than the hand answers each swing of the hand with more than that swing, and J6 and J7 swing at 3 to
//! 6 Hz where there is no friction.
//! So what is fast in `zeta` counts for no less than [`MASS`], and what is slow bends the plan as far as before:
//! `zeta = wanted / m + (1 - 1/m) slow`, `m = MASS / (tau^2 / K1)`, `slow` a low-pass of `zeta` as it was limited.

use dmp::Scalar;

use crate::time::PERIOD;

/// Mass of the plan (kg): the hand, and half of it again. From 2 kg on a standing object topples before the hand gives
/// way.
const MASS: f64 = 2.0;

/// Rate from which on a change is fast (1/s).
const FAST: f64 = 4.5;

/// Mass of a plan.
#[derive(Clone, Copy, Debug)]
pub struct Inertia<T> {
    /// The slow part of `zeta` of the position rows.
    slow: [T; 3],
}

impl<T: Scalar> Inertia<T> {
    /// At rest.
    pub fn new() -> Self {
        Inertia { slow: [T::ZERO; 3] }
    }

    /// `zeta` of the position rows as a plan of this mass follows it. `gain` is the largest `K1 K2` of these rows, and
    /// `rate` is that of the rollout (1/s).
    pub(crate) fn carried(&self, mut zeta: [T; 3], gain: T, rate: T) -> [T; 3] {
        let times = gain * rate * rate * T::from_f64(MASS);
        if times > T::ONE {
            let share = T::ONE / times;
            zeta.iter_mut().zip(&self.slow).for_each(|(zeta, slow)| *zeta = *slow + (*zeta - *slow) * share);
        }
        zeta
    }

    /// Takes `zeta` of the position rows as it was limited.
    pub(crate) fn follow(&mut self, zeta: &[T; 3]) {
        for (slow, zeta) in self.slow.iter_mut().zip(zeta) {
            *slow = *slow + (*zeta - *slow) * T::from_f64(FAST * PERIOD);
        }
    }
}

impl<T: Scalar> Default for Inertia<T> {
    fn default() -> Self {
        Inertia::new()
    }
}
