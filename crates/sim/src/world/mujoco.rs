//! The MuJoCo world: the WAM with force/torque sensor and hand, a table, and an upright flashlight.
//!
//! The model is `model/wam7_bh280.xml`. One physics step lasts [`STEP_SECONDS`](crate::STEP_SECONDS). The seven motors
//! take joint torques; the fingers are held where the options say. Physics has no randomness: the same inputs give the
//! same bits on the same machine. Seeds belong to the sensors (the plant) and to the [`Person`](crate::person::Person).

mod addresses;
mod kinematics;

use super::{HOME, Pose, World};
use crate::STEP_SECONDS;
use crate::rotation::{add_scaled, cross, from_matrix};
use addresses::Addresses;
use mujoco_rs::prelude::{MjData, MjModel};

pub use kinematics::{Kinematics, Unreachable};

/// The model, read at compile time: the simulator needs no file at run time.
pub(crate) const MODEL: &str = include_str!("../../model/wam7_bh280.xml");

/// Where the flashlight stands unless told otherwise, world x and y, m.
pub const FLASHLIGHT: [f64; 2] = [0.80, 0.0];

/// Height of the table's top, world z, m.
pub const TABLE_TOP: f64 = -0.15;

/// Half the height of the flashlight, m: its body frame lies this far above the table.
const FLASHLIGHT_HALF_HEIGHT: f64 = 0.125;

/// The table's top, world x and y, m: centre and half extents.
const TABLE_CENTRE: [f64; 2] = [0.80, 0.0];
const TABLE_HALF_EXTENT: [f64; 2] = [0.25, 0.45];

/// How the world is set up before the first step.
#[derive(Clone, Debug)]
pub struct MujocoOptions {
    /// Joint posture in which the arm starts, at rest, rad.
    pub posture: [f64; 7],
    /// Dry and viscous friction of the seven joints (wam7.toml); off makes an ideal drive.
    pub joint_friction: bool,
    /// Where the flashlight stands on the table, world x and y, m.
    pub flashlight: [f64; 2],
    /// Angle at which the inner finger joints are held, rad: 0 is fully open, 2.44 fully closed.
    pub fingers: f64,
    /// Angle at which the spread is held, rad: 0 puts F1 and F2 opposite to F3.
    pub spread: f64,
    /// Gravity along world z, m/s^2.
    pub gravity: f64,
}

impl Default for MujocoOptions {
    /// At home, with friction, the flashlight at [`FLASHLIGHT`], fingers open at 0.25 rad, gravity -9.81 m/s^2.
    fn default() -> Self {
        Self { posture: HOME, joint_friction: true, flashlight: FLASHLIGHT, fingers: 0.25, spread: 0.0, gravity: -9.81 }
    }
}

/// Why a MuJoCo world or its kinematics could not be set up.
#[derive(Debug, thiserror::Error)]
pub enum WorldError {
    /// MuJoCo did not take the model: the library does not fit to this program.
    #[error("MuJoCo refuses the arm model: {0}")]
    Model(String),
    /// The model lacks a part that this program looks up by name.
    #[error("the arm model has no {kind} named `{name}`")]
    Missing {
        /// Kind of the part.
        kind: &'static str,
        /// Name looked for.
        name: String,
    },
    /// A starting joint angle is not a number within the joint's range.
    #[error("joint {joint} cannot start at {angle} rad: its range is {low} .. {high} rad")]
    Posture {
        /// Joint, 1 to 7.
        joint: usize,
        /// Angle asked for, rad.
        angle: f64,
        /// Lower end of its range, rad.
        low: f64,
        /// Upper end of its range, rad.
        high: f64,
    },
    /// The flashlight would stand beside the table.
    #[error("the flashlight cannot stand at ({x}, {y}) m: that is not on the table")]
    OffTable {
        /// World x, m.
        x: f64,
        /// World y, m.
        y: f64,
    },
    /// A finger or spread angle, or gravity, is not a usable number.
    #[error("{what} cannot be {value}")]
    OutOfRange {
        /// What is out of range.
        what: &'static str,
        /// The value asked for.
        value: f64,
    },
}

/// The WAM with its hand at a table, obeying MuJoCo.
pub struct MujocoWorld {
    data: MjData<Box<MjModel>>,
    addresses: Addresses,
    push: ([f64; 3], [f64; 3]),
}

