//! Quantities as types: what a vector means and in which unit stands in its type, so that a torque is never taken for
//! an angle.
//!
//! Joint quantities hold one number per joint, J1 to J7. Spatial quantities name the axes they are given in. All in SI
//! units.

use nalgebra::{Matrix3, SVector, Vector3};

use crate::real::{Real, sqrt};

/// Number of joints of the arm.
pub const JOINTS: usize = 7;

/// A vector with one number per joint.
pub type Vector7<R> = SVector<R, JOINTS>;

/// A vector of linear (first three) and angular (last three) components.
pub type Vector6<R> = SVector<R, 6>;

macro_rules! joint_quantity {
    ($(#[$documentation:meta])* $name:ident) => {
        $(#[$documentation])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $name<R: Real>(pub Vector7<R>);

        impl<R: Real> $name<R> {
            /// All zero.
            pub fn zero() -> Self {
                $name(Vector7::zeros())
            }

            /// From one number per joint, J1 first.
            pub fn from_array(values: [R; JOINTS]) -> Self {
                $name(Vector7::from(values))
            }

            /// From plain `f32` in the same unit.
            pub fn from_f32(values: [f32; JOINTS]) -> Self {
                $name(Vector7::from(values.map(|value| R::constant(f64::from(value)))))
            }

            /// As plain `f32` in the same unit.
            pub fn to_f32(&self) -> [f32; JOINTS] {
                let values: [R; JOINTS] = self.0.into();
                values.map(Real::single)
            }

            /// True if every component is finite.
            pub fn is_finite(&self) -> bool {
                self.0.iter().all(|value| value.is_finite_number())
            }
        }
    };
}

joint_quantity!(
    /// Joint angles (rad), zero with the arm straight up.
    JointPositions
);
joint_quantity!(
    /// Joint velocities (rad/s).
    JointVelocities
);
joint_quantity!(
    /// Joint accelerations (rad/s^2).
    JointAccelerations
);
joint_quantity!(
    /// Joint torques (N m), positive about the joint axis. Nothing in this type says that they are within limits:
    /// only [`LimitedTorques`](crate::act::limit::LimitedTorques) can be sent.
    JointTorques
);

/// Position and orientation of the tool in the world (frame 0: shoulder centre, z up).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose<R: Real> {
    /// Origin of the tool frame (m, world axes).
    pub position: Vector3<R>,
    /// Unit quaternion (w, x, y, z), tool to world, Hamilton convention.
    pub orientation: Orientation<R>,
}

impl<R: Real> Pose<R> {
    /// Position (m) and quaternion (w, x, y, z) as plain `f32`.
    pub fn to_f32(&self) -> [f32; 7] {
        let [w, x, y, z] = self.orientation.0;
        [
            self.position.x.single(),
            self.position.y.single(),
            self.position.z.single(),
            w.single(),
            x.single(),
            y.single(),
            z.single(),
        ]
    }
}

/// A unit quaternion (w, x, y, z), body to world, Hamilton convention.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orientation<R: Real>(pub [R; 4]);

impl<R: Real> Orientation<R> {
    /// No rotation.
    pub fn identity() -> Self {
        Orientation([R::constant(1.0), R::constant(0.0), R::constant(0.0), R::constant(0.0)])
    }

    /// The quaternion of a rotation matrix (body to world), with `w >= 0`.
    ///
    /// The largest of the four squared components is computed first, so that no division is by a small number.
    pub fn from_matrix(rotation: &Matrix3<R>) -> Self {
        let one = R::constant(1.0);
        let (m00, m11, m22) = (rotation[(0, 0)], rotation[(1, 1)], rotation[(2, 2)]);
        // Four times the squares of w, x, y, z.
        let squares = [one + m00 + m11 + m22, one + m00 - m11 - m22, one - m00 + m11 - m22, one - m00 - m11 + m22];
        // Four times the products of the components.
        let wx = rotation[(2, 1)] - rotation[(1, 2)];
        let wy = rotation[(0, 2)] - rotation[(2, 0)];
        let wz = rotation[(1, 0)] - rotation[(0, 1)];
        let xy = rotation[(0, 1)] + rotation[(1, 0)];
        let xz = rotation[(0, 2)] + rotation[(2, 0)];
        let yz = rotation[(1, 2)] + rotation[(2, 1)];
        let [ww, xx, yy, zz] = squares;
        let (square, row) = if ww >= xx && ww >= yy && ww >= zz {
            (ww, [ww, wx, wy, wz])
        } else if xx >= yy && xx >= zz {
            (xx, [wx, xx, xy, xz])
        } else if yy >= zz {
            (yy, [wy, xy, yy, yz])
        } else {
            (zz, [wz, xz, yz, zz])
        };
        let scale = R::constant(0.5) / sqrt(square);
        let scale = if row[0] < R::constant(0.0) { -scale } else { scale };
        Orientation(row.map(|component| component * scale))
    }

    /// The rotation matrix, body to world.
    pub fn to_matrix(&self) -> Matrix3<R> {
        let [w, x, y, z] = self.0;
        let one = R::constant(1.0);
        let two = R::constant(2.0);
        Matrix3::new(
            one - two * (y * y + z * z),
            two * (x * y - w * z),
            two * (x * z + w * y),
            two * (x * y + w * z),
            one - two * (x * x + z * z),
            two * (y * z - w * x),
            two * (x * z - w * y),
            two * (y * z + w * x),
            one - two * (x * x + y * y),
        )
    }

    /// The rotation error from `self` to `desired` as `2 vec(q_d (x) conj(q))`, sign-aligned, in world axes (rad for
    /// small angles): turning by it brings `self` towards `desired`. Eq (11).
    pub fn error_to(&self, desired: &Orientation<R>) -> Vector3<R> {
        let [w, x, y, z] = self.0;
        let [dw, dx, dy, dz] = desired.0;
        let two = R::constant(2.0);
        let dot = w * dw + x * dx + y * dy + z * dz;
        let scale = if dot < R::constant(0.0) { -two } else { two };
        let measured = Vector3::new(x, y, z);
        let wanted = Vector3::new(dx, dy, dz);
        (wanted * w - measured * dw - wanted.cross(&measured)) * scale
    }
}

/// Linear and angular velocity of the tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Twist<R: Real> {
    /// Velocity of the tool origin (m/s, world axes).
    pub linear: Vector3<R>,
    /// Angular velocity (rad/s, world axes).
    pub angular: Vector3<R>,
}

