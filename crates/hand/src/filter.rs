//! `LowPass`: the Butterworth filter of `control::sense::filter`, in fixed point.

use crate::number::{Number, ONE, ZERO, constant};

/// Coefficients, see `control::sense::filter`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Coefficients {
    gain: Number,
    a1: Number,
    a2: Number,
}

impl Coefficients {
    /// The second-order Butterworth filter of this cut-off (Hz) at the control rate, by the bilinear transform.
    pub const fn butterworth(cut_off: f64) -> Self {
        let k = tangent(core::f64::consts::PI * cut_off / control::RATE);
        let scale = 1.0 / (1.0 + core::f64::consts::SQRT_2 * k + k * k);
        Coefficients {
            gain: constant(k * k * scale),
            a1: constant(2.0 * (k * k - 1.0) * scale),
            a2: constant((1.0 - core::f64::consts::SQRT_2 * k + k * k) * scale),
        }
    }
}

/// Returns the tangent of an angle between 0 and pi/2 by its continued fraction, for constants: 12 terms are exact to
/// 1e-13 up to 1.4.
const fn tangent(angle: f64) -> f64 {
    let square = angle * angle;
    let mut denominator = 25.0;
    let mut odd = 23.0;
    while odd > 0.0 {
        denominator = odd - square / denominator;
        odd -= 2.0;
    }
    angle / denominator
}

/// Filter of the gauges.
pub const GAUGE: Coefficients = Coefficients::butterworth(control::sense::wrench::WRENCH_CUT_OFF);

/// Filter of the velocities.
pub const VELOCITY: Coefficients = Coefficients::butterworth(control::sense::joints::VELOCITY_CUT_OFF);

/// `D` channels through one filter (transposed direct form).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LowPass<const D: usize> {
    coefficients: Coefficients,
    first: [Number; D],
    second: [Number; D],
    output: [Number; D],
}

impl<const D: usize> LowPass<D> {
    /// At rest at zero.
    pub const fn new(coefficients: Coefficients) -> Self {
        LowPass { coefficients, first: [ZERO; D], second: [ZERO; D], output: [ZERO; D] }
    }

    /// Takes one sample and returns the filtered value.
    pub fn step(&mut self, input: &[Number; D]) -> [Number; D] {
        let Coefficients { gain, a1, a2 } = self.coefficients;
        let states = self.first.iter_mut().zip(&mut self.second).zip(&mut self.output);
        for (((first, second), output), input) in states.zip(input) {
            let scaled = *input * gain;
            *output = scaled + *first;
            *first = scaled + scaled - *output * a1 + *second;
            *second = scaled - *output * a2;
        }
        self.output
    }

    /// The value of the last step.
    pub fn output(&self) -> &[Number; D] {
        &self.output
    }

    /// As if `value` had been the input for a long time.
    pub fn settle(&mut self, value: &[Number; D]) {
        let Coefficients { gain, a2, .. } = self.coefficients;
        self.second = value.map(|value| value * (gain - a2));
        self.first = value.map(|value| value * (ONE - gain));
        self.output = *value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use control::sense::filter::{Butterworth, LowPass as Reference};
    use nalgebra::SVector;

    #[test]
    fn the_filters_are_those_of_the_arm() {
        for (coefficients, cut_off) in
            [(GAUGE, control::sense::wrench::WRENCH_CUT_OFF), (VELOCITY, control::sense::joints::VELOCITY_CUT_OFF)]
        {
            let mut fixed = LowPass::<1>::new(coefficients);
            let mut exact = Reference::<f64, 1>::new(Butterworth::new(cut_off, control::RATE));
            let mut worst = 0.0_f64;
            for tick in 0..3000 {
                let input = 3.0 * libm::sin(0.01 * f64::from(tick)) + if tick % 100 < 50 { 1.0 } else { -1.0 };
                let [filtered] = fixed.step(&[dmp::Scalar::from_f64(input)]);
                let reference = exact.step(&SVector::from([input]))[0];
                worst = worst.max((dmp::Scalar::to_f64(filtered) - reference).abs());
            }
            assert!(worst < 1e-7, "{cut_off} Hz: {worst:e}");
        }
    }

    #[test]
    fn a_settled_filter_stays_where_it_is() {
        let mut filter = LowPass::<1>::new(GAUGE);
        let value = [constant(-0.7)];
        filter.settle(&value);
        for _ in 0..10_000 {
            let [output] = filter.step(&value);
            assert!((output - value[0]).to_bits().abs() < 200, "{output:?}");
        }
    }
}
