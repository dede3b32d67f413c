//! A world with a teacher in it.

use super::Teacher;
use crate::rotation::add_scaled;
use crate::{HandState, HandTargets, Pose, World};

/// A world in which a [`Teacher`] stands beside the arm: before every physics step they pull at the grasp point.
///
/// To the plant it is a world like any other. Whoever owns the plant reaches the teacher by upcasting
/// `plant.world()` to `Any` and tells them to [`begin`](Teacher::begin).
#[derive(Debug)]
pub struct GuidedWorld<W: World> {
    world: W,
    teacher: Teacher,
    outside: ([f64; 3], [f64; 3]),
}

impl<W: World> GuidedWorld<W> {
    /// Puts the teacher into the world.
    #[must_use]
    pub fn new(world: W, teacher: Teacher) -> Self {
        Self { world, teacher, outside: ([0.0; 3], [0.0; 3]) }
    }

    /// The world without the teacher.
    #[must_use]
    pub fn world(&self) -> &W {
        &self.world
    }

    /// The world without the teacher, to change it.
    pub fn world_mut(&mut self) -> &mut W {
        &mut self.world
    }

    /// The teacher.
    #[must_use]
    pub fn teacher(&self) -> &Teacher {
        &self.teacher
    }

    /// The teacher, to tell them to begin.
    pub fn teacher_mut(&mut self) -> &mut Teacher {
        &mut self.teacher
    }
}

impl<W: World> World for GuidedWorld<W> {
    fn joint_positions(&self) -> [f64; 7] {
        self.world.joint_positions()
    }

    fn joint_velocities(&self) -> [f64; 7] {
        self.world.joint_velocities()
    }

    fn motor_positions(&self) -> [f64; 7] {
        self.world.motor_positions()
    }

    fn motor_velocities(&self) -> [f64; 7] {
        self.world.motor_velocities()
    }

    fn step(&mut self, torques: &[f64; 7]) {
        let (force, torque) = self.teacher.pull(&self.world.grasp_pose());
        self.world.push(add_scaled(self.outside.0, 1.0, force), add_scaled(self.outside.1, 1.0, torque));
        self.world.step(torques);
    }

    fn wrist_wrench(&self) -> [f64; 6] {
        self.world.wrist_wrench()
    }

    fn grasp_pose(&self) -> Pose {
        self.world.grasp_pose()
    }

    /// Somebody else's push, added to the teacher's.
    fn push(&mut self, force: [f64; 3], torque: [f64; 3]) {
        self.outside = (force, torque);
    }

    fn hand(&self) -> HandState {
        self.world.hand()
    }

    fn drive_hand(&mut self, targets: &HandTargets) {
        self.world.drive_hand(targets);
    }
}
