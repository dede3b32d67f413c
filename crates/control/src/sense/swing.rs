//! `Swings`: joints that swing back and forth faster than a person could shake them, and for how long.
//!
//! No limit of speed or position sees such a swing: 0.6 rad/s at 45 Hz is 2 mrad. What a joint does beyond its slow
//! motion is cut into half-waves; one counts if it is high and short enough, and a joint swings, and later shakes, once
//! half-waves that count have followed each other for a while. Any other half-wave begins anew.

use crate::real::Real;
use crate::time::{PERIOD, few_periods};
use crate::units::{JOINTS, Vector7};

/// Smallest height of a half-wave (rad/s). Grasps that succeed ring with up to 0.39 rad/s for a while, loops that are
/// not stable swing with 0.6 to 1.9 rad/s.
const HEIGHT: f64 = 0.4;

/// Longest half-wave: 62 ms, in control periods. That is 8 Hz: nobody shakes the arm faster.
const HALF_WAVE: u8 = few_periods(0.062);

/// Time for which half-waves have to follow each other until the joint swings: 50 ms, in control periods.
const BEGINS: u8 = few_periods(0.05);

/// The same until it shakes: 0.3 s, in control periods. A blow does not ring for so long.
const LASTS: u8 = few_periods(0.3);

/// Cut-off of the slow motion, which is taken off (Hz).
const SLOW: f64 = 4.0;

/// Share of a new velocity in the slow motion, from one control period to the next.
const SHARE: f64 = {
    let turn = core::f64::consts::TAU * SLOW * PERIOD;
    turn / (1.0 + turn)
};

/// One joint.
#[derive(Clone, Copy, Debug)]
struct Swing<R: Real> {
    /// Velocity through a low-pass of first order (rad/s).
    slow: R,
    /// Largest value of the present half-wave, with its sign (rad/s).
    peak: R,
    /// Length of the present half-wave (control periods).
    length: u8,
    /// Length of the half-waves before it that counted (control periods).
    counted: u8,
}

impl<R: Real> Swing<R> {
    /// Takes the velocity of one control period (rad/s).
    fn step(&mut self, velocity: R) {
        self.slow += (velocity - self.slow) * R::constant(SHARE);
        let (swing, zero) = (velocity - self.slow, R::constant(0.0));
        let (up, was_up) = (swing > zero, self.peak > zero);
        if up == was_up {
            self.length = self.length.saturating_add(1);
            if self.length > HALF_WAVE {
                self.counted = 0;
            }
            if up == (swing > self.peak) {
                self.peak = swing;
            }
        } else {
            let height = if was_up { self.peak } else { -self.peak };
            let counts = height >= R::constant(HEIGHT) && self.length <= HALF_WAVE;
            self.counted = if counts { self.counted.saturating_add(self.length) } else { 0 };
            (self.peak, self.length) = (swing, 1);
        }
    }
}

/// All joints.
#[derive(Clone, Debug)]
pub struct Swings<R: Real> {
    joints: [Swing<R>; JOINTS],
    swinging: u8,
    shakes: bool,
}

impl<R: Real> Swings<R> {
    /// Nothing has moved yet.
    pub fn new() -> Self {
        let zero = R::constant(0.0);
        let joints = [Swing { slow: zero, peak: zero, length: 0, counted: 0 }; JOINTS];
        Swings { joints, swinging: 0, shakes: false }
    }

    /// Takes the measured velocities of one control period (rad/s). A joint that is bridged, a bit of `bridged` each,
    /// J1 lowest, waits.
    pub fn step(&mut self, velocity: &Vector7<R>, bridged: u8) {
        (self.swinging, self.shakes) = (0, false);
        for (joint, (swing, velocity)) in self.joints.iter_mut().zip(velocity.iter()).enumerate() {
            if bridged >> joint & 1 == 0 {
                swing.step(*velocity);
            }
            if swing.counted >= BEGINS {
                self.swinging |= 1 << joint;
                self.shakes |= swing.counted >= LASTS;
            }
        }
    }

    /// Joints that swing, one bit each, J1 lowest.
    pub fn swinging(&self) -> u8 {
        self.swinging
    }

    /// True if a joint has swung for so long that it shakes.
    pub fn shakes(&self) -> bool {
        self.shakes
    }
}

impl<R: Real> Default for Swings<R> {
    fn default() -> Self {
        Swings::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Time after which joint `joint` is said to shake at this frequency (Hz) and amplitude (rad/s), on top of this
    /// speed (rad/s); at most 3 s.
    fn found(joint: usize, frequency: f64, amplitude: f64, speed: f64) -> Option<f64> {
        let mut swings = Swings::<f64>::new();
        (0..(3.0 / PERIOD) as usize).map(|at| at as f64 * PERIOD).find(|time| {
            let mut velocity = Vector7::zeros();
            velocity[joint] = speed + amplitude * (core::f64::consts::TAU * frequency * time).sin();
            swings.step(&velocity, 0);
            swings.shakes()
        })
    }

    #[test]
    fn g10_a_joint_that_swings_with_half_a_radian_a_second_is_found_within_half_a_second() {
        for joint in 0..JOINTS {
            for frequency in [10.0, 12.0, 26.0, 45.0, 57.0, 80.0] {
                for speed in [0.0, 1.0, -2.0] {
                    let time = found(joint, frequency, 0.6, speed).expect("it shakes");
                    assert!((0.29..0.5).contains(&time), "J{} {frequency} Hz {speed}: {time} s", joint + 1);
                }
            }
        }
    }

    #[test]
    fn g10_what_is_weak_or_slow_or_ends_soon_is_no_shaking() {
        for (frequency, amplitude) in [(45.0, 0.38), (26.0, 0.38), (5.0, 2.0), (2.0, 4.0)] {
            assert_eq!(found(0, frequency, amplitude, 0.5), None, "{frequency} Hz, {amplitude} rad/s");
        }
        // A blow of 2 rad/s that rings at 30 Hz and fades with a time constant of 80 ms.
        let mut swings = Swings::<f64>::new();
        for at in 0..300 {
            let time = f64::from(at) * PERIOD;
            let ring = 2.0 * (-time / 0.08).exp() * (core::f64::consts::TAU * 30.0 * time).cos();
            swings.step(&Vector7::repeat(ring), 0);
            assert!(!swings.shakes(), "{time} s");
        }
    }

    #[test]
    fn g10_a_joint_that_is_bridged_waits() {
        let mut swings = Swings::<f64>::new();
        let mut shakes = |bridged: u8| {
            (0..300).any(|at| {
                let swing = (core::f64::consts::TAU * 30.0 * f64::from(at) * PERIOD).sin();
                swings.step(&Vector7::repeat(swing), bridged);
                swings.shakes()
            })
        };
        assert!(!shakes(0x7F));
        assert!(shakes(0x3F));
    }

    #[test]
    fn g10_a_joint_that_has_stopped_swinging_swings_no_more() {
        let mut swings = Swings::<f64>::new();
        for at in 0..150 {
            let swing = (core::f64::consts::TAU * 45.0 * f64::from(at) * PERIOD).sin();
            swings.step(&Vector7::repeat(swing), 0);
        }
        assert!(swings.swinging() == 0x7F && swings.shakes());
        for _ in 0..30 {
            swings.step(&Vector7::zeros(), 0);
        }
        assert!(swings.swinging() == 0 && !swings.shakes());
    }
}
