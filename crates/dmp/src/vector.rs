//! Small-vector helpers shared by the systems; three components unless said otherwise.

use crate::Scalar;

/// a . b
#[inline]
pub(crate) fn dot<T: Scalar, const D: usize>(a: &[T; D], b: &[T; D]) -> T {
    let mut sum = T::ZERO;
    for (a, b) in a.iter().zip(b) {
        sum = sum + *a * *b;
    }
    sum
}

/// a x b
#[inline]
pub(crate) fn cross<T: Scalar>(a: &[T; 3], b: &[T; 3]) -> [T; 3] {
    let ([a0, a1, a2], [b0, b1, b2]) = (*a, *b);
    [a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0]
}

/// k a
#[inline]
pub(crate) fn scale<T: Scalar, const D: usize>(a: &[T; D], k: T) -> [T; D] {
    a.map(|a| a * k)
}

/// `a`, its norm and a factor: both are larger than they should be by this power of two, 1 unless `a` is short.
///
/// In fixed point the square of 1e-4 has two digits and that of 1e-5 has none, and with the norm every direction made
/// from it would be wrong. A power of two changes nothing in a floating-point number.
pub(crate) fn lifted_norm<T: Scalar>(a: &[T; 3]) -> ([T; 3], T, T) {
    let (short, factor) = (T::from_f64(1e-4), T::from_f64(1_048_576.0));
    let square = dot(a, a);
    if square >= short {
        return (*a, T::sqrt(square), T::ONE);
    }
    let lifted = scale(a, factor);
    (lifted, T::sqrt(dot(&lifted, &lifted)), factor)
}

/// `a` shortened to the norm `limit` (not negative) if it is longer; 0 if it is not a number.
pub(crate) fn clamp_norm<T: Scalar>(a: &[T; 3], limit: T) -> [T; 3] {
    // The largest component first: squares of large values would overflow in f32 and fixed point.
    let mut largest = T::ZERO;
    for a in a {
        if !a.is_finite() {
            return [T::ZERO; 3];
        }
        if a.abs() > largest {
            largest = a.abs();
        }
    }
    // The norm is at most sqrt(3) times the largest component.
    if largest + largest <= limit {
        return *a;
    }
    let reciprocal = T::ONE / largest;
    if !(reciprocal < T::MAX) {
        // So small a value (below 3e-39 in f32) has no reciprocal, and the limit is even smaller.
        return [T::ZERO; 3];
    }
    let unit = scale(a, reciprocal);
    let norm = T::sqrt(dot(&unit, &unit));
    if largest * norm > limit { scale(&unit, limit / norm) } else { *a }
}

/// `a` limited to [-limit, limit]; 0 if it is not a number.
#[inline]
pub(crate) fn clamp<T: Scalar>(a: T, limit: T) -> T {
    if !a.is_finite() {
        T::ZERO
    } else if a > limit {
        limit
    } else if a < -limit {
        -limit
    } else {
        a
    }
}

/// True if all components are numbers.
#[inline]
pub(crate) fn all_finite<T: Scalar>(values: &[T]) -> bool {
    values.iter().all(|v| v.is_finite())
}
