//! `Basis` and `ForcingTerm`: Eq. (2), evaluated once per tick for all rows.
//!
//! `f(s) = sum_i(psi_i(s) theta_i s) / sum_i psi_i(s)`, `psi_i(s) = exp(-h_i (s - c_i)^2)`,
//! `c_i = exp(-alpha i/(N-1))`, `h_i = -ln(a)/(c_{i+1} - c_i)^2`, the last width repeated.
//!
//! Three things are not in the equation but give the same value: the largest exponent is subtracted before `exp`
//! (far beyond the last centre the sum would underflow to 0/0), kernels below the rounding error of the sum are left
//! out, and the quotient is one reciprocal per tick. The exponent is computed as `(sqrt(h_i) (s - c_i))^2`, which
//! keeps six more digits in fixed point.

use crate::{CanonicalSystem, Scalar};

/// Kernels over the phase: `count` of at most `N`.
#[derive(Clone, Debug, PartialEq)]
pub struct Basis<T, const N: usize> {
    count: usize,
    centres: [T; N],
    root_widths: [T; N],
}

impl<T: Scalar, const N: usize> Basis<T, N> {
    /// Places `count` kernels so that each has the value `activation` at the next centre.
    ///
    /// `None` unless `2 <= count <= N` and `0.05 <= activation <= 0.95` (beyond, neighbours are indistinguishable
    /// and the weights explode, or the kernels leave gaps).
    pub fn new(canonical: &CanonicalSystem<T>, count: usize, activation: T) -> Option<Self> {
        let allowed = T::from_f64(0.05)..=T::from_f64(0.95);
        if count < 2 || count > N || !allowed.contains(&activation) {
            return None;
        }
        let intervals = T::from_index(count - 1);
        let mut basis = Self { count, centres: [T::ZERO; N], root_widths: [T::ZERO; N] };
        for (i, centre) in basis.centres.iter_mut().take(count).enumerate() {
            *centre = canonical.phase_at(T::from_index(i) / intervals);
        }
        // h_i = -ln(a)/(c_{i+1} - c_i)^2; neighbours keep a constant ratio, so the difference is c_i (1 - ratio),
        // which does not cancel.
        let root_log = T::from_f64(libm::sqrt(-libm::log(activation.to_f64())));
        let gap = T::ONE - canonical.phase_at(T::ONE / intervals);
        for i in 0..count {
            let left = basis.centres[if i + 1 < count { i } else { i - 1 }];
            basis.root_widths[i] = root_log / (left * gap);
        }
        Some(basis)
    }

    /// Two kernels, at the start and at the end of the phase: as few as there can be.
    pub(crate) const fn fewest() -> Self {
        let mut centres = [T::ZERO; N];
        centres[0] = T::ONE;
        Self { count: 2, centres, root_widths: [T::ONE; N] }
    }

    /// Number of kernels in use.
    #[inline]
    pub fn count(&self) -> usize {
        self.count
    }

    /// Centre `c_i`; `None` beyond the last kernel.
    pub fn centre(&self, i: usize) -> Option<T> {
        self.centres.get(..self.count)?.get(i).copied()
    }

    /// Width `h_i`; `None` beyond the last kernel.
    pub fn width(&self, i: usize) -> Option<T> {
        let root = *self.root_widths.get(..self.count)?.get(i)?;
        Some(root * root)
    }

    /// Evaluates all kernels at the phase `s`.
    pub fn evaluate(&self, s: T) -> Activations<T, N> {
        let mut activations = Activations { first: N, last: 0, kernels: [T::ZERO; N], scale: T::ZERO };
        activations.scale = self.each(s, |i, kernel| {
            activations.kernels[i] = kernel;
            activations.first = activations.first.min(i);
            activations.last = i + 1;
        });
        activations
    }

    /// Gives each kernel that matters at the phase `s` to `take`, in order; returns `s / sum psi`. Without the array of
    /// [`Basis::evaluate`], which costs more to clear than a tick needs of it.
    #[inline]
    pub(crate) fn each(&self, s: T, mut take: impl FnMut(usize, T)) -> T {
        let count = if self.count < N { self.count } else { N };
        let (centres, roots) = (&self.centres[..count], &self.root_widths[..count]);
        let exponent = |i: usize| {
            let z = roots[i] * (s - centres[i]);
            z * z
        };
        // Centres fall with i, and so do the signed distances in units of the width: the exponents have one minimum,
        // beside the place where s would be sorted in.
        let upper = centres.partition_point(|&c| c > s);
        let nearest = if upper == 0 {
            0
        } else if upper == count || exponent(upper - 1) < exponent(upper) {
            upper - 1
        } else {
            upper
        };
        let smallest = exponent(nearest);
        let matters = |i: usize| exponent(i) - smallest <= T::NEGLIGIBLE_EXPONENT;
        let first = (0..nearest).rev().take_while(|&i| matters(i)).last().unwrap_or(nearest);
        let mut sum = T::ZERO;
        for i in first..count {
            if i > nearest && !matters(i) {
                break;
            }
            let kernel = if i == nearest { T::kernel(T::ZERO) } else { T::kernel(exponent(i) - smallest) };
            sum = sum + kernel;
            take(i, kernel);
        }
        s / sum
    }
}

