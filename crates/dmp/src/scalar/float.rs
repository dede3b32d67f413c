//! f64 and f32 as [`Scalar`]: `libm` plus two routines of our own.
//!
//! `libm::sincosf` computes in f64, which a Cortex-M with a single-precision FPU emulates in software, and the
//! general `exp` branches and divides. Both are replaced here by polynomials.

use super::Scalar;
use super::kernels::Tabulated;

/// log2(e).
const LOG2_E: f64 = core::f64::consts::LOG2_E;

impl Scalar for f64 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    const MAX: Self = f64::MAX;
    type Kernels<const N: usize> = Tabulated<Self, N>;
    type Weight = Self;
    const NO_WEIGHT: Self = 0.0;
    const NEGLIGIBLE_EXPONENT: Self = 37.0;

    #[inline]
    fn to_weight(self) -> Option<Self> {
        self.is_finite().then_some(self)
    }

    #[inline]
    fn from_weight(weight: Self) -> Self {
        weight
    }

    #[inline]
    fn add_weighted(self, kernel: Self, weight: Self) -> Self {
        self + kernel * weight
    }

    #[inline]
    fn from_f64(value: f64) -> Self {
        value
    }

    #[inline]
    fn to_f64(self) -> f64 {
        self
    }

    #[inline]
    fn exp(self) -> Self {
        libm::exp(self)
    }

    #[inline]
    fn kernel(self) -> Self {
        // 2^52 + 2^51: adding it rounds to an integer that ends up in the low bits of the mantissa.
        const ROUND: f64 = 6_755_399_441_055_744.0;
        const LN2_HIGH: f64 = 6.931_471_803_691_238e-1;
        const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;
        let shifted = ROUND - self * LOG2_E;
        let n = shifted - ROUND;
        let r = (-self - n * LN2_HIGH) - n * LN2_LOW;
        // exp(r) for |r| <= ln2/2; Taylor to r^12, remainder below 2e-16. Even and odd halves run in parallel.
        let r2 = r * r;
        let even = 1.0
            + r2 * (1.0 / 2.0
                + r2 * (1.0 / 24.0
                    + r2 * (1.0 / 720.0
                        + r2 * (1.0 / 40_320.0 + r2 * (1.0 / 3_628_800.0 + r2 * (1.0 / 479_001_600.0))))));
        let odd = 1.0
            + r2 * (1.0 / 6.0
                + r2 * (1.0 / 120.0 + r2 * (1.0 / 5_040.0 + r2 * (1.0 / 362_880.0 + r2 * (1.0 / 39_916_800.0)))));
        // 2^n by its exponent bits: the low mantissa bits of `shifted` hold n.
        let scale = f64::from_bits(shifted.to_bits().wrapping_add(1023) << 52);
        (even + r * odd) * scale
    }

    #[inline]
    fn sqrt(self) -> Self {
        libm::sqrt(self)
    }

    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        libm::sincos(self)
    }

    #[inline]
    fn atan2(self, x: Self) -> Self {
        libm::atan2(self, x)
    }

    #[inline]
    fn abs(self) -> Self {
        f64::abs(self)
    }

    #[inline]
    fn is_finite(self) -> bool {
        f64::is_finite(self)
    }

    #[inline]
    fn to_index(self) -> usize {
        self as usize
    }

    #[inline]
    fn from_index(index: usize) -> Self {
        index as f64
    }
}

impl Scalar for f32 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    const MAX: Self = f32::MAX;
    type Kernels<const N: usize> = Tabulated<Self, N>;
    type Weight = Self;
    const NO_WEIGHT: Self = 0.0;
    const NEGLIGIBLE_EXPONENT: Self = 20.0;

    #[inline]
    fn to_weight(self) -> Option<Self> {
        self.is_finite().then_some(self)
    }

    #[inline]
    fn from_weight(weight: Self) -> Self {
        weight
    }

    #[inline]
    fn add_weighted(self, kernel: Self, weight: Self) -> Self {
        self + kernel * weight
    }

    #[inline]
    fn from_f64(value: f64) -> Self {
        value as f32
    }

    #[inline]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }

    #[inline]
    fn exp(self) -> Self {
        libm::expf(self)
    }

    #[inline]
    fn kernel(self) -> Self {
        // 2^23 + 2^22, see the f64 version.
        const ROUND: f32 = 12_582_912.0;
        const LN2_HIGH: f32 = 6.931_457_5e-1;
        const LN2_LOW: f32 = 1.428_606_8e-6;
        let shifted = ROUND - self * core::f32::consts::LOG2_E;
        let n = shifted - ROUND;
        let r = (-self - n * LN2_HIGH) - n * LN2_LOW;
        // Taylor to r^7, remainder below 6e-9.
        let r2 = r * r;
        let even = 1.0 + r2 * (1.0 / 2.0 + r2 * (1.0 / 24.0 + r2 * (1.0 / 720.0)));
        let odd = 1.0 + r2 * (1.0 / 6.0 + r2 * (1.0 / 120.0 + r2 * (1.0 / 5_040.0)));
        let scale = f32::from_bits(shifted.to_bits().wrapping_add(127) << 23);
        (even + r * odd) * scale
    }

    #[inline]
    fn sqrt(self) -> Self {
        libm::sqrtf(self)
    }

    fn sin_cos(self) -> (Self, Self) {
        // pi/2 in three parts of which the first two have trailing zeros: n * part is exact for |n| < 2^10.
        const PART_1: f32 = 1.570_312_5;
        const PART_2: f32 = 4.837_513e-4;
        const PART_3: f32 = 7.549_79e-8;
        let n = libm::rintf(self * core::f32::consts::FRAC_2_PI);
        // Within pi/4, but for angles of more than about 1000, whose place in the turn is lost: the result stays near
        // the circle.
        let r = (((self - n * PART_1) - n * PART_2) - n * PART_3).clamp(-0.8, 0.8);
        let r2 = r * r;
        let sin = r * (1.0 - r2 * (1.0 / 6.0 - r2 * (1.0 / 120.0 - r2 * (1.0 / 5_040.0 - r2 * (1.0 / 362_880.0)))));
        let cos = 1.0 - r2 * (1.0 / 2.0 - r2 * (1.0 / 24.0 - r2 * (1.0 / 720.0 - r2 * (1.0 / 40_320.0))));
        // NaN and infinity end up here as NaN values with quadrant 0.
        match (n as i32) & 3 {
            0 => (sin, cos),
            1 => (cos, -sin),
            2 => (-sin, -cos),
            _ => (-cos, sin),
        }
    }

    #[inline]
    fn atan2(self, x: Self) -> Self {
        libm::atan2f(self, x)
    }

    #[inline]
    fn abs(self) -> Self {
        f32::abs(self)
    }

    #[inline]
    fn bits(self) -> u64 {
        self.to_bits().into()
    }

    #[inline]
    fn is_finite(self) -> bool {
        f32::is_finite(self)
    }

    #[inline]
    fn to_index(self) -> usize {
        self as usize
    }

    #[inline]
    fn from_index(index: usize) -> Self {
        index as f32
    }
}
