//! The plan of a primitive: its rollout at the control rate without feedback, from the start of its demonstration.

use control::plan::primitive::{Coupling, Reference, Rollout, StartState};
use dmp::RolloutError;

use crate::demonstration::{RATE, angle_between};
use crate::plot::movement::PosePath;
use crate::primitive_file::HostPrimitive;

/// Control period, s.
pub const PERIOD: f64 = 1.0 / RATE;

/// The references of every cycle from the first to the one at the end of the movement.
///
/// # Errors
/// The stored start is no valid start ([`RolloutError`]).
pub fn roll_out(primitive: &HostPrimitive) -> Result<Vec<Reference<f64>>, RolloutError> {
    let movement = primitive.movement();
    let mut rollout = Rollout::start(movement, &StartState::demonstrated(movement))?;
    let cycles = cycles(movement.duration());
    (0..cycles).map(|_| rollout.step(movement, PERIOD, &Coupling::NONE)).collect()
}

/// Distance of the plan from its goal (m) and angle (rad), `seconds` behind the end of the movement.
///
/// # Errors
/// The stored start is no valid start ([`RolloutError`]).
pub fn left_behind(primitive: &HostPrimitive, seconds: f64) -> Result<(f64, f64), RolloutError> {
    let movement = primitive.movement();
    let mut rollout = Rollout::start(movement, &StartState::demonstrated(movement))?;
    let mut last = rollout.step(movement, PERIOD, &Coupling::NONE)?;
    for _ in 1..cycles(movement.duration() + seconds) {
        last = rollout.step(movement, PERIOD, &Coupling::NONE)?;
    }
    let goal = &movement.goal().poses[0];
    let away = (0..3).map(|axis| (last.poses[0].position.x[axis] - goal.position[axis]).powi(2)).sum::<f64>().sqrt();
    let q = &goal.orientation;
    Ok((away, angle_between(&orientation(&last), &[q.w, q.x, q.y, q.z])))
}

/// Cycles of a movement of `duration` s, both ends included.
pub fn cycles(duration: f64) -> usize {
    (duration * RATE).round() as usize + 1
}

/// The poses of a plan, for a figure.
pub fn pose_path(references: &[Reference<f64>]) -> PosePath {
    PosePath {
        time: references.iter().map(|reference| reference.time).collect(),
        position: references.iter().map(|reference| reference.poses[0].position.x).collect(),
        orientation: references.iter().map(orientation).collect(),
    }
}

/// Orientation of a reference as (w, x, y, z).
pub fn orientation(reference: &Reference<f64>) -> [f64; 4] {
    let q = &reference.poses[0].orientation.quaternion;
    [q.w, q.x, q.y, q.z]
}