/// All kernels at one phase: what every row of a movement shares during a tick.
#[derive(Clone, Debug)]
pub struct Activations<T, const N: usize> {
    first: usize,
    last: usize,
    kernels: [T; N],
    scale: T,
}

impl<T: Scalar, const N: usize> Activations<T, N> {
    /// Kernels that matter at this phase.
    #[inline]
    pub fn active(&self) -> core::ops::Range<usize> {
        self.first..self.last
    }

    /// `psi_i s / sum psi`: the factor of `theta_i` in Eq. (2).
    #[inline]
    pub fn factor(&self, i: usize) -> T {
        self.kernels.get(i).map_or(T::ZERO, |kernel| *kernel * self.scale)
    }
}

/// Weights of `ROWS` rows, kernel by kernel, so that a tick walks through memory once and all rows advance together.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Weights<T, const ROWS: usize, const N: usize>([[T; ROWS]; N]);

impl<T: Scalar, const ROWS: usize, const N: usize> Weights<T, ROWS, N> {
    /// All weights zero.
    pub(crate) const ZERO: Self = Self([[T::ZERO; ROWS]; N]);

    /// Takes `ROWS` rows of `count` weights each, row after row; what is missing is 0.
    pub(crate) fn assign(&mut self, count: usize, weights: &[T]) {
        self.0.iter_mut().for_each(|kernel| *kernel = [T::ZERO; ROWS]);
        for (row, weights) in weights.chunks(count.max(1)).take(ROWS).enumerate() {
            for (kernel, weight) in self.0.iter_mut().zip(weights) {
                kernel[row] = *weight;
            }
        }
    }

    /// Copies the weights of others.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.0.copy_from_slice(&other.0);
    }

    /// Weight of a row at kernel `i`; `None` outside.
    pub(crate) fn get(&self, row: usize, i: usize) -> Option<T> {
        self.0.get(i)?.get(row).copied()
    }

    /// Adds the share of kernel `i` to the sum of each row.
    #[inline]
    pub(crate) fn add(&self, i: usize, kernel: T, sums: &mut [T; ROWS]) {
        let weights = self.0.get(i).into_iter().flatten();
        for (sum, weight) in sums.iter_mut().zip(weights) {
            *sum = *sum + kernel * *weight;
        }
    }
}

/// Weights of `ROWS` rows over a common basis.
#[derive(Clone, Debug, PartialEq)]
pub struct ForcingTerm<T, const ROWS: usize, const N: usize> {
    basis: Basis<T, N>,
    weights: Weights<T, ROWS, N>,
}

impl<T: Scalar, const ROWS: usize, const N: usize> ForcingTerm<T, ROWS, N> {
    /// From weights in row-major order `[ROWS][count]`; `None` if there are not exactly `ROWS * count` finite ones.
    #[must_use]
    pub fn new(basis: Basis<T, N>, weights: &[T]) -> Option<Self> {
        if weights.len() != ROWS * basis.count() || !weights.iter().all(|w| w.is_finite()) {
            return None;
        }
        let mut forcing = Self { basis, weights: Weights::ZERO };
        forcing.weights.assign(forcing.basis.count(), weights);
        Some(forcing)
    }

    /// The common basis.
    #[inline]
    #[must_use]
    pub fn basis(&self) -> &Basis<T, N> {
        &self.basis
    }

    /// Weight `theta_i` of a row; `None` outside.
    #[must_use]
    pub fn weight(&self, row: usize, i: usize) -> Option<T> {
        if i < self.basis.count() { self.weights.get(row, i) } else { None }
    }

    /// `f(s)` of all rows; 0 at s = 0.
    #[inline]
    #[must_use]
    pub fn evaluate(&self, s: T) -> [T; ROWS] {
        let mut f = [T::ZERO; ROWS];
        let scale = self.basis.each(s, |i, kernel| self.weights.add(i, kernel, &mut f));
        f.map(|f| f * scale)
    }
}
