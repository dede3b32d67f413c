//! A world with a person in it.

use super::Person;
use crate::rotation::add_scaled;
use crate::{HandState, HandTargets, Pose, World};

/// A world in which a [`Person`] stands beside the arm: before every physics step they pull at the grasp point.
///
/// To the plant it is a world like any other. Whoever owns the plant reaches the person by upcasting
/// `plant.world()` to `Any` and tells them to [`begin`](Person::begin).
#[derive(Debug)]
pub struct GuidedWorld<W: World> {
    world: W,
    person: Person,
    outside: ([f64; 3], [f64; 3]),
}

impl<W: World> GuidedWorld<W> {
    /// Puts the person into the world.
    #[must_use]
    pub fn new(world: W, person: Person) -> Self {
        Self { world, person, outside: ([0.0; 3], [0.0; 3]) }
    }

    /// The world without the person.
    #[must_use]
    pub fn world(&self) -> &W {
        &self.world
    }

    /// The world without the person, to change it.
    pub fn world_mut(&mut self) -> &mut W {
        &mut self.world
    }

    /// The person.
    #[must_use]
    pub fn person(&self) -> &Person {
        &self.person
    }

    /// The person, to tell them to begin.
    pub fn person_mut(&mut self) -> &mut Person {
        &mut self.person
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
        let (force, torque) = self.person.pull(&self.world.grasp_pose());
        self.world.push(add_scaled(self.outside.0, 1.0, force), add_scaled(self.outside.1, 1.0, torque));
        self.world.step(torques);
    }

    fn wrist_wrench(&self) -> [f64; 6] {
        self.world.wrist_wrench()
    }

    fn grasp_pose(&self) -> Pose {
        self.world.grasp_pose()
    }

    /// Somebody else's push, added to the person's.
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
