//! `Reference` and `StartState`: what a run reports at each tick and what it starts from, in physical units.

use crate::{Configuration, HAND_ROWS, POSITION_ROWS, POSTURE_ROWS, Primitive, Quaternion, Scalar, Velocity};

/// Where a run begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StartState<T> {
    /// Pose, posture and hand.
    pub configuration: Configuration<T>,
    /// Physical velocity.
    pub velocity: Velocity<T>,
}

impl<T: Scalar> StartState<T> {
    /// At rest in this configuration.
    pub fn at_rest(configuration: Configuration<T>) -> Self {
        Self { configuration, velocity: Velocity::ZERO }
    }

    /// As the demonstration started, with its initial velocity: replays a recording that was cut out of a motion.
    pub fn demonstrated<const N: usize>(primitive: &Primitive<T, N>) -> Self {
        Self { configuration: *primitive.start(), velocity: *primitive.start_velocity() }
    }
}

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
    pub fn omega_world(&self) -> [T; 3] {
        self.quaternion.rotate(&self.omega)
    }

    /// `R domega`: angular acceleration in the world frame, rad/s^2 (exact, since `omega x omega` = 0).
    #[inline]
    pub fn domega_world(&self) -> [T; 3] {
        self.quaternion.rotate(&self.domega)
    }
}

/// The plan at one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference<T> {
    /// Phase s: 1 at the start, decaying.
    pub phase: T,
    /// Progress u = -ln(s)/alpha: 0 at the start, 1 at the end of the movement, growing beyond.
    pub progress: T,
    /// Time since the start, s; runs on while the plan is frozen.
    pub time: T,
    /// 1/tau(t), 1/s; 0 while time is stopped.
    pub rate: T,
    /// Position, world frame.
    pub position: Trajectory<T, POSITION_ROWS>,
    /// Orientation.
    pub orientation: OrientationReference<T>,
    /// Default posture `q_post`.
    pub posture: Trajectory<T, POSTURE_ROWS>,
    /// Hand (spread, F1, F2, F3).
    pub hand: Trajectory<T, HAND_ROWS>,
}
