//! `FixedPoint`: 64-bit fixed point (32 integer, 32 fraction bits) for boards without a floating-point unit.
//!
//! Why I32F32 and nothing smaller: the products of the equations span eleven decades. The squared distance to a
//! kernel, `h (s - c)^2`, and stiffness terms reach 10^5..10^6 (20 integer bits), while one step of phase or velocity
//! is `dt/tau` = 10^-4..10^-3 and has to be known to 10^-6 of itself (32 fraction bits). With 16 fraction bits the
//! phase of a 5 s movement would be off by 2 %. A 64-bit product costs four multiplications on a Cortex-M3, which
//! leaves one movement row with 50 kernels far inside a 300 Hz tick.
//!
//! Products are rounded toward minus infinity. A processor of 64 bits makes them in one 128-bit multiplication, one of
//! 32 bits out of four 32-bit ones: the 128-bit routine of the compiler's library would cost three times as many
//! instructions there. Both give the same bits.
//!
//! All arithmetic saturates. It never wraps, because a wrapped velocity changes sign, and it never panics.

use core::ops::{Add, Div, Mul, Neg, Sub};

use ::fixed::types::I32F32;

use super::Scalar;
use super::exponential::decay;
use super::ratios::Ratios;

/// Fraction bits that a number has beyond a weight.
const WEIGHT_SHIFT: u32 = 8;

/// Saturating fixed-point number, resolution 2^-32 (2.3e-10), range about +-2.1e9.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct FixedPoint(I32F32);

impl FixedPoint {
    /// Wraps a number of crate `fixed`.
    #[must_use]
    pub const fn new(value: I32F32) -> Self {
        Self(value)
    }

    /// The number of crate `fixed`.
    #[must_use]
    pub const fn get(self) -> I32F32 {
        self.0
    }

    /// The number `bits` x 2^-32.
    #[must_use]
    pub const fn from_bits(bits: i64) -> Self {
        Self(I32F32::from_bits(bits))
    }

    /// The number in units of 2^-32.
    #[must_use]
    pub const fn to_bits(self) -> i64 {
        self.0.to_bits()
    }

    /// A constant of the program, cut (toward zero) to the resolution of the type. Saturates; NaN becomes 0.
    ///
    /// Meant for constant evaluation: at run time it would compute in floating point.
    #[must_use]
    pub const fn constant(value: f64) -> Self {
        Self::from_bits((value * 4_294_967_296.0) as i64)
    }

    /// Constants of the program, as [`constant`](Self::constant).
    #[must_use]
    pub const fn constants<const N: usize>(values: [f64; N]) -> [Self; N] {
        let mut numbers = [Self(I32F32::ZERO); N];
        let mut index = 0;
        while index < N {
            numbers[index] = Self::constant(values[index]);
            index += 1;
        }
        numbers
    }

    /// Polynomial with the constant term first.
    fn polynomial(self, coefficients: &[Self]) -> Self {
        coefficients.iter().rev().fold(Self::ZERO, |sum, &c| sum * self + c)
    }

    /// Nearest integer, with the remainder `self - n * unit` for the given unit and its reciprocal.
    fn reduce(self, unit: Self, reciprocal: Self) -> (i64, Self) {
        let n = (self * reciprocal).0.saturating_round();
        (n.to_bits() >> 32, self - Self(n) * unit)
    }

    /// atan of a ratio in [0, 1].
    fn atan_unit(self) -> Self {
        const TAN_EIGHTH: FixedPoint = FixedPoint::constant(0.414_213_562_373_095_05);
        const QUARTER: FixedPoint = FixedPoint::constant(core::f64::consts::FRAC_PI_4);
        // Beyond tan(pi/8) turn by pi/4, so that the series only sees arguments up to 0.414.
        let (offset, t) =
            if self > TAN_EIGHTH { (QUARTER, (self - Self::ONE) / (self + Self::ONE)) } else { (Self::ZERO, self) };
        const SERIES: [FixedPoint; 11] = FixedPoint::constants([
            1.0,
            -1.0 / 3.0,
            1.0 / 5.0,
            -1.0 / 7.0,
            1.0 / 9.0,
            -1.0 / 11.0,
            1.0 / 13.0,
            -1.0 / 15.0,
            1.0 / 17.0,
            -1.0 / 19.0,
            1.0 / 21.0,
        ]);
        offset + t * (t * t).polynomial(&SERIES)
    }
}

/// floor(a b / 2^32), saturated, by one wide multiplication.
#[inline]
const fn product_whole(a: i64, b: i64) -> i64 {
    let product = (a as i128 * b as i128) >> 32;
    if product > i64::MAX as i128 {
        i64::MAX
    } else if product < i64::MIN as i128 {
        i64::MIN
    } else {
        product as i64
    }
}

