//! `Kernels`: the kernels of Eq. (2) at one phase, and `Tabulated`, which keeps a centre and a width for each.

use core::fmt::Debug;

use super::Scalar;

/// Kernels over the phase, `psi_i(s) = exp(-h_i (s - c_i)^2)`; see [`Basis`](crate::Basis).
pub trait Kernels<T, const N: usize>: Clone + Debug + PartialEq {
    /// Two kernels, at the start and at the end of the phase: as few as there can be.
    const FEWEST: Self;

    /// `count` kernels (2 to `N`) for the decay `alpha` of the phase, each with the value `activation` at the next
    /// centre; `None` if they cannot be held.
    fn new(alpha: T, count: usize, activation: T) -> Option<Self>;
    /// Number of kernels in use.
    fn count(&self) -> usize;
    /// Centre `c_i`; `None` beyond the last kernel.
    fn centre(&self, i: usize) -> Option<T>;
    /// Width `h_i`; `None` beyond the last kernel.
    fn width(&self, i: usize) -> Option<T>;
    /// Gives the kernels that matter at the phase `s` to `take`, some at a time with the index of the first, in order
    /// and such that the largest is 1; returns `s / sum psi`.
    fn each(&self, s: T, take: impl FnMut(usize, &[T])) -> T;
}

/// Kernels that are evaluated together: as many as matter at a phase where there are vector instructions; one on a
/// microcontroller, which has none and little room for code.
const AT_A_TIME: usize = if cfg!(target_arch = "arm") { 1 } else { 64 };

/// Kernels that are evaluated in one step at most.
const LANES: usize = 8;

/// Kernels by a table of centres and widths.
#[derive(Clone, Debug, PartialEq)]
pub struct Tabulated<T, const N: usize> {
    count: usize,
    centres: [T; N],
    root_widths: [T; N],
    /// Kernels before and after the nearest one that can matter.
    reach: (usize, usize),
}

/// Kernels between two that the search for the nearest one looks at first.
const STRIDE: usize = 8;

/// Kernels before and after the nearest one that can matter, for centres of this ratio `r`.
///
/// With `x = s/c_n` kernel `n - k` has the exponent `(p (1 - x r^k))^2` and `n + k` has `(p (x r^-k - 1))^2`, `p` being
/// `sqrt(-ln a)/(1 - r)`. Kernel `n` is the nearest for `x` from `2r/(1 + r)` to `2/(1 + r)`, and its neighbours come
/// closest to it at the ends. One more after it, because the last kernel is as wide as the one before it.
fn reach<T: Scalar>(count: usize, ratio: T, root_log: T) -> (usize, usize) {
    let per_gap = root_log / (T::ONE - ratio);
    let matters = |distance: T, nearest: T| {
        let (z, least) = (per_gap * distance, per_gap * nearest);
        z * z - least * least <= T::NEGLIGIBLE_EXPONENT
    };
    let mean = (T::ONE + ratio) / T::from_f64(2.0);
    let (largest, smallest) = (T::ONE / mean, ratio / mean);
    let (mut power, mut before, mut after) = (ratio, 0, 1);
    while before < count && matters(T::ONE - largest * power, largest - T::ONE) {
        power = power * ratio;
        before += 1;
    }
    power = ratio;
    while after < count && matters(smallest / power - T::ONE, T::ONE - smallest) {
        power = power * ratio;
        after += 1;
    }
    (before, after)
}

impl<T: Scalar, const N: usize> Kernels<T, N> for Tabulated<T, N> {
    const FEWEST: Self = {
        let mut centres = [T::ZERO; N];
        centres[0] = T::ONE;
        Self { count: 2, centres, root_widths: [T::ONE; N], reach: (1, 1) }
    };

