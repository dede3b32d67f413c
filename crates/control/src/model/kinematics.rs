//! Forward kinematics, geometric Jacobian and its damped pseudo-inverse.
//!
//! `T(j-1 -> j) = Rz(q_j) Tz(d_j) Tx(a_j) Rx(alpha_j)`; joint j turns about z of frame j-1. The Jacobian is geometric:
//! rows
//! 0..3 give the velocity of the tool origin, rows 3..6 the angular velocity, both in world axes. The pseudo-inverse of
//! Eq (11) is `J^T (J J^T + lambda I)^-1`, by an `L D L^T` factorisation that needs no square root.

use nalgebra::{Matrix3, SMatrix, Vector3};

use crate::model::arm::ArmModel;
use crate::real::{Real, at_least, sqrt};
use crate::units::{JOINTS, JointPositions, JointTorques, JointVelocities, Orientation, Pose, Twist, Vector6, Vector7};

/// The geometric Jacobian: 6 rows (linear, angular; world axes), one column per joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jacobian<R: Real>(pub SMatrix<R, 6, JOINTS>);

impl<R: Real> Jacobian<R> {
    /// Twist of the tool that belongs to joint velocities: `J dq`.
    pub fn twist(&self, dq: &Vector7<R>) -> Vector6<R> {
        let mut twist = Vector6::zeros();
        for (column, rate) in self.0.column_iter().zip(dq.iter()) {
            for (sum, entry) in twist.iter_mut().zip(column.iter()) {
                *sum += *entry * *rate;
            }
        }
        twist
    }

    /// Joint vector that belongs to a wrench or to the multipliers of the pseudo-inverse: `J^T w`.
    pub fn transpose_times(&self, w: &Vector6<R>) -> Vector7<R> {
        let mut joints = Vector7::zeros();
        for (joint, column) in joints.iter_mut().zip(self.0.column_iter()) {
            for (entry, component) in column.iter().zip(w.iter()) {
                *joint += *entry * *component;
            }
        }
        joints
    }

    /// Factorises `J J^T + damping I`. A positive `damping` (m^2, rad^2) keeps the inverse bounded at a singularity.
    pub fn damped(&self, damping: R) -> DampedInverse<'_, R> {
        let zero = R::constant(0.0);
        let factor = Factor { lower: [[zero; 6]; 6], pivot_inverse: [zero; 6] };
        let mut inverse = DampedInverse { jacobian: self, factor };
        let gram = &mut inverse.factor.lower;
        for column in &self.0.data.0 {
            for row in 0..6 {
                for other in 0..=row {
                    gram[row][other] += column[row] * column[other];
                }
            }
        }
        for (index, row) in gram.iter_mut().enumerate() {
            row[index] += damping;
        }
        inverse.factor.factorise(damping);
        inverse
    }
}

/// `L D L^T` of a symmetric positive definite 6x6 matrix.
struct Factor<R: Real> {
    lower: [[R; 6]; 6],
    pivot_inverse: [R; 6],
}

impl<R: Real> Factor<R> {
    /// Factorises the lower triangle that stands in `lower`. Every eigenvalue is at least `floor`, and so is every
    /// pivot: rounding below it is lifted back, so that no division by zero is possible.
    #[allow(clippy::needless_range_loop, reason = "iterators with `skip` and `take` cost three times the instructions")]
    fn factorise(&mut self, floor: R) {
        let matrix = &mut self.lower;
        for column in 0..6 {
            let inverse = R::constant(1.0) / at_least(matrix[column][column], floor);
            self.pivot_inverse[column] = inverse;
            // From below, so that the upper rows of this column are still undivided.
            for row in (column + 1..6).rev() {
                let scaled = matrix[row][column] * inverse;
                for other in column + 1..=row {
                    let update = scaled * matrix[other][column];
                    matrix[row][other] -= update;
                }
                matrix[row][column] = scaled;
            }
        }
    }

