//! Inverse dynamics by the recursive Newton-Euler method: gravity, Coriolis and inertial torques.
//!
//! `tau = M(q) ddq + c(q, dq) + g(q)`. Link frames are standard (distal): frame j rides on link j, joint j turns about
//! z of frame j-1. Moments are therefore taken about the origin of frame j-1, which lies on the joint axis. Rotor
//! inertia acts at the joints only (`reflected`): what the fast rotors add to the gyroscopic torques of the links is
//! below 1 % of them and left out, as the manufacturer's model does.

use nalgebra::Vector3;

use crate::model::arm::ArmModel;
use crate::model::kinematics::Frames;
use crate::real::Real;
use crate::units::{JOINTS, JointAccelerations, JointTorques, JointVelocities, Vector6, Vector7};

impl<R: Real> ArmModel<R> {
    /// Returns the weight of the hand as the wrist sensor measures it while the arm is at rest: force (N) and torque
    /// about the sensor's origin (N m), in sensor axes.
    pub fn hanging_weight(&self, frames: &Frames<R>) -> Vector6<R> {
        let force = frames.sensor_to_world().tr_mul(&self.base_acceleration) * -self.hanging_mass;
        let torque = self.hanging_centre.cross(&force);
        Vector6::new(force.x, force.y, force.z, torque.x, torque.y, torque.z)
    }

    /// Torque that holds the arm still: `g(q)` (N m).
    pub fn gravity_torque(&self, frames: &Frames<R>) -> JointTorques<R> {
        JointTorques(self.newton_euler::<false>(frames, &Vector7::zeros(), &Vector7::zeros(), self.base_acceleration))
    }

    /// Coriolis and centrifugal torque: `c(q, dq)` (N m).
    pub fn coriolis_torque(&self, frames: &Frames<R>, dq: &JointVelocities<R>) -> JointTorques<R> {
        JointTorques(self.newton_euler::<true>(frames, &dq.0, &Vector7::zeros(), Vector3::zeros()))
    }

    /// `M(q) ddq + c(q, dq) + g(q)` of the links and the payload, without rotors and friction (N m).
    pub fn inverse_dynamics(
        &self,
        frames: &Frames<R>,
        dq: &JointVelocities<R>,
        ddq: &JointAccelerations<R>,
    ) -> JointTorques<R> {
        JointTorques(self.newton_euler::<true>(frames, &dq.0, &ddq.0, self.base_acceleration))
    }

    /// Torque that accelerates the rotors of the drives, seen at the joints (N m).
    pub fn rotor_torque(&self, ddq: &JointAccelerations<R>) -> JointTorques<R> {
        let mut torque = Vector7::zeros();
        for ((torque, inertia), ddq) in torque.iter_mut().zip(&self.reflected_inertia).zip(ddq.0.iter()) {
            *torque = *inertia * *ddq;
        }
        torque[4] += self.reflected_inertia_j5_j6 * ddq.0[5];
        torque[5] += self.reflected_inertia_j5_j6 * ddq.0[4];
        JointTorques(torque)
    }

    /// One outward and one inward sweep. `MOVING = false` skips the velocity terms.
    fn newton_euler<const MOVING: bool>(
        &self,
        frames: &Frames<R>,
        dq: &Vector7<R>,
        ddq: &Vector7<R>,
        base_acceleration: Vector3<R>,
    ) -> Vector7<R> {
        let mut omega = Vector3::<R>::zeros();
        let mut alpha = Vector3::<R>::zeros();
        let mut acceleration = base_acceleration;
        let mut forces = [Vector3::<R>::zeros(); JOINTS];
        let mut moments = [Vector3::<R>::zeros(); JOINTS];

        for joint in 0..JOINTS {
            let body = &self.bodies[joint];
            // Spin about z of frame j-1: alpha += z ddq + omega x (z dq).
            if MOVING {
                let rate = dq[joint];
                alpha.x += omega.y * rate;
                alpha.y -= omega.x * rate;
                omega.z += rate;
                omega = self.outward(frames, joint, &omega);
            }
            alpha.z += ddq[joint];
            alpha = self.outward(frames, joint, &alpha);
            let arm = self.link_vector(joint);
            acceleration = self.outward(frames, joint, &acceleration) + self.swing::<MOVING>(&omega, &alpha, &arm);
            let at_centre = acceleration + self.swing::<MOVING>(&omega, &alpha, &body.centre);
            let force = at_centre * body.mass;
            let mut moment = body.inertia * alpha;
            if MOVING {
                moment += omega.cross(&(body.inertia * omega));
            }
            moments[joint] = moment + (arm + body.centre).cross(&force);
            forces[joint] = force;
        }

        let mut torque = Vector7::zeros();
        let mut force = Vector3::<R>::zeros();
        let mut moment = Vector3::<R>::zeros();
        for joint in (0..JOINTS).rev() {
            // `force` and `moment` of the next link act at the origin of this frame.
            moment = moments[joint] + moment + self.link_vector(joint).cross(&force);
            force += forces[joint];
            force = self.inward(frames, joint, &force);
            moment = self.inward(frames, joint, &moment);
            torque[joint] = moment.z;
        }
        torque
    }

    /// Acceleration of a point at `arm` on a turning body, relative to its origin.
    #[inline]
    fn swing<const MOVING: bool>(&self, omega: &Vector3<R>, alpha: &Vector3<R>, arm: &Vector3<R>) -> Vector3<R> {
        let tangential = alpha.cross(arm);
        if MOVING { tangential + omega.cross(&omega.cross(arm)) } else { tangential }
    }

    /// From the origin of frame j-1 to that of frame j, in axes of frame j (m).
    #[inline]
    pub(crate) fn link_vector(&self, joint: usize) -> Vector3<R> {
        let offset = self.link_offset[joint];
        Vector3::new(self.link_length[joint], offset * self.twist_sine[joint], offset * self.twist_cosine[joint])
    }

    /// A vector given in frame j-1, in frame j.
    #[inline]
    fn outward(&self, frames: &Frames<R>, joint: usize, v: &Vector3<R>) -> Vector3<R> {
        let (s, c) = (frames.sine[joint], frames.cosine[joint]);
        let (ts, tc) = (self.twist_sine[joint], self.twist_cosine[joint]);
        let y = v.y * c - v.x * s;
        Vector3::new(v.x * c + v.y * s, y * tc + v.z * ts, v.z * tc - y * ts)
    }

    /// A vector given in frame j, in frame j-1.
    #[inline]
    pub(crate) fn inward(&self, frames: &Frames<R>, joint: usize, v: &Vector3<R>) -> Vector3<R> {
        let (s, c) = (frames.sine[joint], frames.cosine[joint]);
        let (ts, tc) = (self.twist_sine[joint], self.twist_cosine[joint]);
        let y = v.y * tc - v.z * ts;
        Vector3::new(v.x * c - y * s, v.x * s + y * c, v.y * ts + v.z * tc)
    }
}
