//! `CanonicalSystem` and `Phase`: the one clock of a movement.
//!
//! Eq. (3): `tau sd = -alpha s`, stepped exactly: the progress `u <- u + h`, `h = dt/tau`, and from it `s = exp(-alpha
//! u)`. The closed form `exp(-alpha t/tau)` is refused on purpose: with it the phase jumps (even backwards) when tau
//! changes. So is `s <- s exp(-alpha h)`: at low speed the factor is so near to 1 that its rounding, the same in every
//! tick, lets the phase drift away from the progress (in f32 by 0.24 % at 1/60 of the speed of a movement of 5 s, in
//! fixed point by 0.02 %).

use crate::Scalar;

/// Eq. (3): decay of the phase.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CanonicalSystem<T> {
    alpha: T,
}

impl<T: Scalar> CanonicalSystem<T> {
    /// `alpha` for which the phase has fallen to 0.01 at the end of the movement.
    pub const DEFAULT_ALPHA: f64 = 4.605_170_185_988_091;

    /// With decay `alpha`; `None` unless the phase falls to between 1e-6 and 0.1 at t = tau.
    ///
    /// A slower decay leaves forcing and the start term `(g - x0) s` alive at the end of the movement (with
    /// `alpha` = 1 still 37 %), a faster one squeezes all kernels into the first moments.
    pub fn new(alpha: T) -> Option<Self> {
        let range = T::from_f64(2.3)..=T::from_f64(13.82);
        range.contains(&alpha).then_some(Self { alpha })
    }

    /// alpha = 1, for what rests.
    pub(crate) const UNIT: Self = Self { alpha: T::ONE };

    /// Decay `alpha`.
    #[inline]
    pub fn alpha(&self) -> T {
        self.alpha
    }

    /// The phase at progress `u`.
    #[inline]
    pub fn phase_at(&self, u: T) -> T {
        T::exp(-self.alpha * u)
    }
}

/// State of the clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Phase<T> {
    s: T,
    u: T,
    u_lost: T,
}

impl<T: Scalar> Phase<T> {
    /// Start of a movement: s = 1, u = 0.
    pub const START: Self = Self { s: T::ONE, u: T::ZERO, u_lost: T::ZERO };

    /// Phase `s`, 1 at the start, decaying towards 0.
    #[inline]
    pub fn s(&self) -> T {
        self.s
    }

    /// Progress `u = -ln(s)/alpha`: 0 at the start, 1 after the duration, growing beyond.
    #[inline]
    pub fn progress(&self) -> T {
        self.u
    }

    /// Advances by `h = dt/tau` (not negative).
    #[inline]
    pub fn step(&mut self, system: &CanonicalSystem<T>, h: T) {
        // Compensated sum: thousands of small steps would lose 1e-5 in f32.
        let step = h - self.u_lost;
        let sum = self.u + step;
        self.u_lost = (sum - self.u) - step;
        self.u = sum;
        // During the movement and well beyond by the faster of the two exponentials.
        let exponent = system.alpha * sum;
        self.s = if exponent <= T::NEGLIGIBLE_EXPONENT { T::kernel(exponent) } else { T::exp(-exponent) };
    }
}
