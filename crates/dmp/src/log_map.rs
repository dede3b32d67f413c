//! `LogMap`: orientations as rotation vectors (log-map coordinates) about a centre, for movements beyond 175 degrees.
//!
//! `q = c (x) exp(y)`, `y = 2 log(conj(c) (x) q)`. On `y` runs the linear system of Eq. (1), stable at any angle. This
//! is not in the paper. Putting `2 log(conj(q) (x) g)` in the place of Eq. (4) looks simpler and was refused: across
//! the axis its stiffness is `K (phi/2) cot(phi/2)`, negative beyond 180 degrees, and real recordings of 357 degrees
//! then run away by more than 100 degrees. The centre lies half-way between the start and the goal of the
//! demonstration, so `y` stays within half a turn where the path is shorter than a full one.
//!
//! `omega = J_r(y) yd` (body frame), `J_r = 1 - b [y] + c [y]^2`, `b = (1 - cos n)/n^2`, `c = (n - sin n)/n^3`.

use crate::vector::{cross, dot, lifted_norm, scale};
use crate::{Quaternion, Scalar};

/// Rotation vectors about a centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogMap<T> {
    centre: Quaternion<T>,
    half: [T; 3],
}

/// Coefficients of `J_r` and their derivatives by `n`, divided by `n`.
struct Coefficients<T> {
    b: T,
    c: T,
    b_slope: T,
    c_slope: T,
}

impl<T: Scalar> Coefficients<T> {
    fn at(y: &[T; 3]) -> Self {
        let x = dot(y, y);
        let f = T::from_f64;
        if x < f(0.25) {
            // Power series in n^2; the first omitted terms are below 1e-14 at n = 1/2.
            const B: [f64; 6] =
                [1.0 / 2.0, -1.0 / 24.0, 1.0 / 720.0, -1.0 / 40_320.0, 1.0 / 3_628_800.0, -1.0 / 479_001_600.0];
            const C: [f64; 6] =
                [1.0 / 6.0, -1.0 / 120.0, 1.0 / 5_040.0, -1.0 / 362_880.0, 1.0 / 39_916_800.0, -1.0 / 6_227_020_800.0];
            // Value and derivative by n^2 (Horner); d/dn / n = 2 d/d(n^2).
            let series = |coefficients: &[f64; 6]| {
                let (mut value, mut slope) = (T::ZERO, T::ZERO);
                for &coefficient in coefficients.iter().rev() {
                    slope = slope * x + value;
                    value = value * x + f(coefficient);
                }
                (value, slope + slope)
            };
            let ((b, b_slope), (c, c_slope)) = (series(&B), series(&C));
            return Self { b, c, b_slope, c_slope };
        }
        let n = T::sqrt(x);
        let (sin, cos) = T::sin_cos(n);
        let by_x = T::ONE / x;
        let sinc = sin / n;
        let b = (T::ONE - cos) * by_x;
        let c = (T::ONE - sinc) * by_x;
        Self { b, c, b_slope: (sinc - b - b) * by_x, c_slope: (b - f(3.0) * c) * by_x }
    }
}

impl<T: Scalar> LogMap<T> {
    /// Centred half-way between the ends of a demonstration, whose signs tell which way round it turned (less than a
    /// full turn).
    pub fn between(start: &Quaternion<T>, goal: &Quaternion<T>) -> Self {
        let whole = goal.conjugate().product(start).rotation_vector();
        let half = scale(&whole, T::from_f64(0.5));
        Self { centre: goal.product(&Quaternion::from_rotation_vector(&half)), half }
    }

    /// Coordinates of the demonstrated start.
    pub fn start(&self) -> [T; 3] {
        self.half
    }

    /// Coordinates of the demonstrated goal.
    pub fn goal(&self) -> [T; 3] {
        self.half.map(|y| -y)
    }

    /// Coordinates of an orientation of either sign. Of all that mean the same orientation (they differ by full turns
    /// about their axis) those nearest to `near`.
    pub fn vector(&self, q: &Quaternion<T>, near: &[T; 3]) -> [T; 3] {
        let y = self.centre.conjugate().product(q).rotation_vector();
        let (lifted, lifted_n, factor) = lifted_norm(&y);
        let n = lifted_n / factor;
        if n < T::from_f64(1e-6) {
            return y;
        }
        let axis = scale(&lifted, T::ONE / lifted_n);
        let turn = T::from_f64(2.0 * core::f64::consts::PI);
        // Of the points n + k turn on the line along the axis, the one nearest to the projection of `near`.
        let wanted = dot(&axis, near);
        let mut length = n;
        for _ in 0..4 {
            if length - wanted > turn * T::from_f64(0.5) {
                length = length - turn;
            } else if wanted - length > turn * T::from_f64(0.5) {
                length = length + turn;
            }
        }
        scale(&axis, length)
    }

    /// Orientation at the coordinates `y`.
    #[inline]
    pub fn orientation(&self, y: &[T; 3]) -> Quaternion<T> {
        self.centre.product(&Quaternion::from_rotation_vector(y)).renormalised()
    }

    /// Body-frame angular velocity `J_r(y) dy`.
    pub fn omega(&self, y: &[T; 3], dy: &[T; 3]) -> [T; 3] {
        apply(&Coefficients::at(y), y, dy)
    }

    /// Body-frame angular velocity and acceleration for the coordinate velocity `dy` and acceleration `ddy`.
    #[inline]
    pub fn rates(&self, y: &[T; 3], dy: &[T; 3], ddy: &[T; 3]) -> ([T; 3], [T; 3]) {
        let k = Coefficients::at(y);
        let along = dot(y, dy);
        let across = cross(y, dy);
        let (twice, bent) = (cross(y, &across), cross(dy, &across));
        let domega = apply(&k, y, ddy);
        (
            apply(&k, y, dy),
            core::array::from_fn(|i| {
                domega[i] - k.b_slope * along * across[i] + k.c_slope * along * twice[i] + k.c * bent[i]
            }),
        )
    }

    /// Coordinate velocity for a body-frame angular velocity: `J_r^-1(y) omega`; singular only at full turns.
    pub fn velocity(&self, y: &[T; 3], omega: &[T; 3]) -> [T; 3] {
        let x = dot(y, y);
        let d = if x < T::from_f64(1e-2) {
            // Remainder x^3/1.2e6.
            T::from_f64(1.0 / 12.0) + x * (T::from_f64(1.0 / 720.0) + x * T::from_f64(1.0 / 30_240.0))
        } else {
            let k = Coefficients::at(y);
            let sinc = T::ONE - k.c * x;
            (T::ONE - sinc / (k.b + k.b)) / x
        };
        let across = cross(y, omega);
        let twice = cross(y, &across);
        core::array::from_fn(|i| omega[i] + T::from_f64(0.5) * across[i] + d * twice[i])
    }

    /// `J_r(y)^T zeta`: feedback in the body frame on the coordinates.
    pub fn generalised(&self, y: &[T; 3], zeta: &[T; 3]) -> [T; 3] {
        apply(&Coefficients::at(y), &y.map(|y| -y), zeta)
    }
}

/// `(1 - b [y] + c [y]^2) a`
#[inline]
fn apply<T: Scalar>(k: &Coefficients<T>, y: &[T; 3], a: &[T; 3]) -> [T; 3] {
    let across = cross(y, a);
    let twice = cross(y, &across);
    core::array::from_fn(|i| a[i] - k.b * across[i] + k.c * twice[i])
}