/// As [`product_whole`], of magnitudes, by four multiplications of halves.
#[inline]
const fn product_by_halves(a: i64, b: i64) -> i64 {
    let is_negative = (a < 0) != (b < 0);
    let saturated = if is_negative { i64::MIN } else { i64::MAX };
    let (a, b) = (a.unsigned_abs(), b.unsigned_abs());
    let (a_high, a_low) = (a >> 32, a & 0xFFFF_FFFF);
    let (b_high, b_low) = (b >> 32, b & 0xFFFF_FFFF);
    let high = a_high * b_high;
    if high >> 31 != 0 {
        // At least 2^63; exactly -2^63 is the saturated value as well.
        return saturated;
    }
    let low = a_low * b_low;
    // The upper halves are at most 2^31, so each cross product is below 2^63 and their sum does not overflow.
    let cross = a_high * b_low + a_low * b_high;
    let Some(sum) = cross.checked_add((high << 32) + (low >> 32)) else {
        return saturated;
    };
    if is_negative {
        // Toward minus infinity: what is cut off makes the magnitude larger.
        let magnitude = sum.saturating_add((low & 0xFFFF_FFFF != 0) as u64);
        if magnitude >> 63 != 0 { i64::MIN } else { -(magnitude as i64) }
    } else if sum >> 63 != 0 {
        i64::MAX
    } else {
        sum as i64
    }
}

/// floor(2^32 a / b), at least 2^63 where that is too large; 0/0 = 0.
///
/// By divisions of 64 bits and at worst 32 subtractions: the 128-bit routine of the compiler's library costs thousands
/// of instructions on a processor of 32 bits.
fn quotient(a: u64, b: u64) -> u64 {
    if a >> 32 == 0 {
        return (a << 32).checked_div(b).unwrap_or(if a == 0 { 0 } else { u64::MAX });
    }
    let (Some(whole), Some(mut rest)) = (a.checked_div(b), a.checked_rem(b)) else {
        return u64::MAX;
    };
    if whole >> 31 != 0 {
        return u64::MAX;
    }
    let mut fraction = 0;
    if b >> 32 == 0 {
        fraction = (rest << 32).checked_div(b).unwrap_or(0);
    } else {
        for _ in 0..32 {
            rest <<= 1;
            fraction <<= 1;
            if rest >= b {
                rest -= b;
                fraction |= 1;
            }
        }
    }
    (whole << 32) | fraction
}

impl Add for FixedPoint {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }
}

impl Sub for FixedPoint {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self(self.0.saturating_sub(other.0))
    }
}

impl Mul for FixedPoint {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        let (a, b) = (self.to_bits(), other.to_bits());
        Self::from_bits(if cfg!(target_pointer_width = "64") { product_whole(a, b) } else { product_by_halves(a, b) })
    }
}

impl Div for FixedPoint {
    type Output = Self;
    /// Toward zero. Division by zero saturates towards the sign of the numerator; 0/0 = 0.
    #[inline]
    fn div(self, other: Self) -> Self {
        let (a, b) = (self.to_bits(), other.to_bits());
        let magnitude = quotient(a.unsigned_abs(), b.unsigned_abs());
        Self::from_bits(if (a < 0) == (b < 0) {
            i64::try_from(magnitude).unwrap_or(i64::MAX)
        } else {
            0_i64.checked_sub_unsigned(magnitude).unwrap_or(i64::MIN)
        })
    }
}

impl Neg for FixedPoint {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self(self.0.saturating_neg())
    }
}

impl Scalar for FixedPoint {
    const ZERO: Self = Self(I32F32::ZERO);
    const ONE: Self = Self(I32F32::ONE);
    const MAX: Self = Self(I32F32::MAX);
    type Kernels<const N: usize> = Ratios;
    /// 24 fraction bits: +-128 to 6e-8, in half the memory of a number.
    type Weight = i32;
    const NO_WEIGHT: i32 = 0;
    /// exp(-22.2) is one unit in the last place.
    const NEGLIGIBLE_EXPONENT: Self = Self::constant(22.0);

    /// NaN becomes 0, values out of range saturate.
    #[inline]
    fn from_f64(value: f64) -> Self {
        let scaled = value * 4_294_967_296.0;
        // By plain arithmetic, so that a constant costs nothing where it is used. From 2^52 on there is no fraction.
        let half = if scaled.abs() >= 4_503_599_627_370_496.0 { 0.0 } else { f64::copysign(0.5, scaled) };
        // A float-to-integer cast saturates and maps NaN to 0.
        Self::from_bits((scaled + half) as i64)
    }

    fn to_f64(self) -> f64 {
        self.0.to_num()
    }

    fn exp(self) -> Self {
        const LN_2: FixedPoint = FixedPoint::constant(core::f64::consts::LN_2);
        const LOG2_E: FixedPoint = FixedPoint::constant(core::f64::consts::LOG2_E);
        // Taylor to r^9 for |r| <= ln2/2: remainder 7e-12.
        const SERIES: [FixedPoint; 10] = FixedPoint::constants([
            1.0,
            1.0,
            1.0 / 2.0,
            1.0 / 6.0,
            1.0 / 24.0,
            1.0 / 120.0,
            1.0 / 720.0,
            1.0 / 5_040.0,
            1.0 / 40_320.0,
            1.0 / 362_880.0,
        ]);
        let (n, r) = self.reduce(LN_2, LOG2_E);
        let mantissa = r.polynomial(&SERIES).0.to_bits();
        if n >= 31 {
            Self::MAX
        } else if n >= 0 {
            // The mantissa is below 2^33, so 30 places to the left cannot overflow.
            Self::from_bits(mantissa << n)
        } else if n > -34 {
            // Halves are rounded up: truncation would bias a phase that is multiplied thousands of times.
            Self::from_bits(((mantissa >> (-n - 1)) + 1) >> 1)
        } else {
            Self::ZERO
        }
    }

