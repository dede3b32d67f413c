//! `decay`: `exp(-x)` in 32-bit integers, the kernel function of Eq (2) and the phase of Eq (3) in fixed point.
//!
//! `exp(-x) = 2^-n 2^-(i/32) exp(-t)` with `t < ln 2 / 32`: a shift, a table and a polynomial. Error below 2e-9, some
//! 40 instructions on a Cortex-M3.

/// Fraction bits of table and polynomial.
const BITS: u32 = 31;

/// 1 in these bits.
const ONE: u32 = 1 << BITS;

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

/// Rounded product of two values with [`BITS`] fraction bits, each at most 1.
const fn product(a: u32, b: u32) -> u32 {
    ((a as u64 * b as u64 + (1 << (BITS - 1))) >> BITS) as u32
}

/// `exp(-x)` for `x` below 2^31, both in units of 2^-32.
#[inline]
pub(super) fn decay(x: u64) -> i64 {
    // y = x log2(e), 32 fraction bits.
    let y = (((x & 0xFFFF_FFFF) * LOG2_E) >> BITS) + (x >> 32) * (LOG2_E << 1);
    let halvings = y >> 32;
    let fraction = y as u32;
    let place = (fraction >> (32 - TABLE_BITS)) as usize;
    // t = rest ln 2 below 0.0217; the rest with all 32 bits, so that nothing of it is lost.
    let rest = fraction << TABLE_BITS;
    let t = ((u64::from(rest) * LN_2) >> (32 + TABLE_BITS + 32 - BITS)) as u32;
    let inner = ONE - t / 4;
    let inner = ONE - product(product(t, THIRD), inner);
    let inner = ONE - product(t, inner) / 2;
    let inner = ONE - product(t, inner);
    let Some(entry) = TABLE.get(place) else {
        return 0;
    };
    let mantissa = product(*entry, inner);
    match halvings {
        0 => i64::from(mantissa) << 1,
        1 => i64::from(mantissa),
        // Halves are rounded up: cutting would bias every kernel downward.
        2..=33 => i64::from(((mantissa >> (halvings - 2)) + 1) >> 1),
        _ => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::decay;

    /// 1 in the units of [`decay`].
    const UNIT: f64 = 4_294_967_296.0;

    #[test]
    fn decay_is_the_exponential_to_two_billionths() {
        let mut worst = 0.0_f64;
        for step in 0..1_000_000_u64 {
            let x = step * 137_438;
            let exact = libm::exp(-(x as f64) / UNIT);
            worst = worst.max((decay(x) as f64 / UNIT - exact).abs());
        }
        assert!(worst < 2e-9, "{worst:e}");
        assert_eq!(decay(0), 1 << 32);
        assert_eq!(decay(32 << 32), 0, "exp(-32) is below the resolution");
        assert_eq!(decay((1 << 63) - 1), 0);
    }

    #[test]
    fn decay_never_rises() {
        let mut last = 1 << 32;
        for x in (0..32_u64 << 32).step_by(31_904) {
            let value = decay(x);
            assert!(value <= last, "at {x}");
            last = value;
        }
    }
}