    fn new(alpha: T, count: usize, activation: T) -> Option<Self> {
        let phase_at = |u: T| T::exp(-alpha * u);
        let intervals = T::from_index(count - 1);
        let mut basis = Self { count, centres: [T::ZERO; N], root_widths: [T::ZERO; N], reach: (0, 0) };
        for (i, centre) in basis.centres.iter_mut().take(count).enumerate() {
            *centre = phase_at(T::from_index(i) / intervals);
        }
        // h_i = -ln(a)/(c_{i+1} - c_i)^2; neighbours keep a constant ratio, so the difference is c_i (1 - ratio),
        // which does not cancel.
        let root_log = T::from_f64(libm::sqrt(-libm::log(activation.to_f64())));
        let ratio = phase_at(T::ONE / intervals);
        let gap = T::ONE - ratio;
        basis.reach = reach(count, ratio, root_log);
        for i in 0..count {
            let left = basis.centres[if i + 1 < count { i } else { i - 1 }];
            basis.root_widths[i] = root_log / (left * gap);
        }
        Some(basis)
    }

    #[inline]
    fn count(&self) -> usize {
        self.count
    }

    fn centre(&self, i: usize) -> Option<T> {
        self.centres.get(..self.count)?.get(i).copied()
    }

    fn width(&self, i: usize) -> Option<T> {
        let root = *self.root_widths.get(..self.count)?.get(i)?;
        Some(root * root)
    }

    #[inline]
    fn each(&self, s: T, mut take: impl FnMut(usize, &[T])) -> T {
        let count = if self.count < N { self.count } else { N };
        let (centres, roots) = (&self.centres[..count], &self.root_widths[..count]);
        let exponent = |i: usize| {
            let z = roots[i] * (s - centres[i]);
            z * z
        };
        // Centres fall with i, and so do the signed distances in units of the width: the exponents have one minimum,
        // beside the place where s would be sorted in.
        // A linear search in two strides, because its branches go the same way as in the tick before.
        let above = |c: &&T| **c > s;
        let stride = centres.iter().step_by(STRIDE).skip(1).take_while(above).count() * STRIDE;
        let upper = stride + centres.iter().skip(stride).take_while(above).count();
        let nearest = if upper == 0 {
            0
        } else if upper == count || exponent(upper - 1) < exponent(upper) {
            upper - 1
        } else {
            upper
        };
        let smallest = exponent(nearest);
        // Beyond the last centre the exponents come closer to each other, until at s = 0 all kernels are the same.
        let first = if upper == count {
            let matters = |i: &usize| exponent(*i) - smallest <= T::NEGLIGIBLE_EXPONENT;
            (0..nearest).rev().take_while(matters).last().unwrap_or(nearest)
        } else {
            nearest.saturating_sub(self.reach.0)
        };
        let last = nearest.saturating_add(self.reach.1).saturating_add(1).min(count);
        let (centres, roots) =
            (centres.get(first..last).unwrap_or_default(), roots.get(first..last).unwrap_or_default());
        let mut sum = T::ZERO;
        // Some at a time: the loops have no branch, so they become vector instructions where there are any.
        let chunks = centres.chunks(AT_A_TIME).zip(roots.chunks(AT_A_TIME));
        for (i, (centres, roots)) in (first..).step_by(AT_A_TIME).zip(chunks) {
            let mut kernels = [T::ZERO; AT_A_TIME];
            for ((place, centre), root) in kernels.iter_mut().zip(centres).zip(roots) {
                let z = *root * (s - *centre);
                *place = z * z - smallest;
            }
            if AT_A_TIME == 1 && !kernels.iter().all(|exponent| *exponent <= T::NEGLIGIBLE_EXPONENT) {
                continue;
            }
            // Up to a multiple of the widest vectors: the few that are left over would be evaluated one by one.
            for kernel in kernels.iter_mut().take(centres.len().next_multiple_of(LANES)) {
                let value = T::kernel(*kernel);
                *kernel = if *kernel <= T::NEGLIGIBLE_EXPONENT { value } else { T::ZERO };
            }
            let kernels = kernels.get(..centres.len()).unwrap_or_default();
            for kernel in kernels {
                sum = sum + *kernel;
            }
            take(i, kernels);
        }
        s / sum
    }
}
