//! Shaking of the arm: the fast part of its joint speeds, which no movement of an experiment asks for.

use link::Telemetry;

/// Frequency below which speed is movement, Hz.
const CORNER: f64 = 15.0;
/// Time over which the amplitude is averaged, s.
const WINDOW: f64 = 0.2;
/// An arm whose joint speed shakes by this much is not stable, rad/s. The compliant arm with its nominal friction
/// shakes by 0.17 to 0.25 in its lift; one that sustains its swing, by 0.6 and more.
pub const UNSTABLE: f64 = 0.3;

/// Largest amplitude of any joint's speed above 15 Hz, in the mean over 0.2 s, rad/s. Zero of fewer cycles.
///
/// `telemetry` is in order and without gaps: what the link has lost looks like a jump.
pub fn amplitude(telemetry: &[Telemetry]) -> f64 {
    let speeds: Vec<[f64; 7]> = telemetry.iter().map(|cycle| cycle.dq.map(f64::from)).collect();
    (0..7).map(|joint| fast_part(speeds.iter().map(|speed| speed[joint]))).fold(0.0, f64::max)
}

/// Largest amplitude over a window of what a second-order Butterworth high-pass leaves.
fn fast_part(values: impl Iterator<Item = f64>) -> f64 {
    let window = (WINDOW * control::RATE).round() as usize;
    let fast: Vec<f64> = high_pass(values, CORNER).map(|value| value * value).collect();
    // A sine of amplitude a has the mean square a^2/2.
    let largest = fast.windows(window).map(|squares| squares.iter().sum::<f64>() / window as f64).fold(0.0, f64::max);
    (2.0 * largest).sqrt()
}

/// Bilinear transform of the second-order Butterworth high-pass of `corner` (Hz), at rest at the first value.
pub(super) fn high_pass(mut values: impl Iterator<Item = f64>, corner: f64) -> impl Iterator<Item = f64> {
    let warped = (std::f64::consts::PI * corner / control::RATE).tan();
    let norm = 1.0 / (1.0 + std::f64::consts::SQRT_2 * warped + warped * warped);
    let a1 = 2.0 * (warped * warped - 1.0) * norm;
    let a2 = (1.0 - std::f64::consts::SQRT_2 * warped + warped * warped) * norm;
    let first = values.next().unwrap_or(0.0);
    let (mut x, mut y) = ([first; 2], [0.0; 2]);
    values.map(move |value| {
        let out = norm * (value - 2.0 * x[0] + x[1]) - a1 * y[0] - a2 * y[1];
        (x, y) = ([value, x[0]], [out, y[0]]);
        out
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sine(hertz: f64, amplitude: f64, seconds: f64) -> impl Iterator<Item = f64> {
        let rate = control::RATE;
        (0..(seconds * rate) as usize).map(move |k| amplitude * (std::f64::consts::TAU * hertz * k as f64 / rate).sin())
    }

    #[test]
    fn a_swing_of_the_cables_is_shaking_and_a_movement_is_none() {
        assert!((fast_part(sine(45.0, 0.3, 2.0)) - 0.3).abs() < 0.01, "{}", fast_part(sine(45.0, 0.3, 2.0)));
        // It begins with its full slope, which is a small knock.
        assert!(fast_part(sine(1.0, 1.0, 2.0)) < 0.02, "{}", fast_part(sine(1.0, 1.0, 2.0)));
        // Shorter than half the window: a knock.
        assert!(fast_part(sine(45.0, 0.3, 0.05).chain(std::iter::repeat_n(0.0, 300))) < 0.16);
        assert_eq!(fast_part(std::iter::repeat_n(0.7, 300)), 0.0, "a constant speed begins without a step");
    }
}
