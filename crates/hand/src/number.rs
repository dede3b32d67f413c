//! `Number`, the fixed-point number of the control path, and what it lacks for that path.
//!
//! 64 bits, 32 of them behind the point ([`dmp::FixedPoint`]): range +-2.1e9, resolution 2.3e-10, every operation
//! saturates and none wraps (`docs/decisions/0050-numbers-of-the-hand-image.md`).

use dmp::{FixedPoint, Scalar};

/// A number of the control path.
pub type Number = FixedPoint;

/// 0.
pub const ZERO: Number = Number::ZERO;

/// 1.
pub const ONE: Number = Number::ONE;

/// Bits behind the point.
pub const FRACTION_BITS: u32 = 32;

/// A constant of the program.
pub const fn constant(value: f64) -> Number {
    Number::constant(value)
}

/// Constants of the program.
pub const fn constants<const N: usize>(values: [f64; N]) -> [Number; N] {
    let mut numbers = [ZERO; N];
    let mut index = 0;
    while index < N {
        numbers[index] = constant(values[index]);
        index += 1;
    }
    numbers
}

/// A whole number.
pub const fn whole(value: i32) -> Number {
    Number::from_bits((value as i64) << FRACTION_BITS)
}

/// `value` cut to `-limit..=limit`; `limit` is not negative.
pub fn within(value: Number, limit: Number) -> Number {
    at_least(at_most(value, limit), -limit)
}

/// The smaller one.
pub fn at_most(value: Number, limit: Number) -> Number {
    if value > limit { limit } else { value }
}

/// The larger one.
pub fn at_least(value: Number, limit: Number) -> Number {
    if value < limit { limit } else { value }
}

/// |value|.
pub fn magnitude(value: Number) -> Number {
    Scalar::abs(value)
}

/// `part / whole` for a part that is not larger than the whole in magnitude, to 31 bits; 0 where the whole is not
/// positive.
///
/// One division of 64 by 32 bits, where the general one of the type needs 128.
pub fn share(part: Number, whole: Number) -> Number {
    let (bits, whole_bits) = (part.to_bits().unsigned_abs(), whole.to_bits());
    if whole_bits <= 0 {
        return ZERO;
    }
    let whole_bits = whole_bits.unsigned_abs();
    if bits >= whole_bits {
        return if part < ZERO { -ONE } else { ONE };
    }
    // Both moved right alike until the divisor has 32 bits: what falls off is 2^-31 of the divisor.
    let surplus = FRACTION_BITS.saturating_sub(whole_bits.leading_zeros());
    let (bits, divisor) = (bits >> surplus, (whole_bits >> surplus) & 0xFFFF_FFFF);
    let quotient = (bits << FRACTION_BITS).checked_div(divisor).unwrap_or(0).min(1 << FRACTION_BITS);
    let result = Number::from_bits(quotient.cast_signed());
    if part < ZERO { -result } else { result }
}

/// The value as a real number for people, off the control path, in the single precision of telemetry.
pub fn real(value: Number) -> f32 {
    value.to_f64() as f32
}

/// The number nearest to a real one, off the control path. Saturates; NaN becomes 0.
pub fn from_real(value: f32) -> Number {
    Number::from_f64(f64::from(value))
}
