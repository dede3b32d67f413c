//! `Forcing`: Eq (2) for the four rows of the hand, in 32-bit weights and kernels.
//!
//! Centres lie at `c_i = exp(-alpha i/(N-1))` and the widths follow their distances, so the exponent of a kernel
//! depends on the ratio `E_i = s/c_i = exp(alpha (u_i - u))` alone: `h_i (s - c_i)^2 = (r (E_i - 1))^2` with one `r`
//! for all kernels but the last (which repeats the width before it, hence `r exp(-delta)`). `E_i` goes from kernel to
//! kernel by a constant factor `exp(+-delta)`, `delta = alpha/(N-1)`. So a tick needs one exponential for the kernel at
//! hand, one product per neighbour, and an exponential for each kernel that counts: 22 below the largest exponent none
//! does.
//!
//! | quantity | integer | range | resolution |
//! |---|---|---|---|
//! | weight | i32, 24 fraction bits | +-128 rad | 6e-8 rad |
//! | ratio `E` | u32, 27 (20 for the fewest kernels) | 0 to 16 (2048), saturating | 7e-9 (1e-6) |
//! | `r (E - 1)` | i32, 24 | +-128, saturating | 6e-8 |
//! | exponent | u64, 48 | 0 to 16 384 | 4e-15 |
//! | kernel | u32, 24 | 0 to 1 | 6e-8 |
//! | sum of products | i64, 48 | 100 kernels x 1 x 128 < 2^63 | |

use dmp::Scalar;

use crate::exponential::{DECAY_BITS, EXPONENT_BITS, decay};
use crate::number::{FRACTION_BITS, Number, ONE, ZERO};
use crate::{DIGITS, KERNELS};

/// Fraction bits of a weight and of `r (E - 1)`.
const WEIGHT_BITS: u32 = 24;

/// Fraction bits of a ratio: the most, and the fewest that few and wide kernels may need.
const RATIO_BITS: core::ops::RangeInclusive<u32> = 20..=27;

/// Largest ratio as an integer. The fraction bits are chosen so that it is [`FAR`] from every kernel.
const RATIO_LIMIT: u64 = i32::MAX as u64;

/// `r (E - 1)` beyond which no kernel counts, whatever the nearest one has: 36 is well above 22.
const FAR: f64 = 6.0;

/// Fraction bits of a kernel.
const KERNEL_BITS: u32 = 24;

/// Fraction bits of an exponent.
const EXPONENT_SQUARE_BITS: u32 = 2 * WEIGHT_BITS;

/// Exponents this far above the smallest are left out: exp(-22) is 3e-10.
const NEGLIGIBLE: u64 = 22 << EXPONENT_SQUARE_BITS;

/// Longest decay that is computed, exp(-31); the phase is 0 beyond.
const LONGEST_DECAY: f64 = 31.0;

/// Largest `r`: beyond, the integers above do not suffice.
const LARGEST_ROOT_WIDTH: f64 = 126.0;

/// What all kernels have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Basis {
    count: u16,
    alpha: Number,
    /// N - 1.
    intervals: Number,
    /// 1/(N - 1).
    spacing: Number,
    /// Fraction bits of a ratio.
    ratio_bits: u32,
    /// exp(delta), `ratio_bits`.
    rise: u32,
    /// exp(-delta), [`DECAY_BITS`].
    fall: u32,
    /// `r`, [`WEIGHT_BITS`]; of the last kernel.
    root_width: i32,
    last_root_width: i32,
}

impl Basis {
    /// No kernels: no force.
    pub const EMPTY: Basis = Basis {
        count: 0,
        alpha: ZERO,
        intervals: ZERO,
        spacing: ZERO,
        ratio_bits: 0,
        rise: 0,
        fall: 0,
        root_width: 0,
        last_root_width: 0,
    };

    /// `count` kernels with decay `alpha` and `activation` at the next centre; `None` for a basis that is none, or that
    /// the integers cannot hold. Computes in floating point: at upload, never on the control path.
    pub fn new(count: usize, alpha: f64, activation: f64) -> Option<Basis> {
        let sound =
            (2..=KERNELS).contains(&count) && (2.3..=13.82).contains(&alpha) && (0.05..=0.95).contains(&activation);
        if !sound {
            return None;
        }
        let intervals = i32::try_from(count - 1).ok()?;
        let delta = alpha / f64::from(intervals);
        let (rise, fall) = (libm::exp(delta), libm::exp(-delta));
        let root_width = libm::sqrt(-libm::log(activation)) / (1.0 - fall);
        if root_width > LARGEST_ROOT_WIDTH {
            return None;
        }
        // The last kernel is the widest for its ratio.
        let farthest = rise + FAR / (root_width * fall);
        let holds = |bits: u32| farthest < RATIO_LIMIT as f64 / f64::from(1_u32 << bits);
        let ratio_bits = RATIO_BITS.rev().find(|bits| holds(*bits))?;
        let scaled = |value: f64, bits: u32| libm::rint(libm::ldexp(value, bits.cast_signed()));
        Some(Basis {
            count: u16::try_from(count).ok()?,
            alpha: Number::from_f64(alpha),
            intervals: crate::number::whole(intervals),
            spacing: Number::from_f64(1.0 / f64::from(intervals)),
            ratio_bits,
            rise: scaled(rise, ratio_bits) as u32,
            fall: scaled(fall, DECAY_BITS) as u32,
            root_width: scaled(root_width, WEIGHT_BITS) as i32,
            last_root_width: scaled(root_width * fall, WEIGHT_BITS) as i32,
        })
    }