impl MujocoWorld {
    /// Sets the world up, at rest.
    ///
    /// # Errors
    /// [`WorldError`] if an option is out of range or MuJoCo does not take the model.
    pub fn new(options: &MujocoOptions) -> Result<Self, WorldError> {
        let (model, addresses) = load(options)?;
        let mut data = MjData::new(model);
        place(&mut data, &addresses, options);
        data.forward();
        Ok(Self { data, addresses, push: ([0.0; 3], [0.0; 3]) })
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

    /// Pose of the flashlight's centre.
    #[must_use]
    pub fn flashlight_pose(&self) -> Pose {
        let q = &self.data.qpos()[self.addresses.flashlight..][..7];
        Pose { position: [q[0], q[1], q[2]], quaternion: [q[3], q[4], q[5], q[6]] }
    }

    /// Angle between the flashlight's axis and the vertical, rad.
    #[must_use]
    pub fn flashlight_tilt(&self) -> f64 {
        let [_, x, y, _] = self.flashlight_pose().quaternion;
        // The turned z axis has the vertical component 1 - 2 (x^2 + y^2) = cos(tilt) for a unit quaternion; the half angle
        // keeps the precision that acos loses near 1.
        2.0 * x.hypot(y).min(1.0).asin()
    }

    /// Number of contacts between the arm or hand and anything else.
    #[must_use]
    pub fn robot_contacts(&self) -> usize {
        addresses::robot_contacts(&self.data)
    }

    /// Number of warnings MuJoCo raised so far: anything but 0 means that physics broke.
    #[must_use]
    pub fn warnings(&self) -> u64 {
        self.data.warning().iter().map(|w| u64::from(w.number.unsigned_abs())).sum()
    }

    /// Hands the push to MuJoCo as a wrench at the palm's centre of mass, moved there from the grasp point.
    ///
    /// Not as generalized forces: MuJoCo's force sensor takes only wrenches on bodies into account, and the wrist sensor
    /// must feel the person.
    fn apply_push(&mut self) {
        let (force, torque) = self.push;
        let palm = self.addresses.palm;
        let lever = add_scaled(self.data.site_xpos()[self.addresses.grasp], -1.0, self.data.xipos()[palm]);
        let torque = add_scaled(torque, 1.0, cross(lever, force));
        let [fx, fy, fz] = force;
        let [tx, ty, tz] = torque;
        self.data.xfrc_applied_mut()[palm] = [fx, fy, fz, tx, ty, tz];
    }

    /// All generalized positions in the order of the model (flashlight, arm, fingers), for pictures.
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

    fn step(&mut self, torques: &[f64; 7]) {
        for (address, torque) in self.addresses.motors.iter().zip(torques) {
            self.data.ctrl_mut()[*address] = *torque;
        }
        self.apply_push();
        // Second half of the old step, then first half of the next: so positions, poses and contacts that anybody
        // reads between two steps belong to the same instant.
        self.data.step2();
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
}

/// Loads the model and sets it up as the options say.
fn load(options: &MujocoOptions) -> Result<(Box<MjModel>, Addresses), WorldError> {
    let mut model = MjModel::from_xml_string(&without_looks()).map_err(|e| WorldError::Model(e.to_string()))?;
    let addresses = Addresses::of(&model)?;
    check(options, &addresses)?;
    model.opt_mut().timestep = STEP_SECONDS;
    model.opt_mut().gravity = [0.0, 0.0, options.gravity];
    if !options.joint_friction {
        for i in addresses.velocities {
            model.dof_frictionloss_mut()[i] = 0.0;
            model.dof_damping_mut()[i] = 0.0;
        }
    }
    Ok((Box::new(model), addresses))
}

/// The model without the geoms that are only looked at; they would cost an eighth of the time of a step.
fn without_looks() -> String {
    MODEL
        .lines()
        .filter(|line| !line.trim_start().starts_with(r#"<geom class="look""#))
        .flat_map(|line| [line, "\n"])
        .collect()
}

/// Puts arm, fingers and flashlight where the options say.
fn place(data: &mut MjData<Box<MjModel>>, addresses: &Addresses, options: &MujocoOptions) {
    let q = data.qpos_mut();
    for (address, angle) in addresses.positions.iter().zip(options.posture) {
        q[*address] = angle;
    }
    let [x, y] = options.flashlight;
    let upright = [x, y, TABLE_TOP + FLASHLIGHT_HALF_HEIGHT, 1.0, 0.0, 0.0, 0.0];
    q[addresses.flashlight..][..7].copy_from_slice(&upright);
    for [inner, outer] in addresses.fingers {
        q[inner] = options.fingers;
        // The finger's gears turn the outer link by a third of the inner one (Barrett: 125 / 375).
        q[outer] = options.fingers / 3.0;
    }
    for spread in addresses.spreads {
        q[spread] = options.spread;
    }
    let servos = data.ctrl_mut();
    for servo in addresses.finger_servos {
        servos[servo] = options.fingers;
    }
    servos[addresses.spread_servo] = options.spread;
}

/// Parse, do not validate: whatever passes here can be simulated.
fn check(options: &MujocoOptions, addresses: &Addresses) -> Result<(), WorldError> {
    for (i, (&angle, [low, high])) in options.posture.iter().zip(addresses.ranges).enumerate() {
        if !(low..=high).contains(&angle) {
            return Err(WorldError::Posture { joint: i + 1, angle, low, high });
        }
    }
    let [x, y] = options.flashlight;
    let on_table = (0..2).all(|i| (options.flashlight[i] - TABLE_CENTRE[i]).abs() <= TABLE_HALF_EXTENT[i]);
    if !on_table {
        return Err(WorldError::OffTable { x, y });
    }
    for (what, value, [low, high]) in [
        ("the finger angle", options.fingers, addresses.finger_range),
        ("the spread angle", options.spread, addresses.spread_range),
    ] {
        if !(low..=high).contains(&value) {
            return Err(WorldError::OutOfRange { what, value });
        }
    }
    if !options.gravity.is_finite() {
        return Err(WorldError::OutOfRange { what: "gravity", value: options.gravity });
    }
    Ok(())
}
