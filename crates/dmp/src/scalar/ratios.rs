//! `Ratios`: the kernels of Eq. (2) in 32-bit integers, without a table of centres and widths.
//!
//! Centres lie at `c_i = exp(-alpha i/(N-1))` and the widths follow their distances, so the exponent of a kernel
//! depends on the ratio `E_i = s/c_i` alone: `h_i (s - c_i)^2 = (r (E_i - 1))^2` with one `r` for all kernels but the
//! last (which repeats the width before it, hence `r exp(-delta)`). `E_i` goes from kernel to kernel by a constant
//! factor `exp(+-delta)`, `delta = alpha/(N-1)`. So a tick needs one division for the kernel at hand, one product per
//! neighbour, and an exponential for each kernel that counts: 22 below the largest exponent none does.
//!
//! | quantity | integer | range | resolution |
//! |---|---|---|---|
//! | ratio `E` | u32, 27 (20 for the fewest kernels) | 0 to 16 (2048), saturating | 7e-9 (1e-6) |
//! | `r (E - 1)` | i32, 24 | +-128, saturating | 6e-8 |
//! | exponent | u64, 48 | 0 to 16 384 | 4e-15 |

use super::exponential::decay;
use super::kernels::Kernels;
use super::{FixedPoint, Scalar};

/// Fraction bits of `r (E - 1)`.
const ROOT_BITS: u32 = 24;

/// Fraction bits of a ratio: the most, and the fewest that few and wide kernels may need.
const RATIO_BITS: core::ops::RangeInclusive<u32> = 20..=27;

/// Largest ratio as an integer. The fraction bits are chosen so that it is [`FAR`] from every kernel.
const RATIO_LIMIT: u64 = i32::MAX as u64;

/// `r (E - 1)` beyond which no kernel counts, whatever the nearest one has: 36 is well above 22.
const FAR: f64 = 6.0;

/// Fraction bits of the factor from a ratio to the next lower one.
const FALL_BITS: u32 = 31;

/// Exponents this far above the smallest are left out: exp(-22) is 3e-10.
const NEGLIGIBLE: u64 = 22 << (2 * ROOT_BITS);

/// Largest `r`: beyond, the integers above do not suffice.
const LARGEST_ROOT_WIDTH: f64 = 126.0;

/// Kernels by what all of them have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ratios {
    count: usize,
    /// `delta`.
    spacing: FixedPoint,
    /// Kernels while the phase falls to one half, ln(2)/`delta`.
    per_octave: FixedPoint,
    /// Fraction bits of a ratio.
    ratio_bits: u32,
    /// exp(delta), `ratio_bits`.
    rise: u32,
    /// exp(-delta), [`FALL_BITS`].
    fall: u32,
    /// `r`, [`ROOT_BITS`]; of the last kernel.
    root_width: i32,
    last_root_width: i32,
}

impl Ratios {
    /// Centre of kernel `i`, which need not exist.
    fn centre_at(&self, i: usize) -> FixedPoint {
        FixedPoint::kernel(FixedPoint::from_index(i) * self.spacing)
    }

    /// Root of the width times the centre of kernel `i`.
    fn root(&self, i: usize) -> i32 {
        if i + 1 == self.count { self.last_root_width } else { self.root_width }
    }

    /// Exponent of kernel `i` at the ratio `E`.
    fn exponent(&self, i: usize, ratio: u64) -> u64 {
        let distance = ratio.cast_signed() - (1 << self.ratio_bits);
        let z = (i64::from(self.root(i)) * distance) >> self.ratio_bits;
        // Up to 126 x 2048: cut to what a square of 32 bits can hold. Nothing above 5 sigma counts anyway.
        let z = z.clamp(-i64::from(i32::MAX), i64::from(i32::MAX));
        (z * z).unsigned_abs()
    }

    /// A kernel near the phase `s` (units of 2^-32, not 0): the one whose centre has just been passed or, because the
    /// logarithm is cut short to a line between powers of two, one or two farther. Its ratio is at most 1.07.
    fn near(&self, s: u32) -> usize {
        let octaves = s.leading_zeros();
        let part = (s << octaves) << 1;
        let halvings = FixedPoint::from_bits((i64::from(octaves + 1) << 32) - i64::from(part));
        (halvings * self.per_octave).to_index().min(self.count.saturating_sub(1))
    }
}

