//! `Drift`: follows the error that the force sensor comes to after its tare, while the arm touches nothing.
//!
//! A sensor that is wrong by more than the dead band bends the plan as a contact does. In free motion what is measured
//! beyond the expectation is such an error, and it changes slowly; a contact comes within a tenth of a second. So what
//! deviates little, and came slowly, is taken for an error of the sensor and goes into the tare. From the moment on
//! that it deviates by more, or changes fast, nothing is followed until it has been small again for a while; or until
//! the movement has ended, because a sensor that is a little off is never that small again.

use crate::real::{Real, sqrt, within};
use crate::time::{PERIOD, periods};
use crate::units::Vector6;

/// Deviation up to which the arm touches nothing: force (N).
const FREE_FORCE: f64 = 0.5;

/// The same of the torque (N m).
const FREE_TORQUE: f64 = 0.05;

/// The same where nothing is expected. The tare stays as it is then, and the hand, whose centre moves with its fingers,
/// turns on the way: 8 mm beside the model's that is 0.12 N m, and no touch.
const FREE_TORQUE_UNEXPECTED: f64 = 0.2;

/// Change of the force (N) within [`TOUCH`] that is a touch, however small the deviation is. Between 0.12 and 0.4 N it
/// makes no difference to the grasps; from 0.6 N on light things are toppled.
const TOUCH_FORCE: f64 = 0.25;

/// The same of the torque (N m). The uneven motion of the arm itself makes 0.02 N m.
const TOUCH_TORQUE: f64 = 0.05;

/// Time within which a touch comes, and an error of the sensor does not (s).
const TOUCH: f64 = 0.1;

/// Deviation below which what was touched is gone: force (N).
const GONE_FORCE: f64 = 0.1;

/// The same of the torque (N m).
const GONE_TORQUE: f64 = 0.02;

/// Time for which it has to be small: 0.2 s, in control periods.
const QUIET: u16 = periods(0.2);

/// Time constant with which the tare follows (s): an error that grows by 0.5 N/s is half of [`FREE_FORCE`] ahead.
const FOLLOWING: f64 = 0.5;

/// Largest error of a force (N) and of a torque (N m) that is followed in one run: what is more is no drift.
const LARGEST: [f64; 6] = [2.0, 2.0, 2.0, 0.2, 0.2, 0.2];

/// Time for which an arm that begins a run has to be free before a touch is one: it leaves the posture that was held,
/// and its hand swings. 1 s, in control periods.
const SETTLING: u16 = periods(1.0);

/// Error of the sensor that was followed in one run.
#[derive(Clone, Copy, Debug)]
pub struct Drift<R: Real> {
    /// Control periods for which the deviation has been small.
    quiet: u16,
    /// Control periods in which the arm still settles.
    settling: u16,
    /// Sum of what went into the tare, sensor axes.
    followed: Vector6<R>,
    /// The deviation through a low-pass of [`TOUCH`]; nothing yet in the first control period.
    mean: Option<Vector6<R>>,
    /// True from a fast change of the deviation on, until it has been small for a while.
    touched: bool,
}

impl<R: Real> Drift<R> {
    /// Nothing followed yet.
    pub fn new() -> Self {
        Drift { quiet: 0, settling: SETTLING, followed: Vector6::zeros(), mean: None, touched: false }
    }

    /// True if nothing has been touched for a while.
    pub fn is_free(&self) -> bool {
        self.quiet >= QUIET
    }

    /// True from a touch on, until the deviation has been small for a while.
    pub fn is_touched(&self) -> bool {
        self.touched
    }

    /// Takes the deviation of this control period (N, N m, sensor axes), and with it whether something is touched. Once
    /// the movement `has_ended`, what is left of a touch is an error of the sensor, as far as one goes; `expects` if
    /// the run has an expected wrench.
    pub fn feel(&mut self, deviation: &Vector6<R>, has_ended: bool, expects: bool) {
        // What deviates when the run begins has not come fast.
        let mean = self.mean.get_or_insert(*deviation);
        let change = deviation - *mean;
        *mean += change * R::constant(PERIOD / TOUCH);
        let touches = !is_within(&change, TOUCH_FORCE, TOUCH_TORQUE);
        self.touched |= touches && self.settling == 0;
        let is_left = self.touched && !has_ended;
        let free_torque = if expects { FREE_TORQUE } else { FREE_TORQUE_UNEXPECTED };
        let (force, torque) = if is_left { (GONE_FORCE, GONE_TORQUE) } else { (FREE_FORCE, free_torque) };
        let free = !touches && is_within(deviation, force, torque);
        self.quiet = if free { self.quiet.saturating_add(1) } else { 0 };
        if self.is_free() {
            self.touched = false;
            self.settling = self.settling.saturating_sub(1);
        }
    }

    /// Takes a deviation in free motion for an error of the sensor, as far as one goes; returns the change of the tare.
    pub fn follow(&mut self, deviation: &Vector6<R>) -> Vector6<R> {
        let mut change = Vector6::zeros();
        for (((change, deviation), followed), largest) in
            change.iter_mut().zip(deviation.iter()).zip(self.followed.iter_mut()).zip(&LARGEST)
        {
            let next = within(*followed + *deviation * R::constant(PERIOD / FOLLOWING), R::constant(*largest));
            *change = next - *followed;
            *followed = next;
        }
        change
    }
}

