//! The physical world behind one small trait: an arm that takes joint torques and has positions and a wrist wrench.
//!
//! The plant owns the bus, the pucks and the transmission; a world knows nothing of counts or frames.
//! Two worlds exist: [`FreeJoints`] (pure Rust, for unit tests and for runs without MuJoCo) and the MuJoCo world.

use std::any::Any;

mod free_joints;
mod held;
#[cfg(feature = "mujoco")]
pub mod mujoco;
mod object;
mod object_file;
mod rigid_bodies;

pub use free_joints::{FingerObstacle, FreeJoints, HOME};
pub use held::{Held, NotHeld};
pub use object::{ObjectKind, UnknownObject};
pub use object_file::{Head, Material, ObjectFileError, ObjectRow, Ring};

/// Stream of random numbers from which an arm other than the nominal one is drawn, and nothing else.
const ARM_STREAM: u64 = 0x696d_7065_7266;

/// A rigid pose in the world frame: origin where the axes of joints 1 and 2 meet, z up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Position, m.
    pub position: [f64; 3],
    /// Unit Hamilton quaternion (w, x, y, z) that turns body vectors into world vectors.
    pub quaternion: [f64; 4],
}

/// Where the links of the hand are, and what its drives exert on them. Fingers in the order F1, F2, F3.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HandState {
    /// Inner links, rad; 0 open, positive closing.
    pub inner: [f64; 3],
    /// Outer links relative to the inner ones, rad, in Barrett's zero (without the some 42 degrees of bend).
    pub outer: [f64; 3],
    /// Spread, rad; at 0 F1 and F2 stand opposite F3.
    pub spread: f64,
    /// Torque of the drive on each inner link about its joint, N m, positive closing.
    pub inner_load: [f64; 3],
    /// Torque of the drive on each outer link about its joint, N m, positive closing: what a strain gauge feels.
    pub outer_load: [f64; 3],
    /// Torque of the drive on the spread, N m, positive towards larger spread.
    pub spread_load: f64,
}

/// Where the worm drives of the hand hold its links, rad; zeros and order as in [`HandState`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HandTargets {
    /// Inner links.
    pub inner: [f64; 3],
    /// Outer links relative to the inner ones.
    pub outer: [f64; 3],
    /// Spread.
    pub spread: f64,
}

/// Where the arm and the things around it obey physics.
///
/// Torques of [`World::step`] act on the motor side: a world with elastic cables lets the motors of
/// [`World::motor_positions`] take them.
///
/// `Any` lets the owner of a plant get its own world back from [`Plant::world`](crate::Plant::world)
/// by upcasting (`let any: &mut dyn Any = plant.world();`), for pictures and for scenes.
pub trait World: Any + Send {
    /// Joint angles q, rad, in the WAM's convention (q = 0: arm straight up).
    fn joint_positions(&self) -> [f64; 7];

    /// Joint velocities dq, rad/s.
    fn joint_velocities(&self) -> [f64; 7];

    /// Angles at the motor side of the cables, reflected to the joints, rad: what the encoders see. Rigid cables: the
    /// joints' own.
    fn motor_positions(&self) -> [f64; 7] {
        self.joint_positions()
    }

    /// Velocities at the motor side of the cables, reflected to the joints, rad/s.
    fn motor_velocities(&self) -> [f64; 7] {
        self.joint_velocities()
    }

    /// Advances physics by one step of [`STEP_TICKS`](crate::STEP_TICKS) under joint torques, N m.
    ///
    /// The torques include the brake of idle motors and the operator's hold at start-up, but not friction, gravity or
    /// contact: those are the world's.
    fn step(&mut self, torques: &[f64; 7]);

    /// Force (N) then torque (N m) of the environment (the hand and all it touches) **on** the wrist sensor, sensor
    /// frame.
    fn wrist_wrench(&self) -> [f64; 6];

    /// Pose of the grasp point (0.132 m beyond the tool plate, turned by pi about z).
    fn grasp_pose(&self) -> Pose;

    /// Sets the wrench a person applies at the grasp point, world frame (N, N m); it lasts until it is set again.
    fn push(&mut self, force: [f64; 3], torque: [f64; 3]);

    /// The links of the hand and what its drives exert on them, after the last step.
    fn hand(&self) -> HandState;

    /// Sets where the worm drives hold the links of the hand from the next step on, until it is set again.
    fn drive_hand(&mut self, targets: &HandTargets);
}
