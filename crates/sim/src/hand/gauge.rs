//! The strain gauge of a finger: torque about the distal joint to 12-bit counts.
//!
//! Barrett's nominal curve (docs/arm-model.md), counts x to N m: `tau = 2.754e-10 x^3 - 1.708e-6 x^2 + 0.003764 x -
//! 2.85`. A gauge here follows it shifted to its own zero: it reads `x(tau + tau(zero))`. Counts **rise** as the finger
//! presses on something while closing; that is the direction in which HSG stops a closing finger. A low-pass stands for
//! the amplifier. The curve is written down again here instead of taken from `puck::gauge`: a wrong number there must
//! not cancel itself out.

use crate::noise::Noise;
use crate::time::STEP_SECONDS;

/// Coefficients of the curve, of x^0 to x^3.
const CURVE: [f64; 4] = [-2.85, 0.003764, -1.708e-6, 2.754e-10];

/// Largest reading of the 12-bit converter.
const FULL_SCALE: f64 = 4095.0;

/// Time constant of the amplifier, s. Assumed.
const TIME_CONSTANT: f64 = 0.002;

/// Torque of the nominal curve at this reading, N m.
pub(crate) fn torque(counts: f64) -> f64 {
    CURVE.iter().rev().fold(0.0, |sum, coefficient| sum * counts + coefficient)
}

/// The reading at this torque of the nominal curve, which rises everywhere; not limited to the converter's range.
fn counts(wanted: f64) -> f64 {
    let [_, linear, square, cube] = CURVE;
    let mut x = 2000.0;
    // The slope is never below 0.00023 N m per count, so that Newton's steps are bounded; from the middle seven are
    // plenty.
    for _ in 0..12 {
        let slope = linear + x * (2.0 * square + x * 3.0 * cube);
        let step = (torque(x) - wanted) / slope;
        x = (x - step).clamp(-FULL_SCALE, 2.0 * FULL_SCALE);
        if step.abs() < 0.01 {
            break;
        }
    }
    x
}

/// One gauge.
#[derive(Clone, Debug)]
pub(crate) struct Gauge {
    zero_torque: f64,
    sigma: f64,
    filtered: f64,
    noise: Noise,
}

impl Gauge {
    /// A gauge that reads `zero` counts without load, with noise of `sigma` counts.
    pub(crate) fn new(zero: f64, sigma: f64, noise: Noise) -> Self {
        Self { zero_torque: torque(zero), sigma, filtered: 0.0, noise }
    }

    /// One physics step under this torque of the drive on the outer link, N m, positive closing.
    pub(crate) fn feel(&mut self, load: f64) {
        self.filtered += (load - self.filtered) * STEP_SECONDS / (TIME_CONSTANT + STEP_SECONDS);
    }

    /// The converter's value now.
    pub(crate) fn read(&mut self) -> u16 {
        let ideal = counts(self.filtered + self.zero_torque);
        (ideal + self.noise.gaussian(self.sigma) + 0.5).clamp(0.0, FULL_SCALE) as u16
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_is_barretts() {
        let published = [
            (667.0, -1.018),
            (1000.0, -0.519),
            (1500.0, -0.118),
            (2000.0, 0.049),
            (2048.0, 0.061),
            (2500.0, 0.188),
            (3000.0, 0.506),
            (3460.0, 1.134),
        ];
        for (reading, expected) in published {
            assert!((torque(reading) - expected).abs() < 6e-4, "{reading}: {}", torque(reading));
            assert!((counts(torque(reading)) - reading).abs() < 0.1);
        }
    }

    #[test]
    fn the_inverse_holds_over_the_whole_range() {
        for step in 0..=4095 {
            let reading = f64::from(step);
            assert!((counts(torque(reading)) - reading).abs() < 0.1, "{reading}: {}", counts(torque(reading)));
        }
    }

    #[test]
    fn readings_rise_with_a_closing_grip_and_stay_within_twelve_bits() {
        let read = |load: f64| {
            let mut gauge = Gauge::new(1980.0, 0.0, Noise::new(1, 1));
            (0..100).for_each(|_| gauge.feel(load));
            gauge.read()
        };
        assert_eq!(read(0.0), 1980);
        assert!(read(0.3) > 2500 && read(-0.3) < 1400);
        assert_eq!((read(50.0), read(-50.0)), (4095, 0));
    }
}