impl<const N: usize> Kernels<FixedPoint, N> for Ratios {
    const FEWEST: Self = Ratios {
        count: 2,
        spacing: FixedPoint::ONE,
        per_octave: FixedPoint::constant(core::f64::consts::LN_2),
        ratio_bits: 24,
        rise: 3 << 24,
        fall: 1 << (FALL_BITS - 2),
        root_width: 1 << ROOT_BITS,
        last_root_width: 1 << ROOT_BITS,
    };

    /// Computes in floating point: where a movement is loaded, not where it runs.
    fn new(alpha: FixedPoint, count: usize, activation: FixedPoint) -> Option<Self> {
        let spacing = alpha / FixedPoint::from_index(count - 1);
        let delta = spacing.to_f64();
        let (rise, fall) = (libm::exp(delta), libm::exp(-delta));
        let root_width = libm::sqrt(-libm::log(activation.to_f64())) / (1.0 - fall);
        if root_width > LARGEST_ROOT_WIDTH {
            return None;
        }
        // The last kernel is the widest for its ratio.
        let farthest = rise + FAR / (root_width * fall);
        let holds = |bits: u32| farthest < RATIO_LIMIT as f64 / f64::from(1_u32 << bits);
        let ratio_bits = RATIO_BITS.rev().find(|bits| holds(*bits))?;
        let scaled = |value: f64, bits: u32| libm::rint(libm::ldexp(value, bits.cast_signed()));
        Some(Ratios {
            count,
            spacing,
            per_octave: FixedPoint::from_f64(core::f64::consts::LN_2 / delta),
            ratio_bits,
            rise: scaled(rise, ratio_bits) as u32,
            fall: scaled(fall, FALL_BITS) as u32,
            root_width: scaled(root_width, ROOT_BITS) as i32,
            last_root_width: scaled(root_width * fall, ROOT_BITS) as i32,
        })
    }

    #[inline]
    fn count(&self) -> usize {
        self.count
    }

    fn centre(&self, i: usize) -> Option<FixedPoint> {
        (i < self.count).then(|| self.centre_at(i))
    }

    fn width(&self, i: usize) -> Option<FixedPoint> {
        let root = FixedPoint::from_weight(self.root(i)) / <Self as Kernels<FixedPoint, N>>::centre(self, i)?;
        Some(root * root)
    }

    #[inline]
    fn each(&self, s: FixedPoint, mut take: impl FnMut(usize, &[FixedPoint])) -> FixedPoint {
        // The phase 1 is that of the first tick; one less of 2^-32 fits into 32 bits.
        let phase = s.to_bits().clamp(0, u32::MAX.into()) as u32;
        let near = self.near(phase.max(1));
        let centre = self.centre_at(near).to_bits().unsigned_abs();
        let mut ratio = (u64::from(phase) << self.ratio_bits).checked_div(centre).unwrap_or(0);
        let next = |ratio: u64| ((ratio * u64::from(self.rise)) >> self.ratio_bits).min(RATIO_LIMIT);

        // Down to the first kernel that counts. The nearest one is met on the way, or is the one above.
        let mut smallest = self.exponent(near, ratio);
        if near + 1 < self.count {
            smallest = smallest.min(self.exponent(near + 1, next(ratio)));
        }
        let mut first = near;
        while first > 0 {
            let falling = (ratio * u64::from(self.fall)) >> FALL_BITS;
            let exponent = self.exponent(first - 1, falling);
            if exponent.saturating_sub(smallest) > NEGLIGIBLE {
                break;
            }
            smallest = smallest.min(exponent);
            (first, ratio) = (first - 1, falling);
        }

        let mut sum = FixedPoint::ZERO;
        for i in first..self.count {
            let above = self.exponent(i, ratio).saturating_sub(smallest);
            if above > NEGLIGIBLE && i > near {
                break;
            }
            let kernel = FixedPoint::from_bits(decay(above >> (2 * ROOT_BITS - 32)));
            sum = sum + kernel;
            take(i, core::slice::from_ref(&kernel));
            ratio = next(ratio);
        }
        // Of the kernels the nearest is 1, so this is at most 1.
        FixedPoint::from_bits(phase.into()) / sum
    }
}
