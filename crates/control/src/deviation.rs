//! `Deviation`: how what is felt differs from what is expected, the one input of Eq (8), Eq (12) and Eq (14).

use dmp::SENSORS;
use nalgebra::Vector3;

use crate::real::Real;
use crate::units::Wrench;

/// Force (N) that counts as none: the bias and hysteresis of the sensor that a tare leaves would otherwise move the plan by
/// centimetres.
pub const FORCE_DEAD_BAND: f64 = 0.3;

/// Torque (N m) that counts as none.
pub const TORQUE_DEAD_BAND: f64 = 0.02;

/// What is expected at one tick, and what is felt beyond it. `F` is what the environment does to the robot.
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
    /// From the expected sensor values (force world axes, torque tool axes, gauges) and the felt ones.
    pub fn new(expected: &[R; SENSORS], felt: &Wrench<R>, felt_gauges: Option<&[R; 3]>) -> Self {
        let [fx, fy, fz, nx, ny, nz, expected_gauges @ ..] = *expected;
        let expected = Wrench { force: Vector3::new(fx, fy, fz), torque: Vector3::new(nx, ny, nz) };
        let wrench = Wrench {
            force: shrunk(felt.force - expected.force, R::of(FORCE_DEAD_BAND)),
            torque: shrunk(felt.torque - expected.torque, R::of(TORQUE_DEAD_BAND)),
        };
        let gauges = match felt_gauges {
            Some(felt) => core::array::from_fn(|finger| felt[finger] - expected_gauges[finger]),
            None => [R::of(0.0); 3],
        };
        Deviation { expected, expected_gauges, wrench, gauges }
    }

    /// The sensor values that Eq (8) is to see: what is expected, plus the deviation beyond the dead band.
    pub fn sensors(&self) -> [R; SENSORS] {
        let force = self.expected.force + self.wrench.force;
        let torque = self.expected.torque + self.wrench.torque;
        let [f1, f2, f3]: [R; 3] = core::array::from_fn(|finger| self.expected_gauges[finger] + self.gauges[finger]);
        [force.x, force.y, force.z, torque.x, torque.y, torque.z, f1, f2, f3]
    }
}

/// The vector made shorter by `band`, without a step; nothing if it is not longer.
fn shrunk<R: Real>(vector: Vector3<R>, band: R) -> Vector3<R> {
    let length = vector.dot(&vector).square_root();
    if length > band { vector * ((length - band) / length) } else { Vector3::zeros() }
}