    #[inline]
    fn kernel(self) -> Self {
        Self::from_bits(decay(self.to_bits().unsigned_abs()))
    }

    #[inline]
    fn to_weight(self) -> Option<i32> {
        // Rounded.
        i32::try_from(self.to_bits().saturating_add(1 << (WEIGHT_SHIFT - 1)) >> WEIGHT_SHIFT).ok()
    }

    #[inline]
    fn from_weight(weight: i32) -> Self {
        Self::from_bits(i64::from(weight) << WEIGHT_SHIFT)
    }

    #[inline]
    fn add_weighted(self, kernel: Self, weight: i32) -> Self {
        // 30 fraction bits of the kernel: the product of two 32-bit numbers is one instruction.
        let product = i64::from((kernel.to_bits() >> 2) as i32) * i64::from(weight);
        self + Self::from_bits(product >> (30 - WEIGHT_SHIFT))
    }

    fn sqrt(self) -> Self {
        self.0.checked_sqrt().map_or(Self::ZERO, Self)
    }

    fn sin_cos(self) -> (Self, Self) {
        const HALF_PI: FixedPoint = FixedPoint::constant(core::f64::consts::FRAC_PI_2);
        const RECIPROCAL: FixedPoint = FixedPoint::constant(core::f64::consts::FRAC_2_PI);
        const SIN: [FixedPoint; 6] =
            FixedPoint::constants([1.0, -1.0 / 6.0, 1.0 / 120.0, -1.0 / 5_040.0, 1.0 / 362_880.0, -1.0 / 39_916_800.0]);
        const COS: [FixedPoint; 7] = FixedPoint::constants([
            1.0,
            -1.0 / 2.0,
            1.0 / 24.0,
            -1.0 / 720.0,
            1.0 / 40_320.0,
            -1.0 / 3_628_800.0,
            1.0 / 479_001_600.0,
        ]);
        let (n, r) = self.reduce(HALF_PI, RECIPROCAL);
        let r2 = r * r;
        let (sin, cos) = (r * r2.polynomial(&SIN), r2.polynomial(&COS));
        match n & 3 {
            0 => (sin, cos),
            1 => (cos, -sin),
            2 => (-sin, -cos),
            _ => (-cos, sin),
        }
    }

    fn atan2(self, x: Self) -> Self {
        const HALF_PI: FixedPoint = FixedPoint::constant(core::f64::consts::FRAC_PI_2);
        const PI: FixedPoint = FixedPoint::constant(core::f64::consts::PI);
        let (a, b) = (Scalar::abs(self), Scalar::abs(x));
        let first_octants = if a == Self::ZERO && b == Self::ZERO {
            Self::ZERO
        } else if a <= b {
            (a / b).atan_unit()
        } else {
            HALF_PI - (b / a).atan_unit()
        };
        let half_plane = if x < Self::ZERO { PI - first_octants } else { first_octants };
        if self < Self::ZERO { -half_plane } else { half_plane }
    }

    #[inline]
    fn bits(self) -> u64 {
        self.to_bits().cast_unsigned()
    }

    #[inline]
    fn is_finite(self) -> bool {
        true
    }

    #[inline]
    fn to_index(self) -> usize {
        usize::try_from(self.0.to_bits() >> 32).unwrap_or(0)
    }

    #[inline]
    fn from_index(index: usize) -> Self {
        Self(I32F32::saturating_from_num(index))
    }
}

#[cfg(test)]
mod tests {
    use super::{product_by_halves, product_whole, quotient};

    /// Numbers of all magnitudes and signs.
    fn numbers() -> impl Iterator<Item = i64> {
        let mut state = 0x9E37_79B9_7F4A_7C15_u64;
        let edges =
            [0, 1, -1, i64::MAX, i64::MIN, 1 << 32, -(1 << 32), 1 << 62, -(1 << 62), (1 << 32) - 1, i64::MIN + 1];
        edges.into_iter().chain((0..1000).map(move |k| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            state.cast_signed() >> (k % 64)
        }))
    }

    #[test]
    fn both_ways_to_multiply_give_the_same_bits() {
        for a in numbers() {
            for b in numbers() {
                assert_eq!(product_by_halves(a, b), product_whole(a, b), "{a} x {b}");
            }
        }
    }

    #[test]
    fn a_quotient_is_that_of_wide_integers() {
        for a in numbers().map(i64::unsigned_abs) {
            for b in numbers().map(i64::unsigned_abs).filter(|b| *b != 0) {
                let exact = (u128::from(a) << 32) / u128::from(b);
                let found = u128::from(quotient(a, b));
                assert!(found == exact || (found >> 63 != 0 && exact >> 63 != 0), "{a} / {b}: {found} and {exact}");
            }
        }
    }
}
