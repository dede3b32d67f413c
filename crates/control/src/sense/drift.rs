//! `Drift`: follows the error that the force sensor comes to after its tare, while the arm touches nothing.
//!
//! A sensor that is wrong by more than the dead band bends the plan as a contact does. In free motion what is measured
//! beyond the expectation is such an error, and it changes slowly; a contact comes within a tenth of a second. So what
//! deviates little is taken for an error of the sensor and goes into the tare, and from the moment on that it deviates
//! by more, nothing is followed until it has been small again for a while.

use crate::real::{Real, sqrt, within};
use crate::time::{PERIOD, periods};
use crate::units::Vector6;

/// Deviation up to which the arm touches nothing: force (N).
const FREE_FORCE: f64 = 0.5;

/// The same of the torque (N m).
const FREE_TORQUE: f64 = 0.05;

/// Time for which it has to be small: 0.2 s, in control periods.
const QUIET: u16 = periods(0.2);

/// Time constant with which the tare follows (s): an error that grows by 0.5 N/s is half of [`FREE_FORCE`] ahead.
const FOLLOWING: f64 = 0.5;

/// Largest error of a force (N) and of a torque (N m) that is followed in one run: what is more is no drift.
const LARGEST: [f64; 6] = [2.0, 2.0, 2.0, 0.2, 0.2, 0.2];

/// Error of the sensor that was followed in one run.
#[derive(Clone, Copy, Debug)]
pub struct Drift<R: Real> {
    /// Control periods for which the deviation has been small.
    quiet: u16,
    /// Sum of what went into the tare, sensor axes.
    followed: Vector6<R>,
}

impl<R: Real> Drift<R> {
    /// Nothing followed yet.
    pub fn new() -> Self {
        Drift { quiet: 0, followed: Vector6::zeros() }
    }

    /// Takes the deviation of this control period (N, N m, sensor axes); returns the change of the tare.
    pub fn step(&mut self, deviation: &Vector6<R>) -> Vector6<R> {
        let size = |a: R, b: R, c: R| sqrt(a * a + b * b + c * c);
        let [fx, fy, fz, nx, ny, nz] = (*deviation).into();
        let free = size(fx, fy, fz) <= R::of(FREE_FORCE) && size(nx, ny, nz) <= R::of(FREE_TORQUE);
        self.quiet = if free { self.quiet.saturating_add(1) } else { 0 };
        if self.quiet < QUIET {
            return Vector6::zeros();
        }
        let mut change = Vector6::zeros();
        for (((change, deviation), followed), largest) in
            change.iter_mut().zip(deviation.iter()).zip(self.followed.iter_mut()).zip(&LARGEST)
        {
            let next = within(*followed + *deviation * R::of(PERIOD / FOLLOWING), R::of(*largest));
            *change = next - *followed;
            *followed = next;
        }
        change
    }
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

    /// What is left of the force along x after so many seconds of `error(t)`, and the largest on the way.
    fn left(seconds: f64, error: impl Fn(f64) -> f64) -> (f64, f64) {
        let (mut drift, mut tare, mut worst) = (Drift::<f64>::new(), 0.0, 0.0);
        let mut deviation = 0.0;
        for tick in 0..(seconds * RATE) as u32 {
            deviation = error(f64::from(tick) * PERIOD) - tare;
            worst = f64::max(worst, f64::abs(deviation));
            tare += drift.step(&Vector6::new(deviation, 0.0, 0.0, 0.0, 0.0, 0.0))[0];
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

    #[test]
    fn nothing_beyond_two_newtons_is_followed() {
        let (end, _) = left(20.0, |t| 0.2 * t);
        assert!(end > 1.9, "{end}");
    }
}
