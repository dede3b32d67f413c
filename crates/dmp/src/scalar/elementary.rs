//! `FixedPoint` as [`Scalar`]: elementary functions by polynomials, kernels and weights in 32-bit integers.

use ::fixed::types::I32F32;

use super::exponential::decay;
use super::ratios::Ratios;
use super::{FixedPoint, Scalar};

/// Fraction bits that a number has beyond a weight.
const WEIGHT_SHIFT: u32 = 8;

impl FixedPoint {
    /// Polynomial with the constant term first.
    fn polynomial(self, coefficients: &[Self]) -> Self {
        coefficients.iter().rev().fold(Self::ZERO, |sum, &c| sum * self + c)
    }

    /// Nearest integer, with the remainder `self - n * unit` for the given unit and its reciprocal.
    fn reduce(self, unit: Self, reciprocal: Self) -> (i64, Self) {
        let n = (self * reciprocal).get().saturating_round();
        (n.to_bits() >> 32, self - Self::new(n) * unit)
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

impl Scalar for FixedPoint {
    const ZERO: Self = Self::new(I32F32::ZERO);
    const ONE: Self = Self::new(I32F32::ONE);
    const MAX: Self = Self::new(I32F32::MAX);
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
        self.get().to_num()
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
        let mantissa = r.polynomial(&SERIES).to_bits();
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
        self.get().checked_sqrt().map_or(Self::ZERO, Self::new)
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
        usize::try_from(self.to_bits() >> 32).unwrap_or(0)
    }

    #[inline]
    fn from_index(index: usize) -> Self {
        Self::new(I32F32::saturating_from_num(index))
    }
}
