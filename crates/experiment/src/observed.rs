//! A world that is watched: every 10 ms it is written down where the object is and who presses on whom.

use sim::world::mujoco::MujocoWorld;
use sim::{HandState, HandTargets, Pose, STEP_SECONDS, World};

use super::observation::{Contact, Observation, STEPS_PER_SAMPLE, Sample};

/// Samples between two snapshots for pictures: 0.1 s.
const SAMPLES_PER_SNAPSHOT: usize = 10;

/// The MuJoCo world with an observer beside it who changes nothing.
pub struct ObservedWorld {
    world: MujocoWorld,
    steps: u64,
    observation: Observation,
    snapshots: Vec<Snapshot>,
}

/// All generalized positions at one time, for pictures.
#[derive(Debug, Clone, PartialEq)]
pub struct Snapshot {
    /// Virtual time, s.
    pub time: f64,
    /// Generalized positions in the order of the model.
    pub configuration: Vec<f64>,
}

impl ObservedWorld {
    /// Puts an observer beside a world.
    pub fn new(world: MujocoWorld) -> ObservedWorld {
        ObservedWorld { world, steps: 0, observation: Observation::default(), snapshots: Vec::new() }
    }

    /// The same as a box, for the options of a simulation.
    pub fn wrap_world(world: MujocoWorld) -> Box<dyn World> {
        Box::new(ObservedWorld::new(world))
    }

    /// The world.
    pub fn world(&self) -> &MujocoWorld {
        &self.world
    }

    /// Hands out what was written down.
    pub fn take(&mut self) -> (Observation, Vec<Snapshot>) {
        self.observation.crushed = self.world.object_crushed();
        (std::mem::take(&mut self.observation), std::mem::take(&mut self.snapshots))
    }

    fn observe(&mut self) {
        let time = self.steps as f64 * STEP_SECONDS;
        let forces = self.world.mean_contact_forces();
        let hand = self.world.hand();
        let [x, y, z] = forces.hand_on_table;
        let [inner1, inner2, inner3] = hand.inner;
        self.observation.samples.push(Sample {
            time,
            object: self.world.object_pose().map_or([f64::NAN; 3], |pose| pose.position),
            tilt: self.world.object_tilt().unwrap_or(0.0),
            hand: self.world.grasp_pose().position,
            digits: [hand.spread, inner1, inner2, inner3],
            contact: Contact {
                hand_on_object: forces.hand_on_object,
                fingers: forces.fingers_on_object,
                palm: forces.palm_on_object,
                table: (x * x + y * y + z * z).sqrt(),
            },
        });
        if self.observation.samples.len() % SAMPLES_PER_SNAPSHOT == 1 {
            self.snapshots.push(Snapshot { time, configuration: self.world.configuration().to_vec() });
        }
    }
}

impl World for ObservedWorld {
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
        self.world.step(torques);
        self.steps += 1;
        if self.steps.is_multiple_of(STEPS_PER_SAMPLE as u64) {
            self.observe();
        }
    }

    fn wrist_wrench(&self) -> [f64; 6] {
        self.world.wrist_wrench()
    }

    fn grasp_pose(&self) -> Pose {
        self.world.grasp_pose()
    }

    fn push(&mut self, force: [f64; 3], torque: [f64; 3]) {
        self.world.push(force, torque);
    }

    fn hand(&self) -> HandState {
        self.world.hand()
    }

    fn drive_hand(&mut self, targets: &HandTargets) {
        self.world.drive_hand(targets);
    }
}
