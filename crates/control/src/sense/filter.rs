//! Low-passes: a causal second-order Butterworth filter, and the share of a new value in one of first order.
//!
//! `y_k = b0 (x_k + 2 x_{k-1} + x_{k-2}) - a1 y_{k-1} - a2 y_{k-2}`, by the bilinear transform with pre-warping, so
//! that the gain at the cut-off is exactly `1/sqrt(2)`. Its delay far below the cut-off is `sqrt(2) / (2 pi f_c)`.

use nalgebra::SVector;

use crate::real::Real;
use crate::time::PERIOD;

/// Share of a new value in the filtered one of a low-pass of first order with this cut-off (Hz), from one control
/// period to the next.
pub(crate) const fn share(cut_off: f64) -> f64 {
    let turn = core::f64::consts::TAU * cut_off * PERIOD;
    turn / (1.0 + turn)
}

/// Coefficients of the filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Butterworth<R: Real> {
    gain: R,
    a1: R,
    a2: R,
}

impl<R: Real> Butterworth<R> {
    /// A filter with this cut-off at this sampling rate (both Hz). The cut-off is kept between 1/1000 and 0.45 of the
    /// rate.
    pub fn new(cut_off: f64, rate: f64) -> Self {
        let ratio = (cut_off / rate).clamp(1e-3, 0.45);
        let warped = libm::tan(core::f64::consts::PI * ratio);
        let squared = warped * warped;
        let norm = 1.0 / (1.0 + core::f64::consts::SQRT_2 * warped + squared);
        Butterworth {
            gain: R::constant(squared * norm),
            a1: R::constant(2.0 * (squared - 1.0) * norm),
            a2: R::constant((1.0 - core::f64::consts::SQRT_2 * warped + squared) * norm),
        }
    }
}

/// `D` channels through one [`Butterworth`] filter (transposed direct form, two states a channel).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LowPass<R: Real, const D: usize> {
    filter: Butterworth<R>,
    first: SVector<R, D>,
    second: SVector<R, D>,
    output: SVector<R, D>,
}

impl<R: Real, const D: usize> LowPass<R, D> {
    /// At rest at zero.
    pub fn new(filter: Butterworth<R>) -> Self {
        LowPass { filter, first: SVector::zeros(), second: SVector::zeros(), output: SVector::zeros() }
    }

    /// Takes one sample and returns the filtered value.
    pub fn step(&mut self, input: &SVector<R, D>) -> SVector<R, D> {
        let Butterworth { gain, a1, a2 } = self.filter;
        let scaled = input * gain;
        let output = scaled + self.first;
        self.first = scaled * R::constant(2.0) - output * a1 + self.second;
        self.second = scaled - output * a2;
        self.output = output;
        output
    }

    /// The value of the last step.
    pub fn output(&self) -> &SVector<R, D> {
        &self.output
    }

    /// As if `value` had been the input for a long time.
    pub fn settle(&mut self, value: &SVector<R, D>) {
        let Butterworth { gain, a2, .. } = self.filter;
        self.second = value * (gain - a2);
        self.first = value * (R::constant(1.0) - gain);
        self.output = *value;
    }
}
