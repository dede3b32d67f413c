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

/// Kernels that are evaluated together.
const AT_A_TIME: usize = 16;

/// Kernels by a table of centres and widths.
#[derive(Clone, Debug, PartialEq)]
pub struct Tabulated<T, const N: usize> {
    count: usize,
    centres: [T; N],
    root_widths: [T; N],
}

impl<T: Scalar, const N: usize> Kernels<T, N> for Tabulated<T, N> {
    const FEWEST: Self = {
        let mut centres = [T::ZERO; N];
        centres[0] = T::ONE;
        Self { count: 2, centres, root_widths: [T::ONE; N] }
    };

    fn new(alpha: T, count: usize, activation: T) -> Option<Self> {
        let phase_at = |u: T| T::exp(-alpha * u);
        let intervals = T::from_index(count - 1);
        let mut basis = Self { count, centres: [T::ZERO; N], root_widths: [T::ZERO; N] };
        for (i, centre) in basis.centres.iter_mut().take(count).enumerate() {
            *centre = phase_at(T::from_index(i) / intervals);
        }
        // h_i = -ln(a)/(c_{i+1} - c_i)^2; neighbours keep a constant ratio, so the difference is c_i (1 - ratio),
        // which does not cancel.
        let root_log = T::from_f64(libm::sqrt(-libm::log(activation.to_f64())));
        let gap = T::ONE - phase_at(T::ONE / intervals);
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
        // Some at a time: the loop over their exponentials has no branch, so it becomes vector instructions where there
        // are any.
        let mut i = first;
        for (centres, roots) in centres[first..].chunks(AT_A_TIME).zip(roots[first..].chunks(AT_A_TIME)) {
            let mut kernels = [T::ZERO; AT_A_TIME];
            let mut used = 0;
            for ((place, centre), root) in kernels.iter_mut().zip(centres).zip(roots) {
                let z = *root * (s - *centre);
                let exponent = z * z - smallest;
                if i + used > nearest && !(exponent <= T::NEGLIGIBLE_EXPONENT) {
                    break;
                }
                *place = exponent;
                used += 1;
            }
            let used = kernels.get_mut(..used).unwrap_or_default();
            for kernel in used.iter_mut() {
                *kernel = T::kernel(*kernel);
            }
            for kernel in used.iter() {
                sum = sum + *kernel;
            }
            take(i, used);
            i += used.len();
            if used.len() < centres.len() {
                break;
            }
        }
        s / sum
    }
}
