//! `Support`: an upward force on the hand of an arm that sinks after a stop, under a load that nobody declared.
//!
//! A soft stop carries the arm as the model knows it, and damps. Under a kilogram more the hand went on sinking at up
//! to 1 m/s, until it lay on something. So a force upwards grows while the hand sinks, up to that of 1.2 kg. Where the
//! hand rises it shrinks as fast. Nor does it stay above what the wrist's sensor measures that the hand bears: an arm
//! that a person has pressed down does not spring up, and no joint is driven to its limit by a load that is gone.
//! Without a sensor there is no force; one that falls silent is believed for a moment, unless the hand rises. Once a
//! fault is cleared the arm floats with the force it had, as far as the hand still bears it, and a hold takes it over.

use crate::model::kinematics::Frames;
use crate::real::{Real, at_least, at_most};
use crate::time::PERIOD;
use crate::units::{Vector6, Vector7};

/// Largest force (N): a kilogram, and a fifth more. An arm that somebody has pressed down springs up by it.
const MOST: f64 = 12.0;

/// Speed of the hand up to which nothing changes (m/s): in a stop a load comes to rest with so little.
const SLACK: f64 = 0.01;

/// Growth of the force (N/s) for each m/s that the hand sinks faster, and its decline where it rises. With 70 a
/// kilogram sank at 0.4 m/s after 0.3 s, with 200 at 0.17. A decline that is much faster drives the cables.
const TAKING: f64 = 200.0;

/// Decline of a force that the hand does not bear (N/s): all of it in 0.04 s. The inertia of what hangs on the hand
/// swings with the cables, and the force does not swing with it.
const LEAVING: f64 = 300.0;

/// The force on the hand.
#[derive(Clone, Copy, Debug)]
pub struct Support<R: Real> {
    force: R,
}

impl<R: Real> Support<R> {
    /// No force.
    pub fn new() -> Self {
        Support { force: R::constant(0.0) }
    }

    /// Takes the speed at which the hand sinks (m/s), and the load that it is measured to bear (N). It may sink at
    /// `allowed` (m/s).
    pub fn step(&mut self, sinking: R, borne: R, allowed: R) {
        let zero = R::constant(0.0);
        let slack = R::constant(SLACK);
        let change = at_least(sinking - allowed - slack, zero) + at_most(sinking + slack, zero);
        let wanted = self.force + change * R::constant(TAKING * PERIOD);
        let most = at_least(at_most(borne, R::constant(MOST)), self.force - R::constant(LEAVING * PERIOD));
        self.force = at_least(at_most(wanted, most), zero);
    }

    /// Keeps the force, as far as the hand is measured to bear it (N), and takes no more: a person who leads the arm
    /// down does not press against a spring.
    pub fn keep(&mut self, borne: R) {
        let most = at_least(borne, self.force - R::constant(LEAVING * PERIOD));
        self.force = at_least(at_most(self.force, most), R::constant(0.0));
    }

    /// True if there is a force.
    pub fn carries(&self) -> bool {
        self.force > R::constant(0.0)
    }

    /// The force on the hand, as torque of the joints (N m).
    pub fn torque(&self, frames: &Frames<R>) -> Vector7<R> {
        let zero = R::constant(0.0);
        frames.joint_torques(&Vector6::new(zero, zero, self.force, zero, zero, zero)).0
    }
}

impl<R: Real> Default for Support<R> {
    fn default() -> Self {
        Support::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::arm::ArmModel;
    use crate::model::calibration::Payload;
    use crate::units::JointPositions;

    /// The force after so many seconds at this speed.
    fn after(support: &mut Support<f64>, seconds: f64, sinking: f64, allowed: f64) -> f64 {
        for _ in 0..(seconds / PERIOD).round() as u32 {
            support.step(sinking, 2.0 * MOST, allowed);
        }
        support.force
    }

    #[test]
    fn the_force_grows_with_the_way_that_the_hand_sinks_faster_than_it_may_up_to_its_bound() {
        for allowed in [0.0, 0.12] {
            let mut support = Support::new();
            let grown = after(&mut support, 0.1, allowed + SLACK + 0.2, allowed);
            assert!((grown - 0.1 * 0.2 * TAKING).abs() < 1e-9, "{grown}");
            assert_eq!(after(&mut support, 1.0, allowed + 0.99 * SLACK, allowed), grown);
            assert_eq!(after(&mut support, 5.0, 1.0, allowed), MOST);
        }
    }

    #[test]
    fn the_force_goes_away_where_the_hand_rises_and_pulls_nothing_down() {
        let mut support = Support { force: MOST };
        assert_eq!(after(&mut support, 1.0, -0.99 * SLACK, 0.0), MOST);
        let left = after(&mut support, PERIOD, -SLACK - 0.1, 0.0);
        assert!((left - (MOST - 0.1 * TAKING * PERIOD)).abs() < 1e-9, "{left}");
        assert_eq!(after(&mut support, 2.0, -0.1, 0.0), 0.0);
    }

    #[test]
    fn a_force_that_the_hand_does_not_bear_is_gone_within_a_twentieth_of_a_second() {
        for (borne, force) in [(5.0, 5.0), (-3.0, 0.0), (f64::NEG_INFINITY, 0.0)] {
            let mut support = Support { force: MOST };
            support.step(0.5, borne, 0.0);
            assert!((support.force - (MOST - LEAVING * PERIOD)).abs() < 1e-9);
            for _ in 0..(MOST / LEAVING / PERIOD) as u32 {
                support.step(0.5, borne, 0.0);
            }
            assert!((support.force - force).abs() < 1e-9, "{}", support.force);
        }
    }

    #[test]
    fn the_torque_is_that_of_a_force_upwards_on_the_hand() {
        let model = ArmModel::new(Payload::SensorAndHand);
        let frames = Frames::new(&model, &JointPositions::from_array([0.2, 0.9, -0.3, 1.4, 0.4, -0.5, 0.6]));
        let torque = Support { force: 7.0 }.torque(&frames);
        let dq = Vector7::from([0.3, -0.2, 0.5, 0.4, -0.6, 0.7, 0.1]);
        let power: f64 = 7.0 * frames.jacobian().twist(&dq)[2];
        assert!((torque.dot(&dq) - power).abs() < 1e-12 && power.abs() > 0.1, "{power}");
    }
}
