//! The arm's model in double precision, as the host uses it: kinematics and limits from `control`.

use std::sync::LazyLock;

use control::act::TorqueLimiter;
use control::model::{ArmModel, Calibration, Frames, Payload};
use control::units::JointPositions;

/// Equipment of every arm that Tactus moves: force/torque sensor and hand; the tool frame is the grasp point.
pub const PAYLOAD: Payload = Payload::SensorAndHand;

/// The model.
pub static MODEL: LazyLock<ArmModel<f64>> = LazyLock::new(|| ArmModel::new(PAYLOAD));

/// Position (m, world) and orientation (w, x, y, z; tool to world) of the tool frame at joint angles `q` (rad).
pub fn tool_pose(q: &[f64; 7]) -> ([f64; 3], [f64; 4]) {
    let pose = Frames::new(&MODEL, &JointPositions::from_array(*q)).tool_pose();
    (pose.position.into(), pose.orientation.0)
}

/// Torque that the limiter grants each joint, N m.
pub static TORQUE_LIMITS: LazyLock<[f64; 7]> =
    LazyLock::new(|| *TorqueLimiter::new(&Calibration::nominal(PAYLOAD)).joint_limits());