    fn solve(&self, right: &Vector6<R>) -> Vector6<R> {
        let mut x = *right;
        for row in 0..6 {
            for column in 0..row {
                let update = self.lower[row][column] * x[column];
                x[row] -= update;
            }
        }
        for (value, inverse) in x.iter_mut().zip(&self.pivot_inverse) {
            *value *= *inverse;
        }
        for row in (0..6).rev() {
            for below in row + 1..6 {
                let update = self.lower[below][row] * x[below];
                x[row] -= update;
            }
        }
        x
    }
}

/// The damped pseudo-inverse of one Jacobian, factorised once and used for velocity and acceleration.
pub struct DampedInverse<'a, R: Real> {
    pub(super) jacobian: &'a Jacobian<R>,
    factor: Factor<R>,
}

impl<R: Real> DampedInverse<'_, R> {
    /// `J^+ task + (I - J^+ J) bias`: the joint vector that does the task and comes as near to `bias` as the task
    /// allows.
    pub fn resolve(&self, task: &Vector6<R>, bias: &Vector7<R>) -> Vector7<R> {
        let remaining = task - self.jacobian.twist(bias);
        bias + self.jacobian.transpose_times(&self.factor.solve(&remaining))
    }
}

/// All frames of the arm at one posture, with the sines and cosines that dynamics need again.
#[derive(Clone, Copy, Debug)]
pub struct Frames<R: Real> {
    pub(crate) sine: [R; JOINTS],
    pub(crate) cosine: [R; JOINTS],
    /// z axes of frames 0 to 6: the joint axes, world axes.
    axes: [Vector3<R>; JOINTS],
    /// Origins of frames 0 to 6 (m).
    origins: [Vector3<R>; JOINTS],
    /// Origin of frame 7 (m).
    plate: Vector3<R>,
    /// Frame 7 to world.
    plate_to_world: Matrix3<R>,
    tool: Vector3<R>,
    tool_to_world: Matrix3<R>,
    sensor: Vector3<R>,
}

impl<R: Real> Frames<R> {
    /// The frames at posture `q`.
    pub fn new(model: &ArmModel<R>, q: &JointPositions<R>) -> Self {
        let (zero, one) = (R::constant(0.0), R::constant(1.0));
        // Filled in its place: a copy of its arrays costs as much as their contents.
        let mut frames = Frames {
            sine: [zero; JOINTS],
            cosine: [zero; JOINTS],
            axes: [Vector3::zeros(); JOINTS],
            origins: [Vector3::zeros(); JOINTS],
            plate: Vector3::zeros(),
            plate_to_world: Matrix3::zeros(),
            tool: Vector3::zeros(),
            tool_to_world: Matrix3::zeros(),
            sensor: Vector3::zeros(),
        };
        let mut x = Vector3::new(one, zero, zero);
        let mut y = Vector3::new(zero, one, zero);
        let mut z = Vector3::new(zero, zero, one);
        let mut origin = Vector3::zeros();
        for joint in 0..JOINTS {
            let (s, c) = q.0[joint].sine_cosine();
            frames.sine[joint] = s;
            frames.cosine[joint] = c;
            frames.axes[joint] = z;
            frames.origins[joint] = origin;
            let turned_x = x * c + y * s;
            let turned_y = y * c - x * s;
            origin += z * model.link_offset[joint] + turned_x * model.link_length[joint];
            x = turned_x;
            y = turned_y * model.twist_cosine[joint] + z * model.twist_sine[joint];
            z = z * model.twist_cosine[joint] - turned_y * model.twist_sine[joint];
        }
        let tool_x = x * model.tool_cosine + y * model.tool_sine;
        let tool_y = y * model.tool_cosine - x * model.tool_sine;
        frames.plate = origin;
        frames.plate_to_world = Matrix3::from_columns(&[x, y, z]);
        frames.tool = origin + z * model.tool_height;
        frames.tool_to_world = Matrix3::from_columns(&[tool_x, tool_y, z]);
        frames.sensor = origin + frames.plate_to_world * model.sensor_origin;
        frames
    }

    /// Pose of the tool frame.
    pub fn tool_pose(&self) -> Pose<R> {
        Pose { position: self.tool, orientation: Orientation::from_matrix(&self.tool_to_world) }
    }