/// True if neither the force nor the torque of this wrench is larger.
fn is_within<R: Real>(wrench: &Vector6<R>, force: f64, torque: f64) -> bool {
    let [fx, fy, fz, nx, ny, nz] = (*wrench).into();
    let size = |a: R, b: R, c: R| sqrt(a * a + b * b + c * c);
    size(fx, fy, fz) <= R::constant(force) && size(nx, ny, nz) <= R::constant(torque)
}

impl<R: Real> Default for Drift<R> {
    fn default() -> Self {
        Drift::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::RATE;

    /// Deviation of the force along x after so many seconds of `error(t)`, and the largest on the way.
    fn left(seconds: f64, error: impl Fn(f64) -> f64) -> (f64, f64) {
        let (mut drift, mut tare, mut worst) = (Drift::<f64>::new(), 0.0, 0.0);
        let mut deviation = 0.0;
        for tick in 0..(seconds * RATE) as u32 {
            deviation = error(f64::from(tick) * PERIOD) - tare;
            worst = f64::max(worst, f64::abs(deviation));
            let sample = Vector6::new(deviation, 0.0, 0.0, 0.0, 0.0, 0.0);
            drift.feel(&sample, false, true);
            tare += if drift.is_free() { drift.follow(&sample)[0] } else { 0.0 };
        }
        (deviation, worst)
    }

    #[test]
    fn an_error_that_creeps_up_by_one_newton_in_two_seconds_is_followed() {
        let (end, worst) = left(5.0, |t| f64::min(0.5 * t, 1.0));
        assert!(end.abs() < 0.01 && worst < 0.3, "{end} {worst}");
    }

    #[test]
    fn a_contact_that_grows_by_four_newtons_a_second_keeps_its_force() {
        let (end, _) = left(5.0, |t| if t < 2.0 { 0.0 } else { f64::min(4.0 * (t - 2.0), 2.0) });
        assert!(end > 1.9, "{end}");
    }

    /// The change that makes it fail: no [`TOUCH_FORCE`], as it was.
    #[test]
    fn a_light_touch_keeps_its_force_for_as_long_as_it_lasts() {
        for newtons in [0.35, 0.45] {
            let (end, _) = left(6.0, |t| f64::clamp(10.0 * (t - 2.0), 0.0, newtons));
            assert!(end > 0.95 * newtons, "{end} of {newtons}");
        }
    }

    /// The change that makes it fail: `touched` is never reset.
    #[test]
    fn once_the_touch_is_gone_an_error_is_followed_again() {
        let touch = |t: f64| if (2.0..3.0).contains(&t) { 0.45 } else { 0.0 };
        let (end, _) = left(8.0, |t| touch(t) + f64::clamp(0.4 * (t - 4.0), 0.0, 1.0));
        assert!(end.abs() < 0.02, "{end}");
    }

    /// The change that makes it fail: no [`SETTLING`], as it was. An arm without friction sags as its run begins.
    #[test]
    fn an_arm_that_swings_as_its_run_begins_has_touched_nothing() {
        let swing = |t: f64| if t < 0.8 { 0.4 * f64::sin(core::f64::consts::TAU * 3.0 * t) } else { 0.0 };
        let (end, _) = left(5.0, |t| swing(t) + f64::min(t, 0.25));
        assert!(end.abs() < 0.01, "{end}");
    }

    #[test]
    fn nothing_beyond_two_newtons_is_followed() {
        let (end, _) = left(20.0, |t| 0.2 * t);
        assert!(end > 1.9, "{end}");
    }

    #[test]
    fn an_error_that_comes_within_a_third_of_a_second_is_no_touch() {
        let (end, _) = left(6.0, |t| f64::clamp(1.5 * (t - 2.0), 0.0, 0.45));
        assert!(end.abs() < 0.02, "{end}");
    }

    /// Number of the cycle in which a deviation that is there from the beginning is first followed.
    fn followed_in(deviation: [f64; 6]) -> Option<u16> {
        let mut drift = Drift::<f64>::new();
        let sample = Vector6::from(deviation);
        (1..=2 * QUIET).find(|_| {
            drift.feel(&sample, false, true);
            drift.is_free() && drift.follow(&sample) != Vector6::zeros()
        })
    }

    #[test]
    fn a_deviation_is_followed_once_it_has_been_small_for_the_whole_quiet_time() {
        assert_eq!(followed_in([0.3, 0.0, 0.0, 0.0, 0.0, 0.0]), Some(QUIET));
    }

    #[test]
    fn a_deviation_is_as_large_as_its_force_or_its_torque_is_long() {
        for (first, size) in [(0, FREE_FORCE), (3, FREE_TORQUE)] {
            for axis in 0..3 {
                let along = |parts: [f64; 3]| {
                    let mut deviation = [0.0; 6];
                    for (other, part) in parts.into_iter().enumerate() {
                        deviation[first + (axis + other) % 3] = part * size;
                    }
                    followed_in(deviation).is_some()
                };
                assert!(along([0.9, 0.0, 0.0]) && !along([1.1, 0.0, 0.0]), "{first} {axis}");
                assert!(along([0.6, 0.6, 0.0]) && !along([0.8, 0.8, 0.0]), "{first} {axis}");
            }
        }
    }
}
