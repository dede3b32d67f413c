//! The MuJoCo world: the WAM with force/torque sensor and hand at a table, and an object.
//!
//! The model is `model/wam7_bh280.xml`. One physics step lasts [`STEP_SECONDS`]. The seven motors take joint torques;
//! the links of the hand are held where they are told to be. Physics has no randomness: the same inputs give the same
//! bits on the same machine. Seeds belong to the sensors (the plant), to the [`Teacher`](crate::teacher::Teacher) and
//! to [`Imperfections::drawn`].

mod addresses;
mod cables;
mod contacts;
mod error;
mod imperfections;
mod kinematics;
mod object;
mod options;
mod scene;

use super::{HandState, HandTargets, Pose, World};
use crate::rotation::{add_scaled, cross, from_matrix};
use crate::{Held, STEP_SECONDS};
use addresses::Addresses;
use cables::Motors;
use contacts::Parts;
use mujoco_rs::prelude::{MjData, MjModel};
use std::collections::VecDeque;

pub use super::object::ObjectKind;
pub use contacts::ContactForces;
pub use error::WorldError;
pub use imperfections::{Cables, Imperfections};
pub use kinematics::{Kinematics, Unreachable};
pub use object::{ObjectSpec, TABLE_TOP};
pub use options::MujocoOptions;
pub use scene::Scene;

/// The line of the model in whose place a held weight goes, and its name there.
const HELD_LINE: &str = "<!-- held weight -->";
const HELD: &str = "held";

/// Radius of a held weight as a ball, m: it gives it its inertia.
const HELD_RADIUS: f64 = 0.03;

/// Steps over which [`MujocoWorld::mean_contact_forces`] takes the mean: 10 ms, three cycles of control.
const MEAN_STEPS: usize = 18;

/// The WAM with its hand at a table, obeying MuJoCo.
pub struct MujocoWorld {
    data: MjData<Box<MjModel>>,
    addresses: Addresses,
    parts: Parts,
    motors: Option<Motors>,
    push: ([f64; 3], [f64; 3]),
    scene: Scene,
    /// The latest contact forces, the newest last.
    contacts: VecDeque<ContactForces>,
    crush: Crush,
}

/// True after a finger pressed harder than the object bears.
#[derive(Clone, Copy, Debug, Default)]
struct Crush {
    /// Force of the finger that presses hardest, N, smoothed over some 10 ms.
    squeeze: f64,
    crushed: bool,
}

impl MujocoWorld {
    /// Sets the world up, at rest.
    ///
    /// # Errors
    /// [`WorldError`] if an option is out of range or MuJoCo does not take the model.
    pub fn new(options: &MujocoOptions) -> Result<Self, WorldError> {
        let (mut data, addresses, mut motors) = load(options)?;
        let parts = Parts::of(data.model())?;
        place(&mut data, &addresses, options);
        data.forward();
        if let Some(motors) = &mut motors {
            motors.settle(&data, &addresses);
        }
        Ok(Self {
            data,
            addresses,
            parts,
            motors,
            push: ([0.0; 3], [0.0; 3]),
            scene: options.scene,
            contacts: VecDeque::with_capacity(MEAN_STEPS),
            crush: Crush::default(),
        })
    }