    /// Kernels of each row.
    pub fn count(&self) -> usize {
        usize::from(self.count)
    }

    /// `exp(-alpha u)` with [`DECAY_BITS`]; `u` is not negative.
    fn decayed(&self, u: Number) -> u32 {
        let x = self.alpha * u;
        if x > Number::constant(LONGEST_DECAY) {
            return 0;
        }
        // Below 31 with 27 bits: it fits.
        decay((x.to_bits() >> (FRACTION_BITS - EXPONENT_BITS)) as u32)
    }

    /// The phase `s` at progress `u`.
    pub fn phase(&self, u: Number) -> Number {
        let bits = self.decayed(if u > ZERO { u } else { ZERO });
        Number::from_bits(i64::from(bits) << (FRACTION_BITS - DECAY_BITS))
    }

    /// Exponent of kernel `index` at the ratio `E`.
    fn exponent(&self, index: usize, ratio: u32) -> u64 {
        let root = if index + 1 == self.count() { self.last_root_width } else { self.root_width };
        let distance = i64::from(ratio) - (1 << self.ratio_bits);
        let z = (i64::from(root) * distance) >> self.ratio_bits;
        // Up to 126 x 2048: cut to what a square of 32 bits can hold. Nothing above 5 sigma counts anyway.
        let z = z.clamp(-i64::from(i32::MAX), i64::from(i32::MAX));
        (z * z).unsigned_abs()
    }
}

/// Eq (2) at one progress: `f` of each row (rad), spread first.
pub fn evaluate(basis: &Basis, weights: &[[i32; DIGITS]; KERNELS], u: Number) -> [Number; DIGITS] {
    let count = basis.count();
    if count == 0 {
        return [ZERO; DIGITS];
    }
    let u = if u > ZERO { u } else { ZERO };
    // The kernel whose centre has just been passed: its ratio is at most 1.
    let passed = (u * basis.intervals).to_index().min(count - 1);
    let since = u - crate::number::whole(i32::try_from(passed).unwrap_or(0)) * basis.spacing;
    let ratio = basis.decayed(if since > ZERO { since } else { ZERO }) >> (DECAY_BITS - basis.ratio_bits);

    let mut exponents = [0_u64; KERNELS];
    let mut smallest = basis.exponent(passed, ratio);
    let mut put = |index: usize, exponent: u64| {
        if let Some(place) = exponents.get_mut(index) {
            *place = exponent;
        }
        smallest = smallest.min(exponent);
        exponent - smallest <= NEGLIGIBLE
    };
    put(passed, basis.exponent(passed, ratio));
    let (mut first, mut end) = (passed, passed + 1);
    let mut falling = ratio;
    while first > 0 {
        falling = ((u64::from(falling) * u64::from(basis.fall)) >> DECAY_BITS) as u32;
        if !put(first - 1, basis.exponent(first - 1, falling)) {
            break;
        }
        first -= 1;
    }
    let mut rising = ratio;
    while end < count {
        rising = ((u64::from(rising) * u64::from(basis.rise)) >> basis.ratio_bits).min(RATIO_LIMIT) as u32;
        if !put(end, basis.exponent(end, rising)) {
            break;
        }
        end += 1;
    }

    let mut sums = [0_i64; DIGITS];
    let mut total = 0_u32;
    let active = exponents.get(first..end).unwrap_or(&[]).iter();
    for (exponent, weights) in active.zip(weights.get(first..end).unwrap_or(&[])) {
        let above = exponent.saturating_sub(smallest);
        if above > NEGLIGIBLE {
            continue;
        }
        let kernel = decay((above >> (EXPONENT_SQUARE_BITS - EXPONENT_BITS)) as u32) >> (DECAY_BITS - KERNEL_BITS);
        total += kernel;
        for (sum, weight) in sums.iter_mut().zip(weights) {
            *sum += i64::from(kernel) * i64::from(*weight);
        }
    }
    // s over the sum of kernels, of which the nearest is 1: at most 1.
    let phase = u64::from(basis.decayed(u));
    let scale = (phase << (FRACTION_BITS - DECAY_BITS + KERNEL_BITS)).checked_div(u64::from(total)).unwrap_or(0);
    let scale = Number::from_bits(scale.cast_signed());
    let scale = if scale > ONE { ONE } else { scale };
    sums.map(|sum| Number::from_bits(sum >> (KERNEL_BITS + WEIGHT_BITS - FRACTION_BITS)) * scale)
}

/// A weight as it is stored; `None` beyond +-128 rad or for what is no number.
pub fn weight(value: f32) -> Option<i32> {
    let scaled = libm::rint(libm::ldexp(f64::from(value), WEIGHT_BITS.cast_signed()));
    // A NaN fails both comparisons.
    (scaled > f64::from(i32::MIN) && scaled < f64::from(i32::MAX)).then_some(scaled as i32)
}
