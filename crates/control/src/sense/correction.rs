//! `Correction`: gains of an observer with given poles.

use crate::real::Real;
use crate::time::PERIOD;
use crate::units::{JOINTS, Vector7};

/// Gains by which positions, velocities and unexplained accelerations follow what is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Correction<R: Real> {
    pub(super) position: Vector7<R>,
    pub(super) velocity: Vector7<R>,
    pub(super) acceleration: Vector7<R>,
}

impl<R: Real> Correction<R> {
    /// Two poles at `motion` and one at `disturbance` (Hz), joint by joint.
    pub(super) fn with_poles(motion: &[f64; JOINTS], disturbance: f64) -> Self {
        let away = |frequency: f64| 1.0 - libm::exp(-core::f64::consts::TAU * frequency * PERIOD);
        let slow = away(disturbance);
        let mut correction =
            Correction { position: Vector7::zeros(), velocity: Vector7::zeros(), acceleration: Vector7::zeros() };
        for (joint, motion) in motion.iter().enumerate() {
            let fast = away(*motion);
            let third = fast * fast * slow;
            let second = fast * fast + 2.0 * fast * slow - 1.5 * third;
            let first = 2.0 * fast + slow - second - 0.5 * third;
            correction.position[joint] = R::constant(first);
            correction.velocity[joint] = R::constant(second / PERIOD);
            correction.acceleration[joint] = R::constant(third / (PERIOD * PERIOD));
        }
        correction
    }
}
