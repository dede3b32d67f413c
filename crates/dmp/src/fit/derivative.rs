//! Numerical differentiation of evenly sampled values: five-point stencils, one-sided at the ends.

use std::vec::Vec;

/// First derivative, fourth order in `period`; needs at least five samples (fewer give zeros).
pub fn first_derivative(x: &[f64], period: f64) -> Vec<f64> {
    apply(
        x,
        1.0 / (12.0 * period),
        [1.0, -8.0, 0.0, 8.0, -1.0],
        [-25.0, 48.0, -36.0, 16.0, -3.0],
        [-3.0, -10.0, 18.0, -6.0, 1.0],
        -1.0,
    )
}

/// Second derivative, fourth order inside, third order at the ends.
pub fn second_derivative(x: &[f64], period: f64) -> Vec<f64> {
    apply(
        x,
        1.0 / (12.0 * period * period),
        [-1.0, 16.0, -30.0, 16.0, -1.0],
        [35.0, -104.0, 114.0, -56.0, 11.0],
        [11.0, -20.0, 6.0, 4.0, -1.0],
        1.0,
    )
}

/// `first` and `second` are the stencils of the first two samples; at the other end they are mirrored with `parity`.
fn apply(x: &[f64], factor: f64, inside: [f64; 5], first: [f64; 5], second: [f64; 5], parity: f64) -> Vec<f64> {
    let n = x.len();
    if n < 5 {
        return std::vec![0.0; n];
    }
    let forward = |stencil: &[f64; 5], at: usize| -> f64 { stencil.iter().zip(&x[at..]).map(|(c, x)| c * x).sum() };
    let backward = |stencil: &[f64; 5]| -> f64 { stencil.iter().zip(x.iter().rev()).map(|(c, x)| c * x).sum() };
    let mut out = Vec::with_capacity(n);
    out.push(forward(&first, 0));
    out.push(forward(&second, 0));
    out.extend((0..n - 4).map(|i| forward(&inside, i)));
    out.push(parity * backward(&second));
    out.push(parity * backward(&first));
    for value in &mut out {
        *value *= factor;
    }
    out
}
