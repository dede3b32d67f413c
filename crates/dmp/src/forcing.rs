//! `Basis` and `ForcingTerm`: Eq. (2), evaluated once per tick for all rows.
//!
//! `f(s) = sum_i(psi_i(s) theta_i s) / sum_i psi_i(s)`, `psi_i(s) = exp(-h_i (s - c_i)^2)`,
//! `c_i = exp(-alpha i/(N-1))`, `h_i = -ln(a)/(c_{i+1} - c_i)^2`, the last width repeated.
//!
//! Three things are not in the equation but give the same value: the largest exponent is subtracted before `exp`
//! (far beyond the last centre the sum would underflow to 0/0), kernels below the rounding error of the sum are left
//! out, and the quotient is one reciprocal per tick. The exponent is computed as `(sqrt(h_i) (s - c_i))^2`, which
//! keeps six more digits in fixed point.

use crate::{CanonicalSystem, Kernels, Scalar};

/// Kernels over the phase: `count` of at most `N`, evaluated as the number type does it best.
#[derive(Clone, Debug, PartialEq)]
pub struct Basis<T: Scalar, const N: usize>(T::Kernels<N>);

impl<T: Scalar, const N: usize> Basis<T, N> {
    /// Places `count` kernels so that each has the value `activation` at the next centre.
    ///
    /// `None` unless `2 <= count <= N` and `0.05 <= activation <= 0.95` (beyond, neighbours are indistinguishable
    /// and the weights explode, or the kernels leave gaps), or if the number type cannot hold such kernels.
    pub fn new(canonical: &CanonicalSystem<T>, count: usize, activation: T) -> Option<Self> {
        let allowed = T::from_f64(0.05)..=T::from_f64(0.95);
        if count < 2 || count > N || !allowed.contains(&activation) {
            return None;
        }
        T::Kernels::new(canonical.alpha(), count, activation).map(Self)
    }

    /// Two kernels, at the start and at the end of the phase: as few as there can be.
    pub(crate) const FEWEST: Self = Self(T::Kernels::FEWEST);

    /// Number of kernels in use.
    #[inline]
    pub fn count(&self) -> usize {
        self.0.count()
    }

    /// Centre `c_i`; `None` beyond the last kernel.
    pub fn centre(&self, i: usize) -> Option<T> {
        self.0.centre(i)
    }

    /// Width `h_i`; `None` beyond the last kernel.
    pub fn width(&self, i: usize) -> Option<T> {
        self.0.width(i)
    }

    /// Evaluates all kernels at the phase `s`.
    pub fn evaluate(&self, s: T) -> Activations<T, N> {
        let mut activations = Activations { first: N, last: 0, kernels: [T::ZERO; N], scale: T::ZERO };
        activations.scale = self.each(s, |i, kernels| {
            for (place, kernel) in activations.kernels.iter_mut().skip(i).zip(kernels) {
                *place = *kernel;
            }
            activations.first = activations.first.min(i);
            activations.last = i + kernels.len();
        });
        activations
    }

    /// Gives the kernels that matter at the phase `s` to `take`, some at a time with the index of the first; returns
    /// `s / sum psi`. Without the array of [`Basis::evaluate`], which costs more to clear than a tick needs of it.
    #[inline]
    pub(crate) fn each(&self, s: T, take: impl FnMut(usize, &[T])) -> T {
        self.0.each(s, take)
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
pub(crate) struct Weights<T: Scalar, const ROWS: usize, const N: usize>([[T::Weight; ROWS]; N]);

impl<T: Scalar, const ROWS: usize, const N: usize> Weights<T, ROWS, N> {
    /// All weights zero.
    pub(crate) const ZERO: Self = Self([[T::NO_WEIGHT; ROWS]; N]);

    /// Takes `ROWS` rows of `count` weights each, row after row; what is missing is 0.
    pub(crate) fn assign(&mut self, count: usize, weights: &[T::Weight]) {
        self.0.iter_mut().for_each(|kernel| *kernel = [T::NO_WEIGHT; ROWS]);
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
        self.0.get(i)?.get(row).map(|weight| T::from_weight(*weight))
    }

    /// Adds the shares of the kernels from `i` on to the sum of each row.
    #[inline]
    pub(crate) fn add(&self, i: usize, kernels: &[T], sums: &mut [T; ROWS]) {
        for (kernel, weights) in kernels.iter().zip(self.0.get(i..).unwrap_or_default()) {
            for (sum, weight) in sums.iter_mut().zip(weights) {
                *sum = sum.add_weighted(*kernel, *weight);
            }
        }
    }
}

/// Weights of `ROWS` rows over a common basis.
#[derive(Clone, Debug, PartialEq)]
pub struct ForcingTerm<T: Scalar, const ROWS: usize, const N: usize> {
    basis: Basis<T, N>,
    weights: Weights<T, ROWS, N>,
}

impl<T: Scalar, const ROWS: usize, const N: usize> ForcingTerm<T, ROWS, N> {
    /// From weights in row-major order `[ROWS][count]`; `None` if there are not exactly `ROWS * count` finite ones.
    #[must_use]
    pub fn new(basis: Basis<T, N>, weights: &[T::Weight]) -> Option<Self> {
        let finite = |weight: &T::Weight| T::from_weight(*weight).is_finite();
        if weights.len() != ROWS * basis.count() || !weights.iter().all(finite) {
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
        let scale = self.basis.each(s, |i, kernels| self.weights.add(i, kernels, &mut f));
        f.map(|f| f * scale)
    }
}
