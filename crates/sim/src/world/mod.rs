//! The physical world behind one small trait: an arm that takes joint torques and has positions and a wrist wrench.
//!
//! The plant owns the bus, the pucks and the transmission; a world knows nothing of counts or frames.
//! Two worlds exist: [`FreeJoints`] (pure Rust, for unit tests and for runs without MuJoCo) and the MuJoCo world.

use std::any::Any;

mod free_joints;
#[cfg(feature = "mujoco")]
pub mod mujoco;

pub use free_joints::{FreeJoints, HOME};

/// A rigid pose in the world frame: origin where the axes of joints 1 and 2 meet, z up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Position, m.
    pub position: [f64; 3],
    /// Unit Hamilton quaternion (w, x, y, z) that turns body vectors into world vectors.
    pub quaternion: [f64; 4],
}

/// Where the arm and the things around it obey physics.
///
/// `Any` lets the owner of a plant get its own world back from [`Plant::world`](crate::Plant::world)
/// by upcasting (`let any: &mut dyn Any = plant.world();`), for pictures and for scenes.
pub trait World: Any + Send {
    /// Joint angles q, rad, in the WAM's convention (q = 0: arm straight up).
    fn joint_positions(&self) -> [f64; 7];

    /// Joint velocities dq, rad/s.
    fn joint_velocities(&self) -> [f64; 7];

    /// Advances physics by one step of [`STEP_TICKS`](crate::STEP_TICKS) under joint torques, N m.
    ///
    /// The torques include the brake of idle motors and the operator's hold at start-up, but not friction, gravity or contact: those are the world's.
    fn step(&mut self, torques: &[f64; 7]);

    /// Force (N) then torque (N m) of the environment (the hand and all it touches) **on** the wrist sensor, sensor frame.
    fn wrist_wrench(&self) -> [f64; 6];

    /// Pose of the grasp point (0.132 m beyond the tool plate, turned by pi about z).
    fn grasp_pose(&self) -> Pose;

    /// Sets the wrench a person applies at the grasp point, world frame (N, N m); it lasts until it is set again.
    fn push(&mut self, force: [f64; 3], torque: [f64; 3]);
}
