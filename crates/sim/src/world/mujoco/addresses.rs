//! Where the parts of the model lie in MuJoCo's arrays, looked up once by name.

use super::error::WorldError;
use mujoco_rs::prelude::{MjModel, MjtObjBase};

/// Indices into MuJoCo's arrays.
#[derive(Clone, Debug)]
pub(super) struct Addresses {
    /// The seven joints in the generalized positions.
    pub(super) positions: [usize; 7],
    /// The seven joints in the generalized velocities.
    pub(super) velocities: [usize; 7],
    /// Ranges of the seven joints, rad.
    pub(super) ranges: [[f64; 2]; 7],
    /// Range of an inner finger joint, rad.
    pub(super) finger_range: [f64; 2],
    /// Range of the spread, rad.
    pub(super) spread_range: [f64; 2],
    /// The seven torque motors in the controls.
    pub(super) motors: [usize; 7],
    /// Position and quaternion of the object in the generalized positions; `None` in a scene without one.
    pub(super) object: Option<usize>,
    /// The object among the bodies.
    pub(super) object_body: Option<usize>,
    /// Inner and outer joint of F1, F2, F3 in the generalized positions.
    pub(super) fingers: [[usize; 2]; 3],
    /// The spread joints of F1 and F2 in the generalized positions.
    pub(super) spreads: [usize; 2],
    /// The servos of the inner and outer links of F1, F2, F3 in the controls.
    pub(super) finger_servos: [[usize; 2]; 3],
    /// The servo of the spread in the controls.
    pub(super) spread_servo: usize,
    /// The grasp point among the sites.
    pub(super) grasp: usize,
    /// The palm among the bodies.
    pub(super) palm: usize,
    /// Force of the arm on the hand in the sensor data.
    pub(super) wrist_force: usize,
    /// Torque of the arm on the hand in the sensor data.
    pub(super) wrist_torque: usize,
}

impl Addresses {
    /// Looks everything up.
    pub(super) fn of(model: &MjModel) -> Result<Self, WorldError> {
        let find = |kind: MjtObjBase, word: &'static str, name: &str| {
            model.name_to_id(kind, name).ok_or_else(|| WorldError::Missing { kind: word, name: name.to_owned() })
        };
        let joint = |name: &str| find(MjtObjBase::mjOBJ_JOINT, "joint", name);
        let servo = |name: &str| find(MjtObjBase::mjOBJ_ACTUATOR, "actuator", name);
        // MuJoCo numbers with `int`; an index that it gives out itself is never negative.
        let position = |name: &str| joint(name).map(|i| model.jnt_qposadr()[i] as usize);
        let velocity = |name: &str| joint(name).map(|i| model.jnt_dofadr()[i] as usize);
        let sensor =
            |name: &str| find(MjtObjBase::mjOBJ_SENSOR, "sensor", name).map(|i| model.sensor_adr()[i] as usize);
        let range = |name: &str| joint(name).map(|i| model.jnt_range()[i]);
        Ok(Self {
            ranges: seven(|j| range(&format!("j{j}")))?,
            finger_range: range("f1_inner")?,
            spread_range: range("f1_spread")?,
            positions: seven(|j| position(&format!("j{j}")))?,
            velocities: seven(|j| velocity(&format!("j{j}")))?,
            motors: seven(|j| servo(&format!("tau{j}")))?,
            object: position("object_free").ok(),
            object_body: model.name_to_id(MjtObjBase::mjOBJ_BODY, "object"),
            fingers: [
                [position("f1_inner")?, position("f1_outer")?],
                [position("f2_inner")?, position("f2_outer")?],
                [position("f3_inner")?, position("f3_outer")?],
            ],
            spreads: [position("f1_spread")?, position("f2_spread")?],
            finger_servos: [
                [servo("f1_inner")?, servo("f1_outer")?],
                [servo("f2_inner")?, servo("f2_outer")?],
                [servo("f3_inner")?, servo("f3_outer")?],
            ],
            spread_servo: servo("spread")?,
            grasp: find(MjtObjBase::mjOBJ_SITE, "site", "grasp")?,
            palm: find(MjtObjBase::mjOBJ_BODY, "body", "bh_palm")?,
            wrist_force: sensor("wrist_force")?,
            wrist_torque: sensor("wrist_torque")?,
        })
    }
}

/// One value per joint, 1 to 7.
fn seven<T: Copy + Default>(value: impl Fn(usize) -> Result<T, WorldError>) -> Result<[T; 7], WorldError> {
    let mut all = [T::default(); 7];
    for (i, slot) in all.iter_mut().enumerate() {
        *slot = value(i + 1)?;
    }
    Ok(all)
}
