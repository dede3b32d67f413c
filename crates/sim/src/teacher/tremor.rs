//! The involuntary part of a teacher's pull: seeded noise, shaped.

use crate::{Noise, STEP_SECONDS};
use std::f64::consts::PI;

/// Physiological tremor: white noise through two equal band-passes in a row, together 8 to 12 Hz, with unit power.
#[derive(Clone, Debug)]
pub(super) struct Tremor {
    gain: f64,
    stages: [BandPass; 2],
}

impl Tremor {
    const CENTRE_HERTZ: f64 = 10.0;
    /// Width of one stage; two in a row leave 0.64 of it (4 Hz) between the points of half power.
    const WIDTH_HERTZ: f64 = 6.2;

    pub(super) fn new() -> Self {
        let stages = [BandPass::new(Self::CENTRE_HERTZ, Self::WIDTH_HERTZ); 2];
        let mut probe = stages;
        // The power of the output to unit white noise is the energy of the impulse response; 20 000 samples are its
        // all.
        let energy: f64 = (0..20_000).map(|n| filter(&mut probe, if n == 0 { 1.0 } else { 0.0 }).powi(2)).sum();
        Self { gain: 1.0 / energy.sqrt(), stages }
    }

    /// The next sample, one physics step after the last; unit root mean square.
    pub(super) fn next(&mut self, noise: &mut Noise) -> f64 {
        self.gain * filter(&mut self.stages, noise.gaussian(1.0))
    }
}

fn filter(stages: &mut [BandPass; 2], x: f64) -> f64 {
    stages.iter_mut().fold(x, |x, stage| stage.next(x))
}

/// A resonance with zeros at 0 Hz and at half the sampling rate: a tremor does not push steadily.
#[derive(Clone, Copy, Debug)]
struct BandPass {
    feedback: [f64; 2],
    input: [f64; 2],
    output: [f64; 2],
}

impl BandPass {
    fn new(centre_hertz: f64, width_hertz: f64) -> Self {
        let radius = (-PI * width_hertz * STEP_SECONDS).exp();
        let feedback = [2.0 * radius * (2.0 * PI * centre_hertz * STEP_SECONDS).cos(), -radius * radius];
        Self { feedback, input: [0.0; 2], output: [0.0; 2] }
    }

    fn next(&mut self, x: f64) -> f64 {
        let y = x - self.input[1] + self.feedback[0] * self.output[0] + self.feedback[1] * self.output[1];
        self.input = [x, self.input[0]];
        self.output = [y, self.output[0]];
        y
    }
}

/// Slow wandering of what a teacher aims at: an Ornstein-Uhlenbeck process with unit power.
#[derive(Clone, Debug, Default)]
pub(super) struct Drift {
    value: f64,
    velocity: f64,
}

impl Drift {
    /// Time constant of each of the two low-passes in a row, s.
    const TIME_CONSTANT: f64 = 0.8;

    pub(super) fn next(&mut self, noise: &mut Noise) -> f64 {
        let a = STEP_SECONDS / Self::TIME_CONSTANT;
        // Two equal low-passes halve the power of the one: the factor 2 restores it. One alone would have no smooth
        // velocity.
        self.velocity += -a * self.velocity + (2.0 * a).sqrt() * noise.gaussian(1.0);
        self.value += a * (std::f64::consts::SQRT_2 * self.velocity - self.value);
        self.value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(mut next: impl FnMut(&mut Noise) -> f64) -> Vec<f64> {
        let mut noise = Noise::new(7, 0);
        (0..400_000).map(|_| next(&mut noise)).collect()
    }

    fn rms(x: &[f64]) -> f64 {
        (x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64).sqrt()
    }

    /// Mean power around a frequency, from one-second pieces (a resolution of 1 Hz).
    fn power(x: &[f64], hertz: f64) -> f64 {
        let pieces: Vec<_> = x.chunks_exact(1800).collect();
        let sum: f64 = pieces
            .iter()
            .map(|piece| {
                let (mut sine, mut cosine) = (0.0, 0.0);
                for (n, x) in piece.iter().enumerate() {
                    let (s, c) = (2.0 * PI * hertz * n as f64 * STEP_SECONDS).sin_cos();
                    sine += s * x;
                    cosine += c * x;
                }
                sine * sine + cosine * cosine
            })
            .sum();
        sum / pieces.len() as f64
    }

    #[test]
    fn tremor_has_unit_power_between_eight_and_twelve_hertz() {
        let mut tremor = Tremor::new();
        let x = record(|r| tremor.next(r));
        assert!((rms(&x) - 1.0).abs() < 0.05, "rms {}", rms(&x));
        let peak = power(&x, 10.0);
        for (hertz, low, high) in
            [(0.0, 0.0, 0.01), (4.0, 0.0, 0.1), (8.0, 0.3, 0.85), (12.0, 0.3, 0.85), (25.0, 0.0, 0.1)]
        {
            let share = power(&x, hertz) / peak;
            assert!((low..high).contains(&share), "{share} of the peak at {hertz} Hz");
        }
    }

    #[test]
    fn drift_has_unit_power_and_is_slow() {
        let mut drift = Drift::default();
        let x = record(|r| drift.next(r));
        assert!((rms(&x) - 1.0).abs() < 0.2, "rms {}", rms(&x));
        let fastest = x.windows(2).map(|w| (w[1] - w[0]).abs() / STEP_SECONDS).fold(0.0, f64::max);
        assert!(fastest < 8.0, "changes by {fastest} per second");
    }
}