    /// Simulated time, s.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.data.time()
    }

    /// Range of each joint between its mechanical stops, rad.
    #[must_use]
    pub fn joint_ranges(&self) -> [[f64; 2]; 7] {
        self.addresses.ranges
    }

    /// Torques that hold the arm against gravity and its own velocity, N m: ideal gravity compensation.
    ///
    /// MuJoCo's bias force, without friction. For tests and set-up; a controller has its own model of the arm.
    #[must_use]
    pub fn bias_torques(&self) -> [f64; 7] {
        let bias = self.data.qfrc_bias();
        self.addresses.velocities.map(|i| bias[i])
    }

    /// Table and object as they were set up.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Pose of the middle of the object's axis, z along the axis; `None` without an object.
    #[must_use]
    pub fn object_pose(&self) -> Option<Pose> {
        let q = &self.data.qpos()[self.addresses.object?..][..7];
        Some(Pose { position: [q[0], q[1], q[2]], quaternion: [q[3], q[4], q[5], q[6]] })
    }

    /// Angle between the object's axis and the vertical (of what stood) or the horizontal (of what lay), rad; `None`
    /// without an object.
    #[must_use]
    pub fn object_tilt(&self) -> Option<f64> {
        let [_, x, y, _] = self.object_pose()?.quaternion;
        // The turned z axis has the vertical component 1 - 2 (x^2 + y^2) = cos(tilt) for a unit quaternion; the half
        // angle keeps the precision that acos loses near 1.
        let from_vertical = 2.0 * x.hypot(y).min(1.0).asin();
        let lay = self.scene.object.is_some_and(|object| object.lies());
        Some(if lay { (from_vertical - std::f64::consts::FRAC_PI_2).abs() } else { from_vertical })
    }

    /// True after a finger has pressed harder than the object bears ([`ObjectSpec::crush_force`]).
    #[must_use]
    pub fn object_crushed(&self) -> bool {
        self.crush.crushed
    }

    /// Contact forces during the last step.
    #[must_use]
    pub fn contact_forces(&self) -> ContactForces {
        self.contacts.back().copied().unwrap_or_default()
    }

    /// Mean of the contact forces over the last 10 ms, three cycles of control.
    #[must_use]
    pub fn mean_contact_forces(&self) -> ContactForces {
        let share = 1.0 / MEAN_STEPS as f64;
        self.contacts.iter().fold(ContactForces::default(), |sum, forces| sum.add_scaled(share, forces))
    }

    /// Number of contacts between the arm or hand and anything else.
    #[must_use]
    pub fn robot_contacts(&self) -> usize {
        self.parts.robot_contacts(&self.data)
    }

    /// Number of warnings MuJoCo raised so far: anything but 0 means that physics broke.
    #[must_use]
    pub fn warnings(&self) -> u64 {
        self.data.warning().iter().map(|w| u64::from(w.number.unsigned_abs())).sum()
    }

    /// Hands the push to MuJoCo as a wrench at the palm's centre of mass, moved there from the grasp point.
    ///
    /// Not as generalized forces: MuJoCo's force sensor takes only wrenches on bodies into account, and the wrist
    /// sensor must feel the teacher.
    fn apply_push(&mut self) {
        let (force, torque) = self.push;
        let palm = self.addresses.palm;
        let lever = add_scaled(self.data.site_xpos()[self.addresses.grasp], -1.0, self.data.xipos()[palm]);
        let torque = add_scaled(torque, 1.0, cross(lever, force));
        let [fx, fy, fz] = force;
        let [tx, ty, tz] = torque;
        self.data.xfrc_applied_mut()[palm] = [fx, fy, fz, tx, ty, tz];
    }

    /// Sets the force (N) that somebody applies to the object at a point (m), both in world axes; it lasts until it is
    /// set again. Does nothing without an object.
    pub fn push_object(&mut self, force: [f64; 3], point: [f64; 3]) {
        let Some(body) = self.addresses.object_body else {
            return;
        };
        let [tx, ty, tz] = cross(add_scaled(point, -1.0, self.data.xipos()[body]), force);
        let [fx, fy, fz] = force;
        self.data.xfrc_applied_mut()[body] = [fx, fy, fz, tx, ty, tz];
    }

    /// Keeps what the solver found about contacts in the step that it just solved.
    fn note_contacts(&mut self) {
        if self.contacts.len() == MEAN_STEPS {
            self.contacts.pop_front();
        }
        let forces = self.parts.forces(&self.data);
        self.contacts.push_back(forces);
        if let Some(limit) = self.scene.object.and_then(|object| object.crush_force) {
            let hardest = forces.fingers_on_object.into_iter().fold(0.0, f64::max);
            self.crush.squeeze += (hardest - self.crush.squeeze) / MEAN_STEPS as f64;
            self.crush.crushed |= self.crush.squeeze > limit;
        }
    }

    /// All generalized positions in the order of the model (object if there is one, arm, fingers), for pictures.
    #[must_use]
    pub fn configuration(&self) -> &[f64] {
        self.data.qpos()
    }
}

impl World for MujocoWorld {
    fn joint_positions(&self) -> [f64; 7] {
        let q = self.data.qpos();
        self.addresses.positions.map(|i| q[i])
    }

    fn joint_velocities(&self) -> [f64; 7] {
        let dq = self.data.qvel();
        self.addresses.velocities.map(|i| dq[i])
    }

    fn motor_positions(&self) -> [f64; 7] {
        self.motors.as_ref().map_or_else(|| self.joint_positions(), |motors| motors.positions)
    }

    fn motor_velocities(&self) -> [f64; 7] {
        self.motors.as_ref().map_or_else(|| self.joint_velocities(), |motors| motors.velocities)
    }

    fn step(&mut self, torques: &[f64; 7]) {
        if let Some(motors) = &mut self.motors {
            let (q, dq) = (self.data.qpos(), self.data.qvel());
            let (q, dq) = (self.addresses.positions.map(|i| q[i]), self.addresses.velocities.map(|i| dq[i]));
            // As generalized forces: the limits of the motors in the model are not those of a cable.
            for (address, torque) in self.addresses.velocities.iter().zip(motors.step(&q, &dq, torques)) {
                self.data.qfrc_applied_mut()[*address] = torque;
            }
        } else {
            for (address, torque) in self.addresses.motors.iter().zip(torques) {
                self.data.ctrl_mut()[*address] = *torque;
            }
        }
        self.apply_push();
        // Second half of the old step, then first half of the next: so positions, poses and contacts that anybody
        // reads between two steps belong to the same instant.
        self.data.step2();
        self.note_contacts();
        self.data.step1();
    }

