//! Kernels that are left out because they do not matter: the rest gives what all of them give.

use dmp::{Basis, CanonicalSystem, Scalar};

/// Largest difference of `psi_i s / sum psi` from the same with every kernel, for many bases and phases.
fn worst<T: Scalar>() -> f64 {
    let f = T::from_f64;
    let mut worst: f64 = 0.0;
    for (count, activation, alpha) in bases() {
        let canonical = CanonicalSystem::new(f(alpha)).unwrap();
        let basis = Basis::<T, 100>::new(&canonical, count, f(activation)).unwrap();
        for step in 0..300 {
            let s = f(f64::exp(-alpha * f64::from(step) / 230.0));
            let exponents: Vec<f64> = (0..count)
                .map(|i| basis.width(i).unwrap().to_f64() * (s.to_f64() - basis.centre(i).unwrap().to_f64()).powi(2))
                .collect();
            let least = exponents.iter().copied().fold(f64::MAX, f64::min);
            let psi: Vec<f64> = exponents.iter().map(|e| f64::exp(least - e)).collect();
            let sum: f64 = psi.iter().sum();
            let activations = basis.evaluate(s);
            for (i, psi) in psi.iter().enumerate() {
                let exact = psi * s.to_f64() / sum;
                worst = worst.max((activations.factor(i).to_f64() - exact).abs());
            }
        }
    }
    worst
}

fn bases() -> impl Iterator<Item = (usize, f64, f64)> {
    let counts = [2, 3, 4, 5, 8, 13, 25, 50, 99, 100];
    let activations = [0.05, 0.3, 0.7, 0.95];
    let each = move |count| activations.into_iter().flat_map(move |a| [2.3, 4.605, 9.0, 13.8].map(|d| (count, a, d)));
    counts.into_iter().flat_map(each)
}

#[test]
fn no_kernel_that_matters_is_left_out_in_f64() {
    let error = worst::<f64>();
    assert!(error < 2e-13, "off by {error}");
}

#[test]
fn no_kernel_that_matters_is_left_out_in_f32() {
    let error = worst::<f32>();
    assert!(error < 2e-5, "off by {error}");
}
