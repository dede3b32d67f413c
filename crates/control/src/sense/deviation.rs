//! `Deviation`: the difference of the measured sensor values from the expected ones, the one input of Eqs (8), (12)
//! and (14).

use nalgebra::Vector3;

use crate::real::{Real, sqrt};
use crate::sense::filter::share;
use crate::units::{Vector6, Wrench};

/// Sensor values: force x, y, z (N, world axes), torque x, y, z (N m, tool axes at the grasp point), torque of the
/// environment on finger F1, F2, F3 (N m).
pub const SENSORS: usize = 9;

/// Force (N) that counts as none: the bias and hysteresis of the sensor that a tare leaves would otherwise move the
/// plan by centimetres.
pub const FORCE_DEAD_BAND: f64 = 0.3;

/// Torque (N m) that counts as none.
pub const TORQUE_DEAD_BAND: f64 = 0.02;

/// Cut-off of the filter of first order between the deviation and the plan (Hz). The plan's acceleration is fed
/// forward, the hand's inertia acts on the wrist sensor, and the sum bends the plan again: with K1/K = 0.8 m/N that
/// loop has a gain of 3 above its resonance. A filter of second order and 8 Hz turns its phase by more; see
/// `cargo xtask margins`.
pub const FEEDBACK_CUT_OFF: f64 = 4.0;

/// The same of a hand that grips (Hz): what it holds swings with it and adds to the mass that the wrist sensor feels.
/// At [`FEEDBACK_CUT_OFF`] the plan, the hand and an object of 0.9 kg swing at 12 Hz.
pub const GRIPPING_CUT_OFF: f64 = 1.0;

/// The expected sensor values of one tick, and the deviation of the measured ones. `F` is what the environment does to
/// the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deviation<R: Real> {
    /// Expected wrench at the grasp point.
    pub expected: Wrench<R>,
    /// Expected torque on F1, F2, F3 (N m).
    pub expected_gauges: [R; 3],
    /// `F - F_expected` beyond the dead band.
    pub wrench: Wrench<R>,
    /// The same of the fingers, without a dead band; zero where no gauge is measured.
    pub gauges: [R; 3],
}

impl<R: Real> Deviation<R> {
    /// From the expected sensor values (force world axes, torque tool axes, gauges) and the measured ones.
    pub fn new(expected: &[R; SENSORS], measured: &Wrench<R>, measured_gauges: Option<&[R; 3]>) -> Self {
        let [fx, fy, fz, nx, ny, nz, expected_gauges @ ..] = *expected;
        let expected = Wrench { force: Vector3::new(fx, fy, fz), torque: Vector3::new(nx, ny, nz) };
        let wrench = Wrench {
            force: shrunk(measured.force - expected.force, R::constant(FORCE_DEAD_BAND)),
            torque: shrunk(measured.torque - expected.torque, R::constant(TORQUE_DEAD_BAND)),
        };
        let gauges = match measured_gauges {
            Some(measured) => core::array::from_fn(|finger| measured[finger] - expected_gauges[finger]),
            None => [R::constant(0.0); 3],
        };
        Deviation { expected, expected_gauges, wrench, gauges }
    }

    /// The same with the smoothed deviation of the wrench.
    pub fn smoothed(&self, wrench: &SmoothedWrench<R>) -> Self {
        Deviation { wrench: wrench.beyond_dead_band(), ..*self }
    }

    /// The error of Eq (8): the deviation of each sensor beyond the dead band.
    pub fn error(&self) -> [R; SENSORS] {
        let (Wrench { force, torque }, [f1, f2, f3]) = (&self.wrench, self.gauges);
        [force.x, force.y, force.z, torque.x, torque.y, torque.z, f1, f2, f3]
    }
}

/// The deviation of the wrench through a low-pass of [`FEEDBACK_CUT_OFF`] or [`GRIPPING_CUT_OFF`], before its dead
/// band.
#[derive(Clone, Debug)]
pub struct SmoothedWrench<R: Real> {
    value: Vector6<R>,
}

impl<R: Real> SmoothedWrench<R> {
    /// No deviation so far.
    pub fn new() -> Self {
        SmoothedWrench { value: Vector6::zeros() }
    }

    /// Takes the measured and the expected wrench of this control period.
    pub fn step(&mut self, measured: &Wrench<R>, expected: &Wrench<R>, gripping: bool) {
        let (force, torque) = (measured.force - expected.force, measured.torque - expected.torque);
        let now = Vector6::new(force.x, force.y, force.z, torque.x, torque.y, torque.z);
        let share = const { [share(FEEDBACK_CUT_OFF), share(GRIPPING_CUT_OFF)] };
        self.value += (now - self.value) * R::constant(share[usize::from(gripping)]);
    }

    /// The part of the filtered deviation beyond the dead bands.
    fn beyond_dead_band(&self) -> Wrench<R> {
        let smoothed = &self.value;
        let force = Vector3::new(smoothed[0], smoothed[1], smoothed[2]);
        let torque = Vector3::new(smoothed[3], smoothed[4], smoothed[5]);
        Wrench {
            force: shrunk(force, R::constant(FORCE_DEAD_BAND)),
            torque: shrunk(torque, R::constant(TORQUE_DEAD_BAND)),
        }
    }
}

impl<R: Real> Default for SmoothedWrench<R> {
    fn default() -> Self {
        SmoothedWrench::new()
    }
}

/// The vector made shorter by `band`, without a step; nothing if it is not longer.
fn shrunk<R: Real>(vector: Vector3<R>, band: R) -> Vector3<R> {
    let length = sqrt(vector.dot(&vector));
    if length > band { vector * ((length - band) / length) } else { Vector3::zeros() }
}
