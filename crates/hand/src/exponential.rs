//! `decay`: `exp(-x)` in 32-bit integers, the kernel function of Eq (2) and the phase of Eq (3).
//!
//! `exp(-x) = 2^-n 2^-(i/32) exp(-t)` with `t < ln 2 / 32`: a shift, a table and a cubic. Error below 1e-8, some 30
//! instructions on a Cortex-M3.

/// Fraction bits of the exponent that [`decay`] takes.
pub(crate) const EXPONENT_BITS: u32 = 27;

/// Fraction bits of the value that [`decay`] gives.
pub(crate) const DECAY_BITS: u32 = 31;

/// 1 as a value of [`decay`].
pub(crate) const DECAY_ONE: u32 = 1 << DECAY_BITS;

/// log2(e), 31 fraction bits.
const LOG2_E: u64 = (core::f64::consts::LOG2_E * 2_147_483_648.0) as u64;

/// ln(2), 32 fraction bits.
const LN_2: u64 = (core::f64::consts::LN_2 * 4_294_967_296.0) as u64;

/// 1/3, 31 fraction bits.
const THIRD: u32 = 0x2AAA_AAAB;

/// Bits of the place in the table.
const TABLE_BITS: u32 = 5;

/// 2^(-i/32), 31 fraction bits.
const TABLE: [u32; 1 << TABLE_BITS] = table();

const fn table() -> [u32; 1 << TABLE_BITS] {
    /// 2^(-1/32).
    const ROOT: f64 = 0.978_572_062_087_700_1;
    let mut entries = [0; 1 << TABLE_BITS];
    let mut value = 2_147_483_648.0;
    let mut index = 0;
    while index < entries.len() {
        entries[index] = (value + 0.5) as u32;
        value *= ROOT;
        index += 1;
    }
    entries
}

/// Product of two values with 31 fraction bits, each at most 1.
const fn product(a: u32, b: u32) -> u32 {
    ((a as u64 * b as u64) >> DECAY_BITS) as u32
}

/// `exp(-x)`; `x` with [`EXPONENT_BITS`] fraction bits (0 to 32), the value with [`DECAY_BITS`].
#[inline]
pub(crate) fn decay(x: u32) -> u32 {
    // y = x log2(e) < 46.2: 27 fraction bits in 33 bits and more.
    let y = (u64::from(x) * LOG2_E) >> 31;
    let halvings = (y >> EXPONENT_BITS) as u32;
    let fraction = y as u32 & ((1 << EXPONENT_BITS) - 1);
    let place = (fraction >> (EXPONENT_BITS - TABLE_BITS)) as usize;
    let rest = fraction & ((1 << (EXPONENT_BITS - TABLE_BITS)) - 1);
    // t = rest ln 2, 31 fraction bits, below 0.0217.
    let t = ((u64::from(rest) * LN_2) >> 28) as u32;
    let inner = DECAY_ONE - product(t, THIRD);
    let inner = DECAY_ONE - product(t, inner) / 2;
    let inner = DECAY_ONE - product(t, inner);
    let Some(entry) = TABLE.get(place) else {
        return 0;
    };
    let mantissa = product(*entry, inner);
    match halvings {
        0 => mantissa,
        // Halves are rounded up: cutting would bias every kernel downward.
        1..=31 => ((mantissa >> (halvings - 1)) + 1) >> 1,
        _ => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decay_is_the_exponential_to_a_hundred_millionth() {
        let mut worst = 0.0_f64;
        for step in 0..1_000_000_u32 {
            let x = step * 4294;
            let exact = libm::exp(-f64::from(x) / f64::from(1 << EXPONENT_BITS));
            worst = worst.max((f64::from(decay(x)) / f64::from(DECAY_ONE) - exact).abs());
        }
        assert!(worst < 1e-8, "{worst:e}");
        assert_eq!(decay(0), DECAY_ONE);
        assert_eq!(decay(u32::MAX), 0, "exp(-32) is below the resolution");
    }

    #[test]
    fn decay_never_rises() {
        let mut last = DECAY_ONE;
        for x in (0..=u32::MAX).step_by(997) {
            let value = decay(x);
            assert!(value <= last, "at {x}");
            last = value;
        }
    }
}
