//! `TransformationSystem` and `PointState`: Eqs. (1) and (9), one scalar row.
//!
//! `tau vd = K (g - x) - D v - K (g - x0) s + K f(s) + zeta`, `tau xd = v`.
//!
//! `v` is scaled by tau: the physical velocity is `v/tau`, the physical acceleration `rhs/tau^2`. With tau in seconds
//! `K` and `D` are plain numbers, and `rhs` and `zeta` have the unit of `x`. At s = 1 and x = x0 the two spring terms
//! cancel, so a movement starts softly. Stepped by semi-implicit Euler: `v += h rhs(old state)`, `x += h v(new)`,
//! `h = dt/tau`, which is stable up to [`TransformationSystem::largest_step`].

use core::fmt;

use crate::{Scalar, bounds};

/// Spring and damper of one group of rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TransformationSystem<T> {
    stiffness: T,
    damping: T,
}

/// Reason for which a pair of gains is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum GainError {
    /// The stiffness is not between 0.1 and 1e6.
    Stiffness,
    /// The damping is not between 0.1 and 1e6.
    Damping,
}

impl fmt::Display for GainError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Stiffness => "stiffness must be between 0.1 and 1e6",
            Self::Damping => "damping must be between 0.1 and 1e6",
        })
    }
}

impl core::error::Error for GainError {}

impl<T: Scalar> TransformationSystem<T> {
    /// Stiffness `K` that suits most movements.
    pub const DEFAULT_STIFFNESS: f64 = 200.0;

    /// With stiffness `K` and damping `D`.
    ///
    /// # Errors
    /// A gain that is not between [`bounds::SMALLEST_GAIN`] and [`bounds::LARGEST_GAIN`].
    pub fn new(stiffness: T, damping: T) -> Result<Self, GainError> {
        let allowed = T::from_f64(bounds::SMALLEST_GAIN)..=T::from_f64(bounds::LARGEST_GAIN);
        if !allowed.contains(&stiffness) {
            return Err(GainError::Stiffness);
        }
        if !allowed.contains(&damping) {
            return Err(GainError::Damping);
        }
        Ok(Self { stiffness, damping })
    }

    /// Critically damped: `D = 2 sqrt(K)`.
    ///
    /// # Errors
    /// As [`TransformationSystem::new`].
    pub fn critically_damped(stiffness: T) -> Result<Self, GainError> {
        if !(stiffness > T::ZERO) {
            return Err(GainError::Stiffness);
        }
        let root = T::sqrt(stiffness);
        Self::new(stiffness, root + root)
    }

    /// K = D = 1, for what rests.
    pub(crate) const UNIT: Self = Self { stiffness: T::ONE, damping: T::ONE };

    /// Stiffness `K`.
    #[inline]
    pub fn stiffness(&self) -> T {
        self.stiffness
    }

    /// Damping `D`.
    #[inline]
    pub fn damping(&self) -> T {
        self.damping
    }

    /// Largest step `h = dt/tau` for which the integration is stable, whatever the steps up to it are one after the
    /// other.
    ///
    /// Steps of one size are stable for `K h^2 + 2 D h <= 4` and `D h <= 2`. Of a system that swings (D below `1.2
    /// sqrt(K)`) that is not enough where the step changes: at a tenth of the critical damping long and short ticks in
    /// turn, each of them stable, grow by half per tick. All sequences were found stable for `K h^2 <= 1` and `K h <=
    /// 2.5 D` besides. A step of more than the whole movement is none.
    ///
    /// The root of the first is written `4/(sqrt(D^2 + 4K) + D)`: `(sqrt(D^2 + 4K) - D)/K` cancels where D is large.
    /// Under the root the larger of D and `2 sqrt(K)` is factored out: `D^2` saturates in fixed point from D = 46 341
    /// on, and the step would come out too long.
    pub fn largest_step(&self) -> T {
        let d = self.damping;
        let root = T::sqrt(self.stiffness);
        let critical = root + root;
        let (larger, ratio) = if critical > d { (critical, d / critical) } else { (d, critical / d) };
        let spring = T::from_f64(4.0) / (larger * T::sqrt(T::ONE + ratio * ratio) + d);
        let limits = [spring, T::from_f64(2.0) / d, T::ONE / root, T::from_f64(2.5) * d / self.stiffness];
        limits.into_iter().fold(T::ONE, |least, limit| if limit < least { limit } else { least })
    }

    /// Largest forcing term that a movement of this duration needs, in the unit of the row.
    ///
    /// Eq. (1) solved for it: `f = (tau^2 xdd + D tau xd)/K + (x - g) + (g - x0) s`. Its parts are bounded twice: by
    /// what a robot can do ([`bounds::LARGEST_ACCELERATION`], [`bounds::LARGEST_SPEED`]), and by what `kernel_count`
    /// kernels can express, which is no faster a wave than one with a half-wave per kernel, of the amplitude
    /// [`bounds::LARGEST_VALUE`].
    pub(crate) fn largest_force(&self, duration: T, kernel_count: usize) -> T {
        let f = T::from_f64;
        let (k, d) = (self.stiffness, self.damping);
        let moves = duration / k * (duration * f(bounds::LARGEST_ACCELERATION) + d * f(bounds::LARGEST_SPEED));
        let rate = f(core::f64::consts::PI) * T::from_index(kernel_count);
        let waves = f(bounds::LARGEST_VALUE) * (rate / k) * (rate + d);
        let motion = if moves < waves { moves } else { waves };
        motion + f(2.0 * bounds::LARGEST_VALUE)
    }

    /// Right-hand side of Eq. (9) = `tau vd`.
    #[inline]
    pub fn right_hand_side(&self, state: &PointState<T>, input: &PointInput<T>) -> T {
        let PointInput { start, goal, s, f, zeta } = *input;
        self.stiffness * (goal - state.x) - self.damping * state.v - self.stiffness * (goal - start) * s
            + self.stiffness * f
            + zeta
    }
}

/// Everything that acts on one row during one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointInput<T> {
    /// Start `x0` of the movement.
    pub start: T,
    /// Goal `g`.
    pub goal: T,
    /// Phase `s`, Eq. (3).
    pub s: T,
    /// Forcing term `f(s)`, Eq. (2).
    pub f: T,
    /// Sensory feedback, Eq. (8).
    pub zeta: T,
}

/// State of one row.
///
/// The value is a compensated sum: near the goal a tick moves the plan by less than the last digit of an f32, and
/// without the rest that is carried over it would stop there, micrometres short.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointState<T> {
    x: T,
    v: T,
    x_lost: T,
}

impl<T: Scalar> PointState<T> {
    /// At the value `x` (m or rad) with the scaled velocity `v = tau xd`.
    #[inline]
    pub fn new(x: T, v: T) -> Self {
        Self { x, v, x_lost: T::ZERO }
    }

    /// Value, m or rad.
    #[inline]
    pub fn x(&self) -> T {
        self.x
    }

    /// Scaled velocity `tau xd`.
    #[inline]
    pub fn v(&self) -> T {
        self.v
    }

    /// One step of `h = dt/tau` with the right-hand side of the state before the step.
    #[inline]
    pub fn step(&mut self, right_hand_side: T, h: T) {
        self.v = self.v + h * right_hand_side;
        let step = h * self.v - self.x_lost;
        let sum = self.x + step;
        self.x_lost = (sum - self.x) - step;
        self.x = sum;
    }
}
