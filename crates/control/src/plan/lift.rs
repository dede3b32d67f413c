//! `Lift`: a hand that has raised what it grips and carries what was expected.
//!
//! A table holds up what stands on it, so before a grip is raised nobody knows what holds the arm beside its plan. Once
//! the plan has gone up with it, and the sensor measures what it should, the arm is as free as one that touches
//! nothing.

use crate::plan::reference::TaskReference;
use crate::real::{Real, at_most};
use crate::sense::deviation::Deviation;
use crate::units::Wrench;

/// Height above the lowest place of the plan in this grip from which on it is raised (m).
const RAISED: f64 = 0.02;

/// Speed of the plan below which it rests (m/s).
const RESTING: f64 = 0.02;

/// Deviation beyond the dead band up to which what is carried is what was expected: force (N).
const CARRIED_FORCE: f64 = 0.7;

/// The same of the torque (N m).
const CARRIED_TORQUE: f64 = 0.15;

/// A height that is above every plan (m).
const ABOVE: f64 = 10.0;

/// The way of a grip along the plan, and its load.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lift<R: Real> {
    /// Lowest height of the plan since the hand began to grip (m).
    lowest: R,
    carries: bool,
}

impl<R: Real> Lift<R> {
    /// Of a hand that does not grip yet.
    pub(crate) fn new() -> Self {
        Lift { lowest: R::constant(ABOVE), carries: false }
    }

    /// True while the hand has raised what it grips, and carries what was expected.
    pub(crate) fn carries(&self) -> bool {
        self.carries
    }

    /// Takes the plan of a control period and, in a grip, the deviation without what swings; returns true while a load
    /// that was expected is carried and the plan rests.
    pub(crate) fn step(&mut self, plan: &TaskReference<R>, grips: bool, deviation: Option<&Deviation<R>>) -> bool {
        if grips {
            self.raise(plan, deviation)
        } else {
            *self = Lift::new();
            false
        }
    }

    /// The same in a grip. Not inlined: it runs from flash on a board whose fast memory is full.
    #[inline(never)]
    fn raise(&mut self, plan: &TaskReference<R>, deviation: Option<&Deviation<R>>) -> bool {
        self.lowest = at_most(plan.pose.position.z, self.lowest);
        let raised = plan.pose.position.z - self.lowest > R::constant(RAISED);
        self.carries = raised
            && deviation.is_some_and(|deviation| {
                let Wrench { force, torque } = &deviation.wrench;
                force.dot(force) < R::constant(CARRIED_FORCE * CARRIED_FORCE)
                    && torque.dot(torque) < R::constant(CARRIED_TORQUE * CARRIED_TORQUE)
            });
        let velocity = plan.velocity.fixed_rows::<3>(0);
        self.carries && velocity.dot(&velocity) < R::constant(RESTING * RESTING)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::{Orientation, Pose, Vector6, Vector7};
    use nalgebra::Vector3;

    fn plan(height: f64, speed: f64) -> TaskReference<f64> {
        TaskReference {
            pose: Pose { position: Vector3::new(0.7, 0.2, height), orientation: Orientation::identity() },
            velocity: Vector6::new(0.0, speed, 0.0, 1.0, 1.0, 1.0),
            acceleration: Vector6::zeros(),
            posture: Vector7::zeros(),
            posture_velocity: Vector7::zeros(),
        }
    }

    /// A force and a torque beyond what was expected.
    fn beyond(force: f64, torque: f64) -> Option<Deviation<f64>> {
        let wrench = Wrench { force: Vector3::new(0.0, 0.0, -force), torque: Vector3::new(torque, 0.0, 0.0) };
        let expected = Wrench { force: Vector3::zeros(), torque: Vector3::zeros() };
        Some(Deviation { expected, expected_gauges: [0.0; 3], wrench, gauges: [0.0; 3] })
    }

    /// True if it carries, and if it does so at rest, at the end of a plan that grips at the first of these
    /// heights and goes through the others at this speed.
    fn after(heights: &[f64], speed: f64, deviation: Option<&Deviation<f64>>) -> (bool, bool) {
        let (mut lift, mut keeps) = (Lift::new(), false);
        for height in heights {
            keeps = lift.step(&plan(*height, speed), true, deviation);
        }
        (lift.carries(), keeps)
    }

    #[test]
    fn what_is_gripped_is_carried_once_the_plan_has_gone_up_with_it_from_its_lowest_place() {
        let as_expected = beyond(0.0, 0.0);
        let raised = |heights: &[f64]| after(heights, 0.0, as_expected.as_ref());
        assert_eq!(raised(&[0.0, RAISED]), (false, false));
        assert_eq!(raised(&[0.0, RAISED.next_up()]), (true, true));
        assert_eq!(raised(&[0.0, -0.05, -0.02]), (true, true));
        assert_eq!(raised(&[0.4]), (false, false), "wherever it began");
        assert_eq!(raised(&[0.0, 0.1, 0.0]), (false, false), "put down again");
    }

    #[test]
    fn a_hand_that_opens_carries_nothing_and_its_next_grip_begins_where_it_closes() {
        let (mut lift, as_expected) = (Lift::new(), beyond(0.0, 0.0));
        let mut step = |height, grips| {
            let keeps = lift.step(&plan(height, 0.0), grips, as_expected.as_ref());
            (lift.carries(), keeps)
        };
        assert_eq!([step(0.0, true), step(0.1, true)], [(false, false), (true, true)]);
        assert_eq!(step(0.1, false), (false, false));
        assert_eq!([step(0.1, true), step(0.11, true)], [(false, false); 2]);
    }

    #[test]
    fn a_load_that_was_not_expected_is_not_carried() {
        let cases = [(0.69, 0.0, true), (0.71, 0.0, false), (0.0, 0.149, true), (0.0, 0.151, false)];
        for (force, torque, carries) in cases.into_iter().chain([(f64::NAN, 0.0, false), (0.0, f64::NAN, false)]) {
            let carried = after(&[0.0, 0.1], 0.0, beyond(force, torque).as_ref());
            assert_eq!(carried, (carries, carries), "{force} {torque}");
        }
        assert_eq!(after(&[0.0, 0.1], 0.0, None), (false, false), "nobody compares");
    }

    #[test]
    fn a_plan_that_moves_is_not_at_rest_with_it() {
        let as_expected = beyond(0.0, 0.0);
        assert_eq!(after(&[0.0, 0.1], RESTING, as_expected.as_ref()), (true, false));
        assert_eq!(after(&[0.0, 0.1], RESTING.next_down(), as_expected.as_ref()), (true, true));
    }
}
