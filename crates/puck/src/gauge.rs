//! The strain gauges in the fingers: counts to torque about the outer joint, and back for devices.
//!
//! Barrett's nominal cubic. A finger's own zero lies some ten counts away from the curve's, so only differences from an
//! unloaded reading mean anything: `torque(counts) - torque(unloaded)`.

use crate::units::Real;

/// Reading of an unloaded gauge, about.
pub const UNLOADED: u16 = 2000;
/// Largest reading of a gauge.
pub const LARGEST: u16 = 4095;
/// Outside this band the finger's own firmware drives away from the load, about 1 N m.
pub const SELF_PRESERVATION: (u16, u16) = (667, 3460);

/// Coefficients of the cubic, highest power first.
const CURVE: [f64; 4] = [2.754e-10, -1.708e-6, 0.003764, -2.85];

/// Halvings that find a count: the interval of 4096 counts ends below 1e-6 of one.
const HALVINGS: usize = 32;

/// The torque that the finger exerts about its outer joint (N m), positive when it presses in closing, as the curve
/// gives it for these counts (cut to 0..=4095). It grows with the counts everywhere.
pub fn torque<R: Real>(counts: R) -> R {
    let (zero, largest) = (R::from_f64(0.0), R::from_i32(LARGEST as i32));
    // A NaN ends at zero.
    let kept = if counts > largest {
        largest
    } else if counts > zero {
        counts
    } else {
        zero
    };
    let mut value = zero;
    for coefficient in CURVE {
        value = value * kept + R::from_f64(coefficient);
    }
    value
}

/// Device side: the counts at which [`torque`] is `torque` (N m), 0 to 4095.
#[must_use]
pub fn counts(torque_wanted: f64) -> f64 {
    let (mut low, mut high) = (0.0, LARGEST as f64);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if torque(middle) < torque_wanted { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_goes_through_the_published_points_and_only_rises() {
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
            let found: f64 = torque(reading);
            assert!((found - expected).abs() < 6e-4, "{reading}: {found}");
            assert!((counts(found) - reading).abs() < 1e-3);
        }
        for reading in 0..i32::from(LARGEST) {
            assert!(torque(f64::from(reading)) < torque(f64::from(reading + 1)));
        }
        assert_eq!(torque(f64::NAN), -2.85);
        for (beyond, end) in [(4096.0, 4095.0), (1e9, 4095.0), (-1.0, 0.0), (f64::NEG_INFINITY, 0.0)] {
            assert_eq!(torque(beyond), torque(end), "{beyond}");
        }
    }
}
