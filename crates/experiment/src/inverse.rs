//! Inverse kinematics on the host: the posture that reaches a pose, near a given one.
//!
//! Damped least squares on the geometric Jacobian of the controller's model. The redundancy is left alone: the posture
//! found is the one that the shortest way from the given posture ends in.

use control::model::Frames;
use control::units::{JointPositions, Vector6};
use nalgebra::{Quaternion, SMatrix, UnitQuaternion, Vector3};

use lab::arm::MODEL;

/// Damping, m^2: keeps steps finite near a singularity.
const DAMPING: f64 = 1e-5;
/// Longest change of a joint in one iteration, rad.
const LONGEST_STEP: f64 = 0.1;
/// Iterations; from 30 cm away about 20 are needed.
const ITERATIONS: usize = 200;
/// Distance at which the pose counts as reached, m.
const NEAR: f64 = 1e-4;
/// Angle at which it does, rad.
const NEAR_ANGLE: f64 = 1e-3;

/// A posture (rad) within the soft limits whose tool frame is at `position` (m) with `orientation` (w, x, y, z);
/// `None` if none is found.
pub fn reach(position: [f64; 3], orientation: [f64; 4], near: [f64; 7]) -> Option<[f64; 7]> {
    let mut q = near;
    for _ in 0..ITERATIONS {
        let frames = Frames::new(&MODEL, &JointPositions::from_array(q));
        let error = error(&frames, position, orientation);
        if error.fixed_rows::<3>(0).norm() < NEAR && error.fixed_rows::<3>(3).norm() < NEAR_ANGLE {
            return MODEL.within_soft_limits(&JointPositions::from_array(q)).then_some(q);
        }
        let jacobian = frames.jacobian().0;
        let normal = jacobian * jacobian.transpose() + SMatrix::<f64, 6, 6>::identity() * DAMPING;
        let step = jacobian.transpose() * normal.cholesky()?.solve(&error);
        let scale = (LONGEST_STEP / step.amax().max(LONGEST_STEP)).min(1.0);
        q = std::array::from_fn(|joint| q[joint] + scale * step[joint]);
    }
    None
}

/// Distance to the pose: way (m) and turn (rad), world axes.
fn error(frames: &Frames<f64>, position: [f64; 3], [w, x, y, z]: [f64; 4]) -> Vector6<f64> {
    let pose = frames.tool_pose();
    let way = Vector3::from(position) - pose.position;
    let [a, b, c, d] = pose.orientation.0;
    let is = UnitQuaternion::from_quaternion(Quaternion::new(a, b, c, d));
    let turn = (UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)) * is.inverse()).scaled_axis();
    Vector6::new(way.x, way.y, way.z, turn.x, turn.y, turn.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lab::arm::tool_pose;

    /// Goal posture of the flashlight's grasp.
    const GRASP: [f64; 7] = [-0.4886, 1.5620, 1.4710, 1.8464, -0.1700, -0.5803, 1.7510];

    #[test]
    fn ten_centimetres_up_is_ten_centimetres_up() {
        let (position, orientation) = tool_pose(&GRASP);
        let [x, y, z] = position;
        let q = reach([x, y, z + 0.1], orientation, GRASP).expect("the arm reaches there");
        let (found, turned) = tool_pose(&q);
        assert!((found[2] - z - 0.1).abs() < 2e-4 && (found[0] - x).abs() < 2e-4 && (found[1] - y).abs() < 2e-4);
        assert!(lab::demonstration::angle_between(&turned, &orientation) < 2e-3);
    }

    #[test]
    fn what_is_out_of_reach_is_not_found() {
        let (_, orientation) = tool_pose(&GRASP);
        assert_eq!(reach([1.4, 0.2, 0.0], orientation, GRASP), None);
    }
}
