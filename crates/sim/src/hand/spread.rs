//! The drive of the spread: a motor and spur gears, which a push at the fingers can turn.

use super::drive::{Demand, Inertia};
use crate::time::STEP_SECONDS;

/// Full spread, 180 degrees, rad.
const RANGE: f64 = std::f64::consts::PI;

/// Viscous friction of the shorted motor, N m s/rad at the spread. Assumed, from the rotor's inertia as for the arm's
/// motors.
const BRAKE: f64 = 0.02;

/// Drive of the spread.
#[derive(Clone, Debug)]
pub(crate) struct Spread {
    angle: f64,
    speed: f64,
    mass: Inertia,
}

impl Spread {
    /// At rest at `angle`, rad.
    pub(crate) fn new(angle: f64, mass: Inertia) -> Self {
        Self { angle: angle.clamp(0.0, RANGE), speed: 0.0, mass }
    }

    /// Angle, rad.
    pub(crate) fn angle(&self) -> f64 {
        self.angle
    }

    /// Rate, rad/s.
    pub(crate) fn speed(&self) -> f64 {
        self.speed
    }

    /// One step of physics while the drive exerts `load` on the fingers (N m): they push back as much.
    pub(crate) fn step(&mut self, demand: Demand, load: f64) {
        let brake = if demand == Demand::Idle { BRAKE } else { 0.0 };
        let torque = self.mass.torque(demand, self.speed, load) - load;
        let driven = self.mass.driven(self.speed, torque, brake);
        self.speed = self.mass.rubbed(driven, self.mass.coulomb, brake);
        let angle = self.angle + STEP_SECONDS * self.speed;
        self.angle = angle.clamp(0.0, RANGE);
        if self.angle != angle {
            self.speed = 0.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MASS: Inertia = Inertia { inertia: 4e-4, viscous: 0.1, coulomb: 0.05 };

    #[test]
    fn a_push_turns_the_idle_spread_and_friction_holds_it_against_a_small_one() {
        let pushed = |load: f64| {
            let mut spread = Spread::new(1.0, MASS);
            (0..200).for_each(|_| spread.step(Demand::Idle, load));
            spread.angle()
        };
        assert_eq!(pushed(0.04), 1.0);
        assert!(pushed(0.2) < 0.9, "the fingers push back along the load's opposite");
        assert!(pushed(-0.2) > 1.1);
    }
}