    fn wrist_wrench(&self) -> [f64; 6] {
        let sensors = self.data.sensordata();
        let (force, torque) = (self.addresses.wrist_force, self.addresses.wrist_torque);
        // MuJoCo reports what the arm exerts on the hand.
        std::array::from_fn(|i| -sensors[if i < 3 { force + i } else { torque + i - 3 }])
    }

    fn grasp_pose(&self) -> Pose {
        let site = self.addresses.grasp;
        Pose { position: self.data.site_xpos()[site], quaternion: from_matrix(&self.data.site_xmat()[site]) }
    }

    fn push(&mut self, force: [f64; 3], torque: [f64; 3]) {
        self.push = (force, torque);
    }

    fn hand(&self) -> HandState {
        let (q, force) = (self.data.qpos(), self.data.actuator_force());
        let a = &self.addresses;
        HandState {
            inner: a.fingers.map(|[inner, _]| q[inner]),
            outer: a.fingers.map(|[_, outer]| q[outer]),
            spread: q[a.spreads[0]],
            inner_load: a.finger_servos.map(|[inner, _]| force[inner]),
            outer_load: a.finger_servos.map(|[_, outer]| force[outer]),
            spread_load: force[a.spread_servo],
        }
    }

    fn drive_hand(&mut self, targets: &HandTargets) {
        let servos = self.data.ctrl_mut();
        for (finger, [inner, outer]) in self.addresses.finger_servos.into_iter().enumerate() {
            servos[inner] = targets.inner[finger];
            servos[outer] = targets.outer[finger];
        }
        servos[self.addresses.spread_servo] = targets.spread;
    }
}

/// A model with its data, where its parts are, and the motors if they turn the joints through elastic cables.
type Loaded = (MjData<Box<MjModel>>, Addresses, Option<Motors>);

/// Loads the model and sets it up as the options say.
fn load(options: &MujocoOptions) -> Result<Loaded, WorldError> {
    // A scene that cannot be is refused before it becomes part of the model's text.
    options.scene.check()?;
    let mut text = options.scene.model(false);
    if let Some(held) = &options.held {
        text = text.replacen(HELD_LINE, &held_body(held), 1);
    }
    let mut model = MjModel::from_xml_string(&text).map_err(|e| WorldError::Model(e.to_string()))?;
    let addresses = Addresses::of(&model)?;
    options::check(options, &addresses)?;
    model.opt_mut().timestep = STEP_SECONDS;
    model.opt_mut().gravity = [0.0, 0.0, options.gravity];
    for (i, factor) in addresses.velocities.into_iter().zip(options.imperfections.friction) {
        let factor = if options.joint_friction { factor } else { 0.0 };
        model.dof_frictionloss_mut()[i] *= factor;
        model.dof_damping_mut()[i] *= factor;
    }
    let motors = options.imperfections.cables.map(|cables| Motors::take_from(&mut model, &addresses, &cables));
    let weighed = options.imperfections.weigh(&mut model)?;
    let mut data = MjData::new(Box::new(model));
    if weighed {
        data.set_const();
    }
    Ok((data, addresses, motors))
}

/// The held weight as a body of the palm: a ball without a surface. The palm begins 6 mm beyond the sensor's
/// origin, turned by pi about z.
fn held_body(held: &Held) -> String {
    let (mass, [x, y, z]) = (held.mass(), held.centre());
    let (place, inertia) = (format!("{} {} {}", -x, -y, z - 0.006), 0.4 * mass * HELD_RADIUS * HELD_RADIUS);
    let inertial = format!(r#"<inertial pos="0 0 0" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>"#);
    format!(r#"<body name="{HELD}" pos="{place}">{inertial}</body>"#)
}

/// Puts arm, hand and object where the options say.
fn place(data: &mut MjData<Box<MjModel>>, addresses: &Addresses, options: &MujocoOptions) {
    // The finger's gears turn the outer link by a third of the inner one (Barrett: 125 / 375).
    let hand = [options.fingers, options.fingers / 3.0];
    let q = data.qpos_mut();
    for (address, angle) in addresses.positions.iter().zip(options.posture) {
        q[*address] = angle;
    }
    if let (Some(address), Some(object)) = (addresses.object, &options.scene.object) {
        q[address..][..7].copy_from_slice(&object.start());
    }
    for (address, angle) in addresses.fingers.into_iter().flat_map(|finger| finger.into_iter().zip(hand)) {
        q[address] = angle;
    }
    for address in addresses.spreads {
        q[address] = options.spread;
    }
    let servos = data.ctrl_mut();
    for (address, angle) in addresses.finger_servos.into_iter().flat_map(|finger| finger.into_iter().zip(hand)) {
        servos[address] = angle;
    }
    servos[addresses.spread_servo] = options.spread;
}
