//! `Quaternion`: Hamilton quaternion (w, x, y, z), rotating body coordinates into world coordinates.
//!
//! `exp(r) = (cos(n/2), sin(n/2) r/n)`, `n = |r|`, turns by the rotation vector `r` (radians);
//! `2 log` is its inverse, continuous over `w < 0` (angles up to 2 pi) because the sign of `q` is kept.

use crate::Scalar;
use crate::vector::{clamp_norm, cross, dot, lifted_norm, scale};

/// Hamilton quaternion; `R(q)` maps body to world.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Quaternion<T> {
    /// Scalar part (`eta`).
    pub w: T,
    /// First vector component.
    pub x: T,
    /// Second vector component.
    pub y: T,
    /// Third vector component.
    pub z: T,
}

impl<T: Scalar> Quaternion<T> {
    /// No rotation.
    pub const IDENTITY: Self = Self { w: T::ONE, x: T::ZERO, y: T::ZERO, z: T::ZERO };

    /// From the components in the order (w, x, y, z).
    #[inline]
    pub const fn new(w: T, x: T, y: T, z: T) -> Self {
        Self { w, x, y, z }
    }

    /// From the scalar and the vector part.
    #[inline]
    pub fn from_parts(w: T, [x, y, z]: [T; 3]) -> Self {
        Self { w, x, y, z }
    }

    /// Vector part.
    #[inline]
    pub fn vector(&self) -> [T; 3] {
        [self.x, self.y, self.z]
    }

    /// Components in the order (w, x, y, z).
    #[inline]
    pub fn to_array(&self) -> [T; 4] {
        [self.w, self.x, self.y, self.z]
    }

    /// Inner product of the two as 4-vectors; negative = opposite hemispheres.
    #[inline]
    pub fn dot(&self, other: &Self) -> T {
        dot(&self.to_array(), &other.to_array())
    }

    /// Inverse rotation of a unit quaternion.
    #[inline]
    pub fn conjugate(&self) -> Self {
        Self::new(self.w, -self.x, -self.y, -self.z)
    }

    /// The same rotation with the other sign.
    #[inline]
    pub fn negated(&self) -> Self {
        Self::new(-self.w, -self.x, -self.y, -self.z)
    }

    /// Hamilton product `self (x) other`.
    #[inline]
    pub fn product(&self, other: &Self) -> Self {
        let (a, b) = (self.vector(), other.vector());
        let c = cross(&a, &b);
        Self::new(
            self.w * other.w - dot(&a, &b),
            self.w * b[0] + other.w * a[0] + c[0],
            self.w * b[1] + other.w * a[1] + c[1],
            self.w * b[2] + other.w * a[2] + c[2],
        )
    }

    /// `R(q) a`: a body vector in world coordinates.
    #[inline]
    pub fn rotate(&self, a: &[T; 3]) -> [T; 3] {
        // a + 2 w (v x a) + 2 v x (v x a)
        let v = self.vector();
        let t = cross(&v, a).map(|t| t + t);
        let u = cross(&v, &t);
        [a[0] + self.w * t[0] + u[0], a[1] + self.w * t[1] + u[1], a[2] + self.w * t[2] + u[2]]
    }

    /// `R(q)` row by row.
    pub fn rotation_matrix(&self) -> [[T; 3]; 3] {
        let x = self.rotate(&[T::ONE, T::ZERO, T::ZERO]);
        let y = self.rotate(&[T::ZERO, T::ONE, T::ZERO]);
        let z = self.rotate(&[T::ZERO, T::ZERO, T::ONE]);
        [[x[0], y[0], z[0]], [x[1], y[1], z[1]], [x[2], y[2], z[2]]]
    }

    /// Whichever of `q` and `-q` lies in the hemisphere of `reference`.
    #[inline]
    pub fn aligned_with(&self, reference: &Self) -> Self {
        if self.dot(reference) < T::ZERO { self.negated() } else { *self }
    }

    /// Rotation vectors are shortened to this length (rad): beyond, the angle within a turn is lost to rounding, and
    /// its square overflows in the end.
    const LARGEST_TURN: f64 = 1000.0;

    /// Rotation by the rotation vector `r` (radians); one that is not a number is no rotation.
    #[inline]
    pub fn from_rotation_vector(r: &[T; 3]) -> Self {
        let n2 = dot(r, r);
        let f = T::from_f64;
        // Small angles (a control tick turns by milliradians): both factors are series in n^2, which needs
        // neither square root nor division. At n = 1/4 the first omitted terms are 3e-16 and 2e-17.
        if n2 <= f(0.0625) {
            let y = n2 * f(0.25);
            let cos = T::ONE - y * (f(1.0 / 2.0) - y * (f(1.0 / 24.0) - y * (f(1.0 / 720.0) - y * f(1.0 / 40_320.0))));
            let half_sinc =
                f(0.5) - y * (f(1.0 / 12.0) - y * (f(1.0 / 240.0) - y * (f(1.0 / 10_080.0) - y * f(1.0 / 725_760.0))));
            return Self::from_parts(cos, scale(r, half_sinc));
        }
        let (r, n2) = if n2 <= f(Self::LARGEST_TURN * Self::LARGEST_TURN) {
            (*r, n2)
        } else {
            let shorter = clamp_norm(r, f(0.999 * Self::LARGEST_TURN));
            (shorter, dot(&shorter, &shorter))
        };
        if !(n2 > T::ZERO) {
            return Self::IDENTITY;
        }
        let n = T::sqrt(n2);
        let (sin, cos) = T::sin_cos(n * f(0.5));
        Self::from_parts(cos, scale(&r, sin / n))
    }

    /// Rotation vector `2 log(q)` (radians), of length 0..2 pi: beyond pi it goes on growing instead of flipping over.
    ///
    /// At exactly -1 (a full turn) the axis is undefined and the result is 0.
    pub fn rotation_vector(&self) -> [T; 3] {
        let v = self.vector();
        let n2 = dot(&v, &v);
        if self.w > T::ZERO && n2 < T::from_f64(1e-8) {
            // asin(n)/n = 1 + n^2/6
            return scale(&v, T::from_f64(2.0) + n2 * T::from_f64(1.0 / 3.0));
        }
        // The error of the norm cancels where the angle is small, and not where it is almost a full turn.
        let (v, n, factor) = if self.w < T::ZERO { lifted_norm(&v) } else { (v, T::sqrt(n2), T::ONE) };
        if n <= T::ZERO {
            return [T::ZERO; 3];
        }
        let half = T::atan2(n / factor, self.w);
        scale(&v, (half + half) / n)
    }

    /// Angle of the rotation, 0..2 pi, sign kept.
    pub fn angle(&self) -> T {
        let v = self.vector();
        let half = T::atan2(T::sqrt(dot(&v, &v)), self.w);
        half + half
    }

    /// One step of Newton's method towards unit norm; exact to second order, so once per tick is enough.
    #[inline]
    pub fn renormalised(&self) -> Self {
        let k = T::from_f64(1.5) - T::from_f64(0.5) * self.dot(self);
        Self::new(self.w * k, self.x * k, self.y * k, self.z * k)
    }

    /// The unit quaternion in this direction; `None` if this is not within `tolerance` of unit norm (or not a number).
    pub fn checked_unit(&self, tolerance: T) -> Option<Self> {
        let norm = T::sqrt(self.dot(self));
        let error = (norm - T::ONE).abs();
        if !(error <= tolerance) {
            return None;
        }
        let k = T::ONE / norm;
        Some(Self::new(self.w * k, self.x * k, self.y * k, self.z * k))
    }
}
