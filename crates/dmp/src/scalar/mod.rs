//! `Scalar`: the number type a primitive is computed in (f64, f32 or fixed point).
//!
//! One piece of mathematics, three number types, tested against the same vectors. All of them use the same
//! software routines with and without `std`, so that a host and a board with the same type agree bit for bit.

#[cfg(feature = "fixed")]
mod exponential;
#[cfg(feature = "fixed")]
mod fixed;
mod float;
mod kernels;
#[cfg(feature = "fixed")]
mod ratios;

#[cfg(feature = "fixed")]
pub use self::fixed::FixedPoint;
pub use self::kernels::Kernels;

use core::fmt::Debug;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// A number in which primitives can be computed.
///
/// Implementations never panic. The floating types carry a failure as NaN or infinity (see [`Scalar::is_finite`]);
/// the fixed-point type saturates.
pub trait Scalar:
    Copy
    + PartialOrd
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + 'static
{
    /// 0.
    const ZERO: Self;
    /// 1.
    const ONE: Self;
    /// Largest value of the type; used as "no limit".
    const MAX: Self;
    /// Exponents this far below the largest one are left out of the kernel sum of Eq. (2).
    ///
    /// A kernel that far away weighs less than the rounding error of the nearest one (about `exp(-37)` in f64,
    /// `exp(-20)` in f32), so leaving it out is not visible in the result.
    const NEGLIGIBLE_EXPONENT: Self;

    /// The kernels of Eq. (2) as this type evaluates them.
    type Kernels<const N: usize>: Kernels<Self, N>;
    /// A weight of Eq. (2) as it is kept: hundreds of them have to fit into a small memory.
    type Weight: Copy + Debug + PartialEq + 'static;
    /// Weight 0.
    const NO_WEIGHT: Self::Weight;

    /// The value as a weight; `None` for what is no number, or too large to be kept.
    fn to_weight(self) -> Option<Self::Weight>;
    /// The value of a weight.
    fn from_weight(weight: Self::Weight) -> Self;
    /// `self + kernel * weight` for a kernel between 0 and 1: the sum of Eq. (2).
    fn add_weighted(self, kernel: Self, weight: Self::Weight) -> Self;

    /// Nearest (or saturated) value of this type.
    fn from_f64(value: f64) -> Self;
    /// The value as f64.
    fn to_f64(self) -> f64;
    /// An index as a number (up to 2^24 exactly).
    fn from_index(index: usize) -> Self;
    /// e^self.
    fn exp(self) -> Self;
    /// `exp(-self)` for `self` in `[0, NEGLIGIBLE_EXPONENT]`: the kernel function of Eq. (2).
    ///
    /// Straight-line arithmetic without division or branch, so that a loop over kernels can be vectorised.
    /// Outside that range the result is meaningless (but no panic).
    fn kernel(self) -> Self;
    /// Square root; NaN (fixed point: 0) for a negative number.
    fn sqrt(self) -> Self;
    /// Sine and cosine of an angle in radians (accurate for magnitudes up to about 1000).
    fn sin_cos(self) -> (Self, Self);
    /// Angle of the point (`x`, `self`) in (-pi, pi].
    fn atan2(self, x: Self) -> Self;
    /// True for a number: neither NaN nor infinite.
    fn is_finite(self) -> bool;
    /// Integer part as an index; 0 for negative numbers and NaN, saturated above.
    fn to_index(self) -> usize;

    /// The value as a pattern of bits, equal for equal values (0 and -0 may differ): what fingerprints are made of.
    #[inline]
    fn bits(self) -> u64 {
        self.to_f64().to_bits()
    }

    /// |self|.
    #[inline]
    fn abs(self) -> Self {
        if self < Self::ZERO { -self } else { self }
    }
}
