//! `OrientationSystem` and `OrientationState`: Eqs. (4), (6), (7) in the BODY frame, as printed.
//!
//! `e_o(a, b) = vec(conj(a) (x) b)`,
//! `tau omegad = -K e_o(g, q) - D omega + K e_o(g, q0) s + K f(s) + zeta`, `tau qd = 1/2 q (x) omega`.
//!
//! `omega` is the scaled angular velocity in body coordinates: physical `omega/tau`; world `R(q) omega/tau`. Mixing
//! body and world frames is 20 degrees wrong on real movements and invisible on single-axis ones. Stepped by
//! `omega += h rhs(old state)`, `q <- q (x) exp(h omega(new))`, then one Newton step towards unit norm.

use crate::vector::scale;
use crate::{GainError, Quaternion, Scalar, TransformationSystem};

/// Coordinates in which the orientation moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum OrientationError {
    /// Eqs. (4), (6), (7): error of length `sin(angle/2)`. Usable up to 175 degrees from the goal.
    #[default]
    Quaternion,
    /// Rotation vectors, see [`LogMap`](crate::LogMap): error of length `angle`. Usable up to almost a
    /// full turn. Not in the paper.
    RotationVector,
}

/// Choice of the signs of the start and goal quaternions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Hemisphere {
    /// Start and goal carry the signs of a sign-continuous demonstration: a run aligns its own to them.
    #[default]
    Demonstrated,
    /// There is no demonstration: the goal is taken on the side nearest to the current orientation. Rotation vectors
    /// keep to the side that is nearest to the start stored in the primitive, wherever a run starts.
    Nearest,
}

/// Cosine of half of 175 degrees: two unit quaternions with a smaller inner product are too far apart for the error of
/// Eq. (4), which is longest at 180 degrees and pulls ever less beyond.
const FARTHEST_COSINE: f64 = 0.043_619_387_365_336;

/// Cosine of half of 359.1 degrees: 359, and what the rounding of an f32 makes of it. Farther apart a run could start
/// where its rotation vector is a full turn, and the velocity that belongs to it is infinite.
const FARTHEST_VECTOR_COSINE: f64 = -0.999_969_157_644_79;

/// True if Eq. (4) can pull from `from` to `goal`, whose signs tell which way round: they are at most 175 degrees
/// apart.
#[inline]
pub(crate) fn is_near_enough<T: Scalar>(from: &Quaternion<T>, goal: &Quaternion<T>) -> bool {
    from.dot(goal) >= T::from_f64(FARTHEST_COSINE)
}

impl OrientationError {
    /// True if a movement with this error can begin at `from` and end at `goal`, whose signs tell which way round.
    pub(crate) fn can_turn<T: Scalar>(self, from: &Quaternion<T>, goal: &Quaternion<T>) -> bool {
        match self {
            Self::Quaternion => is_near_enough(from, goal),
            Self::RotationVector => from.dot(goal) >= T::from_f64(FARTHEST_VECTOR_COSINE),
        }
    }

    /// Damping that makes the linearised system critical: `sqrt(2 K)` for the half-angle error of Eq. (4),
    /// `2 sqrt(K)` for the rotation vector.
    pub fn critical_damping<T: Scalar>(self, stiffness: T) -> T {
        let factor = match self {
            Self::Quaternion => 2.0,
            Self::RotationVector => 4.0,
        };
        T::sqrt(T::from_f64(factor) * stiffness)
    }
}

/// Eq. (4): `e_o(a, b) = vec(conj(a) (x) b)`, body frame. `e_o(goal, orientation)` points from the goal to the
/// orientation, opposite to `goal - orientation`.
#[inline]
pub fn orientation_error<T: Scalar>(a: &Quaternion<T>, b: &Quaternion<T>) -> [T; 3] {
    a.conjugate().product(b).vector()
}

/// Spring and damper of the orientation, Eq. (6).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrientationSystem<T> {
    gains: TransformationSystem<T>,
}

/// Everything that acts on the orientation during one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrientationInput<T> {
    /// Start orientation.
    pub start: Quaternion<T>,
    /// Goal orientation.
    pub goal: Quaternion<T>,
    /// Phase `s`, Eq. (3).
    pub s: T,
    /// Forcing term, body frame.
    pub f: [T; 3],
    /// Sensory feedback, body frame.
    pub zeta: [T; 3],
}

impl<T: Scalar> OrientationSystem<T> {
    /// With stiffness `K_o` and damping `D_o`.
    pub fn new(gains: TransformationSystem<T>) -> Self {
        Self { gains }
    }

    /// Critically damped: `D_o = sqrt(2 K_o)`.
    ///
    /// # Errors
    /// As [`TransformationSystem::new`].
    pub fn critically_damped(stiffness: T) -> Result<Self, GainError> {
        if !(stiffness > T::ZERO) {
            return Err(GainError::Stiffness);
        }
        let damping = OrientationError::Quaternion.critical_damping(stiffness);
        TransformationSystem::new(stiffness, damping).map(Self::new)
    }

    /// Stiffness and damping.
    #[inline]
    pub fn gains(&self) -> &TransformationSystem<T> {
        &self.gains
    }

    /// Right-hand side of Eq. (6) with feedback = `tau omegad`, body frame.
    #[inline]
    pub fn right_hand_side(&self, state: &OrientationState<T>, input: &OrientationInput<T>) -> [T; 3] {
        let (k, d) = (self.gains.stiffness(), self.gains.damping());
        let e = orientation_error(&input.goal, &state.q);
        let e0 = orientation_error(&input.goal, &input.start);
        core::array::from_fn(|i| -k * e[i] - d * state.omega[i] + k * e0[i] * input.s + k * input.f[i] + input.zeta[i])
    }
}

/// State of the orientation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrientationState<T> {
    /// Orientation, body -> world.
    pub q: Quaternion<T>,
    /// Scaled angular velocity `tau omega`, body frame.
    pub omega: [T; 3],
}

impl<T: Scalar> OrientationState<T> {
    /// One step of `h = dt/tau` with the right-hand side of the state before the step.
    #[inline]
    pub fn step(&mut self, right_hand_side: &[T; 3], h: T) {
        for (omega, rhs) in self.omega.iter_mut().zip(right_hand_side) {
            *omega = *omega + h * *rhs;
        }
        let turn = Quaternion::from_rotation_vector(&scale(&self.omega, h));
        self.q = self.q.product(&turn).renormalised();
    }
}
