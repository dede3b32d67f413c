//! References: the part of a plan at one tick, for the joints, the tool and the hand.

use dmp::PoseReference;
use nalgebra::Vector3;

use crate::model::hand::DIGITS;
use crate::plan::primitive::{Reference, posture_and_hand};
use crate::real::Real;
use crate::units::{JointAccelerations, JointPositions, JointVelocities, Orientation, Pose, Vector6, Vector7};

/// Reference of the joints at one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointReference<R: Real> {
    /// Desired positions (rad).
    pub q: JointPositions<R>,
    /// Desired velocities (rad/s).
    pub dq: JointVelocities<R>,
    /// Desired accelerations (rad/s^2).
    pub ddq: JointAccelerations<R>,
    /// Velocities of the plan alone, without what a measured error adds (rad/s): along them friction is fed forward.
    pub planned: JointVelocities<R>,
}

impl<R: Real> JointReference<R> {
    /// To stand still at `q`.
    pub fn at_rest(q: JointPositions<R>) -> Self {
        JointReference {
            q,
            dq: JointVelocities::zero(),
            ddq: JointAccelerations::zero(),
            planned: JointVelocities::zero(),
        }
    }
}

/// Reference of the tool at one tick, and the posture that the rest of the arm prefers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TaskReference<R: Real> {
    /// Desired position (m) and orientation.
    pub pose: Pose<R>,
    /// Desired velocity (m/s) and angular velocity (rad/s), world axes.
    pub velocity: Vector6<R>,
    /// Desired acceleration (m/s^2) and angular acceleration (rad/s^2), world axes.
    pub acceleration: Vector6<R>,
    /// Preferred posture `q_post` (rad).
    pub posture: Vector7<R>,
    /// Velocity of the preferred posture (rad/s).
    pub posture_velocity: Vector7<R>,
}

impl<R: Real> TaskReference<R> {
    /// From the plan of a primitive, whose angular quantities are in body axes.
    pub fn from_plan(plan: &Reference<R>) -> Self {
        let [PoseReference { position, orientation }] = &plan.poses;
        let [vx, vy, vz] = position.v;
        let [ax, ay, az] = position.a;
        let [wx, wy, wz] = orientation.omega_world();
        let [bx, by, bz] = orientation.domega_world();
        TaskReference {
            pose: Pose {
                position: Vector3::from(position.x),
                orientation: Orientation(orientation.quaternion.to_array()),
            },
            velocity: Vector6::new(vx, vy, vz, wx, wy, wz),
            acceleration: Vector6::new(ax, ay, az, bx, by, bz),
            posture: Vector7::from(posture_and_hand(&plan.points.x).0),
            posture_velocity: Vector7::from(posture_and_hand(&plan.points.v).0),
        }
    }
}

/// Reference of the digits at one tick, spread first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandReference<R: Real> {
    /// Desired angles (rad).
    pub q: [R; DIGITS],
    /// Desired velocities (rad/s).
    pub dq: [R; DIGITS],
}

impl<R: Real> HandReference<R> {
    /// To stand still at `q`.
    pub fn at_rest(q: [R; DIGITS]) -> Self {
        HandReference { q, dq: [R::constant(0.0); DIGITS] }
    }
}