impl<R: Real> Twist<R> {
    /// Linear part first.
    pub fn to_vector(&self) -> Vector6<R> {
        Vector6::new(self.linear.x, self.linear.y, self.linear.z, self.angular.x, self.angular.y, self.angular.z)
    }
}

/// The wrench of the environment on the robot at the grasp point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wrench<R: Real> {
    /// Force (N, world axes).
    pub force: Vector3<R>,
    /// Torque about the grasp point (N m, tool axes), the frame of the orientation system of the primitive.
    pub torque: Vector3<R>,
}

impl<R: Real> Wrench<R> {
    /// No force, no torque.
    pub fn zero() -> Self {
        Wrench { force: Vector3::zeros(), torque: Vector3::zeros() }
    }

    /// Force (world axes, N), then torque (tool axes, N m), as plain `f32`.
    pub fn to_f32(&self) -> [f32; 6] {
        [
            self.force.x.single(),
            self.force.y.single(),
            self.force.z.single(),
            self.torque.x.single(),
            self.torque.y.single(),
            self.torque.z.single(),
        ]
    }

    /// The same wrench with the torque turned into world axes, as the rows of the Jacobian need it.
    pub fn in_world(&self, tool_to_world: &Matrix3<R>) -> Vector6<R> {
        let torque = tool_to_world * self.torque;
        Vector6::new(self.force.x, self.force.y, self.force.z, torque.x, torque.y, torque.z)
    }
}
