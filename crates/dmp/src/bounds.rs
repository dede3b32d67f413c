//! Bounds: what no movement of a real robot needs more of.
//!
//! A number beyond them is a typing error, a wrong unit or a damaged file. Refused at load it costs a message;
//! taken, it is a plan that leaves the room, or overflows to infinity and then to NaN in f32. They are wide on
//! purpose: the limits of one particular arm belong to whoever knows it.

use crate::Scalar;

/// Largest value of a row (m, rad): 20 m is no arm's reach, 20 rad are three turns of a joint.
pub const LARGEST_VALUE: f64 = 20.0;

/// Largest velocity of a row (m/s, rad/s). The fastest joint of a Barrett WAM turns at 38 rad/s without load; the
/// tools of the fastest parallel robots move at 15 m/s.
pub const LARGEST_SPEED: f64 = 50.0;

/// Largest acceleration of a row (m/s^2, rad/s^2). The fastest parallel robots reach 15 g = 150 m/s^2; the wrist of a
/// Barrett WAM with its 2 N m some 700 rad/s^2.
pub const LARGEST_ACCELERATION: f64 = 1000.0;

/// Longest movement (s).
pub const LONGEST_DURATION: f64 = 3600.0;

/// Shortest control period (s): no controller runs at more than 1 MHz. A plan for 1e-22 s is stable, but its
/// acceleration, some `1/dt^2`, is infinite in f32.
pub const SHORTEST_CONTROL_PERIOD: f64 = 1e-6;

/// Smallest stiffness and damping. At K = 0.1 a row needs twenty times the duration of its movement for one swing.
pub const SMALLEST_GAIN: f64 = 0.1;

/// Largest stiffness and damping.
pub const LARGEST_GAIN: f64 = 1e6;

/// Largest displacement of a position by a coupling (m). The method's authors bend their plans by up to 0.23 m.
pub const LARGEST_DISPLACEMENT: f64 = 2.0;

/// Largest displacement of a point row by a coupling (rad): half a turn, as for the orientation.
pub const LARGEST_POINT_DISPLACEMENT: f64 = core::f64::consts::PI;

/// Largest value of a sensor (N, N m, rad): the strongest six-axis sensors measure 40 kN.
pub const LARGEST_SENSOR_VALUE: f64 = 1e5;

/// Largest gain `K1` or weight `K2` of the coupling. At K = 1e6 and 2 N for a displacement of 2 m `K1` is 1e6.
pub const LARGEST_COUPLING_GAIN: f64 = 1e6;

/// Smallest spread of sensor statistics (N, N m, rad): a thousandth of what the finest of these sensors resolves. The
/// distance from the mean is divided by it.
pub const SMALLEST_SPREAD: f64 = 1e-6;

/// Fastest change of speed (1/s): from rest to the taught speed within 0.1 ms. Faster is no slewing.
pub const FASTEST_SLEW: f64 = 1e4;

/// By how much weights of neighbouring kernels may exceed the forcing term that they add up to. Where kernels overlap
/// widely a fit to noise gives neighbours large weights of opposite sign: 440 times the bound was seen with 200
/// kernels of activation 0.9 and 0.2 mm of noise that nobody had filtered. Much more is lost to rounding in single
/// precision.
pub const LARGEST_CANCELLATION: f64 = 1000.0;

/// Place of the first value whose magnitude is not at most `largest`; a NaN is such a value.
pub(crate) fn first_beyond<T: Scalar>(values: &[T], largest: T) -> Option<usize> {
    values.iter().position(|value| !(value.abs() <= largest))
}
