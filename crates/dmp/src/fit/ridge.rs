//! `Ridge`: one regularised least-squares problem for all rows.
//!
//! Minimises `sum_k |f_target(s_k) - sum_i A_ki theta_i|^2 + lambda |theta|^2` with `A_ki = s_k psi_i/sum psi` and
//! `lambda = ridge trace(A^T A)/N`. `A` depends only on the phase: the normal equations are built and factorised once.
//! The usual alternative, a separate fit per kernel, does not minimise the error and is 30 times less accurate.

use std::vec::Vec;

use super::FIT_CAPACITY;
use crate::{Activations, Basis, ROWS};

/// Factorised normal equations.
pub(super) struct Ridge {
    count: usize,
    activations: Vec<Activations<f64, FIT_CAPACITY>>,
    /// Lower triangle of the Cholesky factor, row by row.
    factor: Vec<Vec<f64>>,
    /// `A^T A`, lower triangle.
    gram: Vec<Vec<f64>>,
}

impl Ridge {
    pub(super) fn new(basis: &Basis<f64, FIT_CAPACITY>, phases: &[f64], ridge: f64) -> Option<Self> {
        let count = basis.count();
        let activations: Vec<_> = phases.iter().map(|&s| basis.evaluate(s)).collect();
        let mut gram: Vec<Vec<f64>> = (0..count).map(|i| std::vec![0.0; i + 1]).collect();
        for a in &activations {
            let active = a.active();
            let factors: Vec<f64> = active.clone().map(|i| a.factor(i)).collect();
            for (n, i) in active.clone().enumerate() {
                let row = &mut gram[i][active.start..=i];
                for (g, factor) in row.iter_mut().zip(&factors) {
                    *g += factors[n] * factor;
                }
            }
        }
        let trace: f64 = gram.iter().enumerate().map(|(i, row)| row[i]).sum();
        let lambda = ridge * trace / count as f64;
        let mut regularised = gram.clone();
        for (i, row) in regularised.iter_mut().enumerate() {
            row[i] += lambda;
        }
        let factor = cholesky(&regularised)?;
        Some(Self { count, activations, factor, gram })
    }

    /// Weights, kernel by kernel, for targets sample by sample.
    pub(super) fn solve(&self, targets: &[[f64; ROWS]]) -> Vec<[f64; ROWS]> {
        let mut x = std::vec![[0.0; ROWS]; self.count];
        for (a, target) in self.activations.iter().zip(targets) {
            for i in a.active() {
                add_scaled(&mut x[i], target, a.factor(i));
            }
        }
        back_substitute(&self.factor, &mut x);
        x
    }

    /// Root mean square of what the weights leave of the targets, row by row.
    pub(super) fn residuals(&self, weights: &[[f64; ROWS]], targets: &[[f64; ROWS]]) -> [f64; ROWS] {
        let mut sum = [0.0; ROWS];
        for (a, target) in self.activations.iter().zip(targets) {
            let mut rest = *target;
            for i in a.active() {
                add_scaled(&mut rest, &weights[i], -a.factor(i));
            }
            for (sum, rest) in sum.iter_mut().zip(rest) {
                *sum += rest * rest;
            }
        }
        sum.map(|sum| libm::sqrt(sum / targets.len() as f64))
    }

    /// Condition number of the design matrix `A`, without the ridge: root of the ratio of the extreme eigenvalues of
    /// `A^T A`, both by power iteration. Infinite if `A^T A` is singular in double precision, from about 1e8 on.
    pub(super) fn condition(&self) -> f64 {
        const ITERATIONS: usize = 30;
        let Some(factor) = cholesky(&self.gram) else {
            return f64::INFINITY;
        };
        let start = || -> Vec<[f64; 1]> {
            // Alternating signs are far from the smooth eigenvector of the largest value and near that of the smallest;
            // the slope keeps a part of both.
            (0..self.count).map(|i| [if i % 2 == 0 { 1.0 } else { -0.9 } + i as f64 * 1e-2]).collect()
        };
        let norm = |x: &[[f64; 1]]| libm::sqrt(x.iter().map(|[x]| x * x).sum::<f64>());
        let (mut largest, mut x) = (0.0, start());
        for _ in 0..ITERATIONS {
            let mut y = std::vec![[0.0]; self.count];
            for (i, row) in self.gram.iter().enumerate() {
                for (j, g) in row.iter().enumerate() {
                    y[i][0] += g * x[j][0];
                    if i != j {
                        y[j][0] += g * x[i][0];
                    }
                }
            }
            largest = norm(&y);
            x = y.into_iter().map(|[y]| [y / largest]).collect();
        }
        let (mut smallest, mut x) = (1.0, start());
        for _ in 0..ITERATIONS {
            back_substitute(&factor, &mut x);
            let length = norm(&x);
            smallest = 1.0 / length;
            for [x] in &mut x {
                *x /= length;
            }
        }
        libm::sqrt(largest / smallest)
    }
}

/// Solves `L L^T y = x` in place for all columns at once.
fn back_substitute<const D: usize>(factor: &[Vec<f64>], x: &mut [[f64; D]]) {
    for i in 0..factor.len() {
        let mut value = x[i];
        for (j, l) in factor[i][..i].iter().enumerate() {
            add_scaled(&mut value, &x[j], -l);
        }
        x[i] = value.map(|value| value / factor[i][i]);
    }
    for i in (0..factor.len()).rev() {
        let value = x[i].map(|value| value / factor[i][i]);
        x[i] = value;
        for (j, l) in factor[i][..i].iter().enumerate() {
            add_scaled(&mut x[j], &value, -l);
        }
    }
}

/// a += k b
fn add_scaled<const D: usize>(a: &mut [f64; D], b: &[f64; D], k: f64) {
    for (a, b) in a.iter_mut().zip(b) {
        *a += k * b;
    }
}

/// Lower Cholesky factor of a symmetric matrix given by its lower triangle; `None` if it is not positive definite.
fn cholesky(matrix: &[Vec<f64>]) -> Option<Vec<Vec<f64>>> {
    let mut factor: Vec<Vec<f64>> = Vec::with_capacity(matrix.len());
    for (i, row) in matrix.iter().enumerate() {
        let mut l: Vec<f64> = Vec::with_capacity(i + 1);
        for (j, &value) in row.iter().enumerate() {
            let done = if j < i { &factor[j] } else { &l };
            let sum = value - l.iter().zip(done).map(|(a, b)| a * b).sum::<f64>();
            if j < i {
                l.push(sum / factor[j][j]);
            } else if sum > 0.0 {
                l.push(libm::sqrt(sum));
            } else {
                return None;
            }
        }
        factor.push(l);
    }
    Some(factor)
}
