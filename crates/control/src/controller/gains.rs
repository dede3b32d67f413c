//! The gains of all controllers, with the values that were tuned against the simulated arm.

use crate::model;
use crate::real::Real;
use crate::units::Vector7;

/// Joint stiffness `K_p` of Eq (10) (N m/rad). Error of the plan under Coulomb friction alone: friction / K_p.
const STIFFNESS: [f64; 7] = [300.0, 700.0, 150.0, 160.0, 10.0, 20.0, 2.5];

/// Joint damping `K_d` of Eq (10) (N m s/rad). Too high for the delay of the loop, the wrist sings; too low, it rings.
const DAMPING: [f64; 7] = [22.0, 40.0, 4.5, 5.0, 0.22, 0.6, 0.06];

/// Fraction of the model's Coulomb friction that is fed forward. Below 1, so that too large an estimate never drives.
const FRICTION_FRACTION: f64 = 0.8;

/// Largest distance `|q_d - q|` (rad): anti-windup of Eq (11). Times `K_p` it is the most a blocked joint pushes with, and
/// that has to be more than its friction.
const CLAMP: [f64; 7] = [0.10, 0.10, 0.10, 0.10, 0.20, 0.15, 0.20];

/// Largest torque of the integral of `Hold` and `Approach`, in parts of the model's Coulomb friction: enough for friction that
/// is 30 % more, with 20 % to spare.
const SETTLING_FRACTION: f64 = 1.5;

/// Damping of a soft stop (N m s/rad).
const STOP_DAMPING: [f64; 7] = [22.0, 40.0, 4.5, 5.0, 0.22, 0.6, 0.06];

/// Every gain of the controllers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains<R: Real> {
    /// `K_p` of Eq (10) (N m/rad).
    pub stiffness: Vector7<R>,
    /// `K_d` of Eq (10) (N m s/rad).
    pub damping: Vector7<R>,
    /// Coulomb friction fed forward (N m).
    pub coulomb: Vector7<R>,
    /// Viscous friction fed forward (N m s/rad).
    pub viscous: Vector7<R>,
    /// `K_x` of Eq (11) for the position (1/s).
    pub position: R,
    /// `K_x` of Eq (11) for the orientation (1/s).
    pub orientation: R,
    /// `K_post` of Eq (11) (1/s).
    pub posture: R,
    /// Damping `lambda` of the pseudo-inverse (m^2). Accuracy near a singularity against joint speed there: with 4e-4 a
    /// direction of singular value 0.16 keeps 98 % of its motion, with the 0.01 of other controllers 72 %.
    pub inverse_damping: R,
    /// Largest `|q_d - q|` per joint (rad).
    pub clamp: Vector7<R>,
    /// Largest shift of a held posture by the integral (rad); times `K_p` the most it adds against an obstacle.
    pub settling: Vector7<R>,
    /// Proportional gain of Eq (12); the paper has 1.
    pub force_proportional: R,
    /// `K_i` of Eq (12) (1/s).
    pub force_integral: R,
    /// Window `Delta t` of Eq (12) (control periods).
    pub force_window: usize,
    /// Damping of a soft stop (N m s/rad).
    pub stop_damping: Vector7<R>,
}

impl<R: Real> Gains<R> {
    /// The gains this crate was tuned with.
    pub fn tuned() -> Self {
        let vector = |values: [f64; 7]| Vector7::from(values.map(R::of));
        Gains {
            stiffness: vector(STIFFNESS),
            damping: vector(DAMPING),
            coulomb: vector(model::FRICTION_COULOMB) * R::of(FRICTION_FRACTION),
            viscous: vector(model::FRICTION_VISCOUS),
            position: R::of(3.0),
            orientation: R::of(3.0),
            posture: R::of(1.0),
            inverse_damping: R::of(4e-4),
            clamp: vector(CLAMP),
            settling: (vector(model::FRICTION_COULOMB) * R::of(SETTLING_FRACTION)).component_div(&vector(STIFFNESS)),
            force_proportional: R::of(1.0),
            force_integral: R::of(2.0),
            force_window: 60,
            stop_damping: vector(STOP_DAMPING),
        }
    }
}

impl<R: Real> Default for Gains<R> {
    fn default() -> Self {
        Gains::tuned()
    }
}
