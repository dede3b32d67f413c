//! `Reference`: what a run reports at each tick, in physical units.

use crate::{Quaternion, Scalar};

/// Desired value, velocity and acceleration of `D` rows, per second (not scaled by tau).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trajectory<T, const D: usize> {
    /// Value, m or rad.
    pub x: [T; D],
    /// Velocity, m/s or rad/s.
    pub v: [T; D],
    /// Acceleration, m/s^2 or rad/s^2.
    pub a: [T; D],
}

/// Desired orientation with BODY-frame rates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrientationReference<T> {
    /// Orientation, body -> world.
    pub quaternion: Quaternion<T>,
    /// Angular velocity in the body frame, rad/s.
    pub omega: [T; 3],
    /// Angular acceleration in the body frame, rad/s^2.
    pub domega: [T; 3],
}

impl<T: Scalar> OrientationReference<T> {
    /// `R omega`: angular velocity in the world frame, rad/s. A geometric Jacobian needs this one.
    #[inline]
    #[must_use]
    pub fn omega_world(&self) -> [T; 3] {
        self.quaternion.rotate(&self.omega)
    }

    /// `R domega`: angular acceleration in the world frame, rad/s^2 (exact, since `omega x omega` = 0).
    #[inline]
    #[must_use]
    pub fn domega_world(&self) -> [T; 3] {
        self.quaternion.rotate(&self.domega)
    }
}

/// Desired pose with its rates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseReference<T> {
    /// Position, world frame.
    pub position: Trajectory<T, 3>,
    /// Orientation.
    pub orientation: OrientationReference<T>,
}

/// The plan at one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference<T, const D: usize, const P: usize> {
    /// Phase s: 1 at the start, decaying.
    pub phase: T,
    /// Progress u = -ln(s)/alpha: 0 at the start, 1 at the end of the movement, growing beyond.
    pub progress: T,
    /// Time since the start, s; runs on while the plan is frozen.
    pub time: T,
    /// 1/tau(t), 1/s; 0 while time is stopped.
    pub rate: T,
    /// Poses.
    pub poses: [PoseReference<T>; P],
    /// Point rows.
    pub points: Trajectory<T, D>,
}
