//! Kinematics of the simulated arm without its dynamics: where the hand is, how it moves, and how to reach a pose.
//!
//! For set-up, tests and pictures. The co-controller has kinematics of its own; nothing here is shared with it.

use super::addresses::Addresses;
use super::contacts::Parts;
use super::{MujocoOptions, WorldError};
use crate::Pose;
use crate::rotation::{add_scaled, difference, from_matrix};
use mujoco_rs::prelude::{MjData, MjModel};

/// No joint posture near the given one reaches a pose.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("no posture found for the pose; the nearest misses it by {position} m and {rotation} rad")]
pub struct Unreachable {
    /// Distance left, m.
    pub position: f64,
    /// Turn left, rad.
    pub rotation: f64,
}

/// The arm as a mechanism: postures, poses, the Jacobian, contacts.
pub struct Kinematics {
    data: MjData<Box<MjModel>>,
    addresses: Addresses,
    parts: Parts,
}

impl Kinematics {
    /// Damping of the pseudo-inverse, added to J J^T (m^2): keeps steps finite near a singularity.
    const DAMPING: f64 = 1e-6;
    /// Longest change of one joint in one iteration, rad.
    const LONGEST_STEP: f64 = 0.1;
    /// Share of the way back to the wanted posture, in the null space, per iteration.
    const POSTURE_PULL: f64 = 0.05;
    /// Distance kept to the mechanical stops, rad.
    const MARGIN: f64 = 0.02;
    /// Iterations that pull towards the wanted posture, and iterations that only close the gap after them.
    const ITERATIONS: [usize; 2] = [300, 60];

    /// The mechanism in the scene that the options describe.
    ///
    /// # Errors
    /// [`WorldError`] as for [`MujocoWorld::new`](super::MujocoWorld::new).
    pub fn new(options: &MujocoOptions) -> Result<Self, WorldError> {
        let (mut data, addresses, _) = super::load(options)?;
        let parts = Parts::of(data.model())?;
        super::place(&mut data, &addresses, options);
        data.forward();
        Ok(Self { data, addresses, parts })
    }

    /// Range of each joint between its mechanical stops, rad.
    #[must_use]
    pub fn joint_ranges(&self) -> [[f64; 2]; 7] {
        self.addresses.ranges
    }

    /// Pose of the grasp point in the posture `q`, rad.
    pub fn grasp_pose(&mut self, q: &[f64; 7]) -> Pose {
        self.set(q);
        let site = self.addresses.grasp;
        Pose { position: self.data.site_xpos()[site], quaternion: from_matrix(&self.data.site_xmat()[site]) }
    }

    /// Jacobian of the grasp point in the posture `q`: rows linear velocity (m), then angular velocity, world axes.
    pub fn jacobian(&mut self, q: &[f64; 7]) -> [[f64; 7]; 6] {
        self.set(q);
        let (linear, angular) = self.data.jac_site(true, true, self.addresses.grasp);
        let columns = self.data.qvel().len();
        std::array::from_fn(|row| {
            let (matrix, row) = if row < 3 { (&linear, row) } else { (&angular, row - 3) };
            self.addresses.velocities.map(|i| matrix[row * columns + i])
        })
    }

    /// Number of contacts of the arm or the hand with the scene in the posture `q`.
    pub fn robot_contacts(&mut self, q: &[f64; 7]) -> usize {
        self.set(q);
        self.data.collision();
        self.parts.robot_contacts(&self.data)
    }

    /// A posture that reaches `target`, as near to the posture `near` as the redundancy of the arm allows.
    ///
    /// Damped least squares with the wanted posture in the null space, then without it until the gap is closed.
    ///
    /// # Errors
    /// [`Unreachable`] if more than 1 micrometre or 1 microradian is left after all iterations.
    pub fn inverse(&mut self, target: &Pose, near: &[f64; 7]) -> Result<[f64; 7], Unreachable> {
        let mut q = *near;
        for iteration in 0..Self::ITERATIONS[0] + Self::ITERATIONS[1] {
            let pull = if iteration < Self::ITERATIONS[0] { Self::POSTURE_PULL } else { 0.0 };
            let gap = self.gap(target, &q);
            let jacobian = self.jacobian(&q);
            let towards: [f64; 7] = std::array::from_fn(|i| pull * (near[i] - q[i]));
            // dq = towards + J^T (J J^T + d E)^-1 (gap - J towards): the first term acts in the null space only.
            let mut normal = [[0.0; 7]; 6];
            for row in 0..6 {
                for column in 0..6 {
                    normal[row][column] = dot(&jacobian[row], &jacobian[column]);
                }
                normal[row][row] += Self::DAMPING;
                normal[row][6] = gap[row] - dot(&jacobian[row], &towards);
            }
            let multipliers = solve(normal);
            let step: [f64; 7] = std::array::from_fn(|i| {
                towards[i] + (0..6).map(|row| jacobian[row][i] * multipliers[row]).sum::<f64>()
            });
            let longest = step.iter().fold(0.0_f64, |a, x| a.max(x.abs()));
            let scale = if longest > Self::LONGEST_STEP { Self::LONGEST_STEP / longest } else { 1.0 };
            for (i, [low, high]) in self.addresses.ranges.into_iter().enumerate() {
                q[i] = (q[i] + scale * step[i]).clamp(low + Self::MARGIN, high - Self::MARGIN);
            }
        }
        let gap = self.gap(target, &q);
        let length = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
        let (position, rotation) = (length(&gap[..3]), length(&gap[3..]));
        if position < 1e-6 && rotation < 1e-6 { Ok(q) } else { Err(Unreachable { position, rotation }) }
    }

    /// Remaining distance to the target: metres, then a rotation vector in world axes.
    fn gap(&mut self, target: &Pose, q: &[f64; 7]) -> [f64; 6] {
        let pose = self.grasp_pose(q);
        let [x, y, z] = add_scaled(target.position, -1.0, pose.position);
        let [a, b, c] = difference(target.quaternion, pose.quaternion);
        [x, y, z, a, b, c]
    }

    /// Moves the mechanism to the posture `q`.
    fn set(&mut self, q: &[f64; 7]) {
        for (address, angle) in self.addresses.positions.iter().zip(q) {
            self.data.qpos_mut()[*address] = *angle;
        }
        self.data.kinematics();
        self.data.com_pos();
    }
}

fn dot(a: &[f64; 7], b: &[f64; 7]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Solves six equations by Gauss elimination; the last column is the right-hand side.
/// The matrix is positive definite (damped), so no pivot is zero and none need be searched.
fn solve(mut m: [[f64; 7]; 6]) -> [f64; 6] {
    for pivot in 0..6 {
        let top = m[pivot];
        for row in m.iter_mut().skip(pivot + 1) {
            let factor = row[pivot] / top[pivot];
            for (x, t) in row.iter_mut().zip(top) {
                *x -= factor * t;
            }
        }
    }
    let mut x = [0.0; 6];
    for row in (0..6).rev() {
        let known: f64 = (row + 1..6).map(|column| m[row][column] * x[column]).sum();
        x[row] = (m[row][6] - known) / m[row][row];
    }
    x
}
