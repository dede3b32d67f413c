//! `ZeroPhaseFilter`: second-order Butterworth low-pass, run forwards and backwards.
//!
//! Two passes cancel the delay and square the gain (-6 dB at the cut-off). Both ends are continued by point reflection
//! and the filter starts in its steady state, so that the first and the last sample, which become start and goal of the
//! movement, stay where they are. That needs one period of the cut-off within the samples: with a third of it the ends
//! move by 6 % of the movement, with a tenth by more than all of it.

use std::vec::Vec;

/// Zero-phase Butterworth low-pass of second order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZeroPhaseFilter {
    b: [f64; 3],
    a: [f64; 2],
    pad: usize,
}

impl ZeroPhaseFilter {
    /// With a cut-off in Hz for samples `period` seconds apart; `None` unless it lies between 0 and half the sampling
    /// rate.
    pub fn new(cutoff: f64, period: f64) -> Option<Self> {
        let relative = cutoff * period;
        if !(relative > 0.0 && relative < 0.5) {
            return None;
        }
        // Bilinear transform with pre-warping.
        let w = libm::tan(core::f64::consts::PI * relative);
        let norm = 1.0 / (1.0 + core::f64::consts::SQRT_2 * w + w * w);
        let b0 = w * w * norm;
        Some(Self {
            b: [b0, 2.0 * b0, b0],
            a: [2.0 * (w * w - 1.0) * norm, (1.0 - core::f64::consts::SQRT_2 * w + w * w) * norm],
            // One period of the cut-off: the transient has decayed by then.
            pad: libm::ceil(1.0 / relative) as usize,
        })
    }

    /// The filtered samples.
    pub fn apply(&self, x: &[f64]) -> Vec<f64> {
        let Some(last) = x.len().checked_sub(1) else {
            return Vec::new();
        };
        let pad = self.pad.min(last);
        let (first_value, last_value) = (x[0], x[last]);
        let mut padded = Vec::with_capacity(x.len() + 2 * pad);
        padded.extend((1..=pad).rev().map(|i| 2.0 * first_value - x[i]));
        padded.extend_from_slice(x);
        padded.extend((1..=pad).map(|i| 2.0 * last_value - x[last - i]));
        self.pass(padded.iter_mut());
        self.pass(padded.iter_mut().rev());
        padded[pad..=pad + last].to_vec()
    }

    /// One pass in place, direct form II transposed, started in the steady state of the first value.
    fn pass<'a>(&self, samples: impl Iterator<Item = &'a mut f64>) {
        let ([b0, b1, b2], [a1, a2]) = (self.b, self.a);
        let mut state: Option<(f64, f64)> = None;
        for sample in samples {
            let x = *sample;
            let (z1, z2) = state.unwrap_or(((1.0 - b0) * x, (b2 - a2) * x));
            let y = b0 * x + z1;
            state = Some((b1 * x - a1 * y + z2, b2 * x - a2 * y));
            *sample = y;
        }
    }
}
