//! The common part of finger and spread drives: a reflected inertia with friction, and the puck's demand.
//!
//! `v = (I v + h tau) / (I + h b)`; then Coulomb friction, and with a worm the load, take up to `h c / (I + h b)` from
//! `|v|` and never turn its sign: `I` inertia, `b` viscous and `c` Coulomb friction, `h` step.

use crate::time::STEP_SECONDS;

/// Demand of a puck on its drive during the next step, at the link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Demand {
    /// Nothing: windings shorted.
    Idle,
    /// A torque, N m.
    Torque(f64),
    /// A velocity, rad/s, with at most this torque, N m. The puck's own controllers are taken as ideal within their
    /// torque limit.
    Velocity(f64, f64),
}

/// Motor and gears reflected to the link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Inertia {
    /// kg m^2.
    pub(crate) inertia: f64,
    /// N m s/rad.
    pub(crate) viscous: f64,
    /// N m.
    pub(crate) coulomb: f64,
}

impl Inertia {
    /// The torque that fulfils a demand at velocity `v`, against a load (positive: opposes positive motion), N m.
    pub(crate) fn torque(&self, demand: Demand, v: f64, load: f64) -> f64 {
        match demand {
            Demand::Idle => 0.0,
            Demand::Torque(torque) => torque,
            Demand::Velocity(wanted, limit) => {
                let friction = if wanted == 0.0 { 0.0 } else { self.coulomb.copysign(wanted) };
                let exact = (wanted - v) * self.inertia / STEP_SECONDS + self.viscous * wanted + friction + load;
                exact.clamp(-limit, limit)
            }
        }
    }

    /// The velocity after one step under a torque, before dry friction, with `brake` added to the viscous friction.
    pub(crate) fn driven(&self, v: f64, torque: f64, brake: f64) -> f64 {
        (self.inertia * v + STEP_SECONDS * torque) / (self.inertia + STEP_SECONDS * (self.viscous + brake))
    }

    /// The velocity after a dry torque that can stop the motion but never turn it, N m.
    pub(crate) fn rubbed(&self, driven: f64, dry: f64, brake: f64) -> f64 {
        let loss = STEP_SECONDS * dry / (self.inertia + STEP_SECONDS * (self.viscous + brake));
        driven.signum() * (driven.abs() - loss).max(0.0)
    }
}