    /// Rotation matrix of the tool, tool to world.
    pub fn tool_to_world(&self) -> &Matrix3<R> {
        &self.tool_to_world
    }

    /// Rotation matrix of the force/torque sensor, sensor to world (its axes are those of frame 7).
    pub fn sensor_to_world(&self) -> &Matrix3<R> {
        &self.plate_to_world
    }

    /// From the tool origin to the measurement origin of the force/torque sensor (m, world axes).
    pub fn tool_to_sensor(&self) -> Vector3<R> {
        self.sensor - self.tool
    }

    /// Geometric Jacobian of the tool.
    pub fn jacobian(&self) -> Jacobian<R> {
        self.jacobian_at(&self.tool)
    }

    /// Torque (N m) with which the joints give this wrench at the tool (N, N m, world axes): `J^T w`, for which no
    /// Jacobian has to be there.
    pub fn joint_torques(&self, wrench: &Vector6<R>) -> JointTorques<R> {
        let [fx, fy, fz, nx, ny, nz] = wrench.data.0[0];
        let (force, moment) = (Vector3::new(fx, fy, fz), Vector3::new(nx, ny, nz));
        let at_base = moment + self.tool.cross(&force);
        let mut torques = Vector7::zeros();
        for ((torque, axis), origin) in torques.iter_mut().zip(&self.axes).zip(&self.origins) {
            *torque = axis.dot(&(at_base - origin.cross(&force)));
        }
        JointTorques(torques)
    }

    fn jacobian_at(&self, point: &Vector3<R>) -> Jacobian<R> {
        let mut jacobian = Jacobian(SMatrix::zeros());
        for ((axis, origin), column) in self.axes.iter().zip(&self.origins).zip(&mut jacobian.0.data.0) {
            let linear = axis.cross(&(point - origin));
            *column = [linear.x, linear.y, linear.z, axis.x, axis.y, axis.z];
        }
        jacobian
    }

    /// Acceleration of the tool while the joints do not accelerate: `dJ/dt dq` (m/s^2, rad/s^2, world axes).
    pub fn velocity_product(&self, dq: &JointVelocities<R>) -> Twist<R> {
        let mut omega = Vector3::zeros();
        let mut angular = Vector3::zeros();
        let mut linear = Vector3::zeros();
        for joint in 0..JOINTS {
            let spin = self.axes[joint] * dq.0[joint];
            angular += omega.cross(&spin);
            omega += spin;
            // The next origin, and at last the tool, rides on the link that this joint turns.
            let end = if joint + 1 < JOINTS { self.origins[joint + 1] } else { self.tool };
            let arm = end - self.origins[joint];
            linear += angular.cross(&arm) + omega.cross(&omega.cross(&arm));
        }
        Twist { linear, angular }
    }

    /// Speeds (m/s) of the elbow and of the point `reach` beyond it along the forearm, which the safety module watches,
    /// and of the grasp point, which it does not.
    pub fn watched_speeds(&self, dq: &JointVelocities<R>, reach: R) -> [R; 3] {
        // The elbow is the axis of J4 (origin of frame 3); the forearm points along z of frame 4, the axis of J5.
        const ELBOW: usize = 3;
        let speed = |velocity: Vector3<R>| sqrt(velocity.dot(&velocity));
        let (mut omega, mut velocity) = (Vector3::zeros(), Vector3::zeros());
        let (mut elbow, mut tip) = (R::constant(0.0), R::constant(0.0));
        for joint in 0..JOINTS {
            omega += self.axes[joint] * dq.0[joint];
            if joint == ELBOW {
                elbow = speed(velocity);
                tip = speed(velocity + omega.cross(&self.axes[4]) * reach);
            }
            let end = if joint + 1 < JOINTS { self.origins[joint + 1] } else { self.tool };
            velocity += omega.cross(&(end - self.origins[joint]));
        }
        [elbow, tip, speed(velocity)]
    }

    /// Origin of frame 7, the face of the tool plate (m).
    pub fn tool_plate(&self) -> &Vector3<R> {
        &self.plate
    }
}
