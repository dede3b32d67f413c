//! `brake`: the coupling that takes from a plan the speed with which it runs into what it touches.
//!
//! Eq (8) bends the plan no faster than its clamp allows: 0.7 m/s^2 at the usual limits, a tenth of a second from 7
//! cm/s to rest. For so long the damping of the arm pushes on, and what stands there topples. A force that nobody
//! expected therefore takes the speed against it, and that alone: along the surface the plan goes on, and what gives
//! way to the force gives way as before.

use nalgebra::Vector3;

use crate::real::{Real, at_most, sqrt};

/// Share of the speed that a force takes (1/(N s)): 4 N take nearly all of it in 20 ms. With more the cables of the
/// wrist swing.
const SENSITIVITY: f64 = 45.0;

/// Force beyond the dead band up to which nothing is braked (N): Eq (8) is for what presses steadily. Without friction
/// a plan that is braked by that as well drives the cable of J1.
const LIGHT: f64 = 0.25;

/// The same of a movement of one second (N), for what an arm beside its plan measures of its own hand: it grows with
/// the square of the rate. Braked by that, a plan makes more of it.
const INERTIA: f64 = 3.0;

/// Largest share (1/s), half in a control period.
const LARGEST: f64 = 150.0;

/// Speed into what is touched that is left to Eq (8) (m/s): a hand that closes, or follows an object, moves so.
const SLOW: f64 = 0.01;

/// Returns `zeta` of the position (m, world axes) that takes from a plan of this velocity (m, world axes, in the scaled
/// system: at `rate`, 1/s, that of the rollout) its part against `force`, what the environment does to the robot beyond
/// what was expected (N, world axes). `None` where the plan does not run against the force.
pub(crate) fn brake<R: Real>(velocity: &Vector3<R>, force: &Vector3<R>, rate: R) -> Option<Vector3<R>> {
    let against = -force.dot(velocity);
    if against > R::constant(0.0) {
        let magnitude = sqrt(force.dot(force));
        let speed = against / magnitude;
        let beyond = magnitude - R::constant(LIGHT) - rate * rate * R::constant(INERTIA);
        if speed * rate > R::constant(SLOW) && beyond > R::constant(0.0) {
            let share = at_most(beyond * R::constant(SENSITIVITY), R::constant(LARGEST));
            return Some(force * (speed * share / (magnitude * rate)));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rate of a movement of 12 s (1/s).
    const RATE: f64 = 1.0 / 12.0;

    fn braked(velocity: [f64; 3], force: [f64; 3]) -> Option<[f64; 3]> {
        brake(&(Vector3::from(velocity) / RATE), &Vector3::from(force), RATE).map(Into::into)
    }

    #[test]
    fn the_speed_against_a_force_is_taken_and_no_other() {
        // 2 N along -x against 7 cm/s: 78/s of it, in the scaled system.
        let [x, y, z] = braked([0.07, 0.05, -0.02], [-2.0, 0.0, 0.0]).expect("it runs into something");
        assert!((x * RATE * RATE + 0.07 * 77.8125).abs() < 1e-12, "{x}");
        assert_eq!((y, z), (0.0, 0.0));
    }

    #[test]
    fn what_gives_way_goes_along_or_creeps_is_left_alone() {
        assert_eq!(braked([0.07, 0.0, 0.0], [2.0, 0.0, 0.0]), None, "it gives way");
        assert_eq!(braked([0.0, 0.07, 0.0], [2.0, 0.0, 0.0]), None, "it goes along");
        assert_eq!(braked([0.009, 0.0, 0.0], [-2.0, 0.0, 0.0]), None, "it creeps");
        assert_eq!(braked([0.07, 0.0, 0.0], [-0.25, 0.0, 0.0]), None, "it is touched lightly");
        assert_eq!(braked([0.07, 0.0, 0.0], [0.0; 3]), None, "nothing is there");
        assert_eq!(braked([0.0; 3], [-2.0, 0.0, 0.0]), None, "it rests");
    }

    #[test]
    fn a_creep_of_a_centimetre_a_second_is_left_alone_and_one_bit_more_is_not() {
        let against = |speed| brake(&Vector3::new(0.0, speed, 0.0), &Vector3::new(0.0, -4.0, 0.0), 1.0);
        assert_eq!(against(SLOW), None);
        assert!(against(SLOW.next_up()).is_some());
    }

    #[test]
    fn a_fast_plan_is_not_braked_by_the_inertia_of_its_hand() {
        let within = |seconds: f64, force: f64| {
            brake(&Vector3::new(0.0, 0.5 * seconds, 0.0), &Vector3::new(0.0, -force, 0.0), 1.0 / seconds).is_some()
        };
        assert!(!within(1.0, LIGHT + 0.99 * INERTIA) && within(1.0, LIGHT + 1.01 * INERTIA));
        assert!(!within(2.0, LIGHT + 0.24 * INERTIA) && within(2.0, LIGHT + 0.26 * INERTIA));
    }

    #[test]
    fn no_force_takes_more_than_half_in_a_control_period_and_no_number_takes_nothing() {
        let [x, ..] = braked([0.07, 0.0, 0.0], [-1e3, 0.0, 0.0]).expect("it runs into something");
        assert!((x * RATE * RATE + 0.07 * LARGEST).abs() < 1e-12, "{x}");
        assert_eq!(braked([0.07, 0.0, 0.0], [f64::NAN, 0.0, 0.0]), None);
        assert_eq!(braked([f64::NAN, 0.0, 0.0], [-1.0, 0.0, 0.0]), None);
    }
}
