//! The number type of the control code: f32 on the arm board, f64 on the host and in tests.

use nalgebra::RealField;

/// A real number that the control code can compute with.
///
/// Transcendental functions come from here and not from `RealField`, because on the board each of them has to be the
/// measured cheap one: `f32` uses its own sine and cosine (7.6e-8 on one turn) and the FPU's square root.
pub trait Real: RealField + Copy + dmp::Scalar<Weight = Self> + puck::Real {
    /// The nearest value to `value`. For constants; not meant for inner loops on the board.
    #[inline]
    fn constant(value: f64) -> Self {
        <Self as dmp::Scalar>::from_f64(value)
    }

    /// As `f32`, for records.
    #[inline]
    fn single(self) -> f32 {
        dmp::Scalar::to_f64(self) as f32
    }

    /// From a whole number of counts; exact for |counts| < 2^24.
    #[inline]
    fn from_counts(counts: i32) -> Self {
        <Self as puck::Real>::from_i32(counts)
    }

    /// Neither infinite nor a NaN.
    #[inline]
    fn is_finite_number(self) -> bool {
        dmp::Scalar::is_finite(self)
    }

    /// Sine and cosine.
    fn sine_cosine(self) -> (Self, Self);

    /// The largest whole number not above it, saturating; zero for a NaN.
    fn to_whole(self) -> i32;
}

impl Real for f32 {
    /// Two-step reduction by quarter turns, then polynomials; 7.6e-8 on [-pi, pi]. `libm` costs fifty times as much on
    /// a Cortex-M4F because it computes in f64.
    #[inline]
    fn sine_cosine(self) -> (Self, Self) {
        let quarters = self * core::f32::consts::FRAC_2_PI;
        let quadrant = (quarters + if quarters < 0.0 { -0.5 } else { 0.5 }) as i32;
        let n = quadrant as f32;
        let r = (self - n * 1.570_796_4) - n * -4.371_139e-8;
        let z = r * r;
        let sine = ((-1.951_529_6e-4 * z + 8.332_161e-3) * z - 1.666_665_5e-1) * z * r + r;
        let cosine = ((2.443_315_7e-5 * z - 1.388_731_6e-3) * z + 4.166_664_6e-2) * z * z - 0.5 * z + 1.0;
        match quadrant & 3 {
            0 => (sine, cosine),
            1 => (cosine, -sine),
            2 => (-sine, -cosine),
            _ => (-cosine, sine),
        }
    }

    /// micromath's floor is exact and needs no call into libm.
    #[inline]
    fn to_whole(self) -> i32 {
        micromath::F32Ext::floor(self) as i32
    }
}

impl Real for f64 {
    #[inline]
    fn sine_cosine(self) -> (Self, Self) {
        libm::sincos(self)
    }

    #[inline]
    fn to_whole(self) -> i32 {
        libm::floor(self) as i32
    }
}

/// Square root. Two of the traits of a [`Real`] have one by this name.
#[inline]
pub(crate) fn sqrt<R: Real>(value: R) -> R {
    <R as dmp::Scalar>::sqrt(value)
}

/// The larger of two numbers; `bound` for a NaN.
#[inline]
pub(crate) fn at_least<R: Real>(value: R, bound: R) -> R {
    if value > bound { value } else { bound }
}

/// The smaller of two numbers; `bound` for a NaN.
#[inline]
pub(crate) fn at_most<R: Real>(value: R, bound: R) -> R {
    if value < bound { value } else { bound }
}

/// `value` within plus or minus `bound`; `-bound` for a NaN.
#[inline]
pub(crate) fn within<R: Real>(value: R, bound: R) -> R {
    at_most(at_least(value, -bound), bound)
}
