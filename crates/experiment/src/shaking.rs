//! Shaking of the arm: the fast part of its joint speeds, which no movement of an experiment asks for.

use link::Telemetry;

/// Frequency below which speed is movement, Hz.
const CORNER: f64 = 15.0;
/// Time over which the amplitude is averaged, s.
const WINDOW: f64 = 0.2;
/// An arm whose joint speed shakes by this much, and goes on with it, is not stable, rad/s. The compliant arm with its
/// nominal friction shakes by 0.17 to 0.25 in its lift; one that sustains its swing, by 0.6 and more.
pub const UNSTABLE: f64 = 0.3;

/// Shaking of the joint that shakes most.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Shaking {
    /// Largest amplitude of its speed above 15 Hz, in the mean over 0.2 s, rad/s.
    pub largest: f64,
    /// Largest amplitude that it has in 0.2 s and has again 0.2 s later, rad/s: what slips in a hand knocks against the
    /// arm once, and an arm that is not stable goes on.
    pub lasting: f64,
}

impl Shaking {
    /// Of cycles in order and without gaps: what the link has lost looks like a jump. Zero of fewer cycles.
    pub fn of(telemetry: &[Telemetry]) -> Self {
        let speeds: Vec<[f64; 7]> = telemetry.iter().map(|cycle| cycle.dq.map(f64::from)).collect();
        (0..7).map(|joint| fast_part(speeds.iter().map(|speed| speed[joint]))).fold(Shaking::default(), |all, joint| {
            Shaking { largest: all.largest.max(joint.largest), lasting: all.lasting.max(joint.lasting) }
        })
    }
}

/// Amplitudes over a window of what a second-order Butterworth high-pass leaves.
fn fast_part(values: impl Iterator<Item = f64>) -> Shaking {
    let window = (WINDOW * control::RATE).round() as usize;
    let fast: Vec<f64> = high_pass(values, CORNER).map(|value| value * value).collect();
    // A sine of amplitude a has the mean square a^2/2.
    let amplitudes: Vec<f64> =
        fast.windows(window).map(|squares| (2.0 * squares.iter().sum::<f64>() / window as f64).sqrt()).collect();
    let again = amplitudes.iter().zip(amplitudes.iter().skip(2 * window)).map(|(first, again)| first.min(*again));
    Shaking { lasting: again.fold(0.0, f64::max), largest: amplitudes.iter().copied().fold(0.0, f64::max) }
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
        let swing = fast_part(sine(45.0, 0.3, 2.0));
        assert!((swing.largest - 0.3).abs() < 0.01 && (swing.lasting - 0.3).abs() < 0.01, "{swing:?}");
        // It begins with its full slope, which is a small knock.
        let movement = fast_part(sine(1.0, 1.0, 2.0));
        assert!(movement.largest < 0.02, "{movement:?}");
        // Shorter than half the window: a knock.
        assert!(fast_part(sine(45.0, 0.3, 0.05).chain(std::iter::repeat_n(0.0, 300))).largest < 0.16);
        assert_eq!(
            fast_part(std::iter::repeat_n(0.7, 300)),
            Shaking::default(),
            "a constant speed begins without a step"
        );
    }

    /// A flashlight that slid from the palm into the fingers shook J7 by 0.38 rad/s for 0.2 s, and its trial counted as
    /// one of an arm that is not stable. The change that makes it fail: the largest amplitude counts as a lasting one.
    #[test]
    fn a_knock_however_hard_does_not_last_and_a_swing_of_more_than_half_a_second_does() {
        let then_rest = |seconds| sine(25.0, 0.6, seconds).chain(std::iter::repeat_n(0.0, 300));
        let knock = fast_part(then_rest(0.2));
        assert!(knock.largest > 0.5 && knock.lasting < 0.05, "{knock:?}");
        let swing = fast_part(then_rest(0.65));
        assert!(swing.lasting > 0.55, "{swing:?}");
    }
}
