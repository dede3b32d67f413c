//! `ArmModel`: the parameters of the arm with its payload, in the number type of the control code.

use nalgebra::{Matrix3, Vector3};

use crate::model::calibration::Payload;
use crate::model::wam7;
use crate::model::wam7::{BodyTable, PayloadTable};
use crate::model::weight::WeightCorrection;
use crate::real::Real;
use crate::units::{JOINTS, JointPositions};

/// Mass properties of one link.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Body<R: Real> {
    pub(crate) mass: R,
    /// Centre of mass in the link frame (m).
    pub(crate) centre: Vector3<R>,
    /// Inertia about the centre of mass, axes of the link frame (kg m^2).
    pub(crate) inertia: Matrix3<R>,
}

/// The arm with what is mounted on it.
#[derive(Clone, Debug)]
pub struct ArmModel<R: Real> {
    pub(crate) link_length: [R; JOINTS],
    pub(crate) link_offset: [R; JOINTS],
    pub(crate) twist_cosine: [R; JOINTS],
    pub(crate) twist_sine: [R; JOINTS],
    pub(crate) bodies: [Body<R>; JOINTS],
    pub(crate) reflected_inertia: [R; JOINTS],
    pub(crate) reflected_inertia_j5_j6: R,
    pub(crate) tool_height: R,
    pub(crate) tool_cosine: R,
    pub(crate) tool_sine: R,
    pub(crate) sensor_origin: Vector3<R>,
    /// Mass of what hangs on the wrist sensor (kg).
    pub(crate) hanging_mass: R,
    /// Its centre of mass from the sensor's origin, sensor axes (m).
    pub(crate) hanging_centre: Vector3<R>,
    /// Acceleration that a body at rest must be given to stand still in gravity: -g (m/s^2, world axes).
    pub(crate) base_acceleration: Vector3<R>,
    /// Lower soft limits (rad).
    pub(crate) soft_min: [R; JOINTS],
    /// Upper soft limits (rad).
    pub(crate) soft_max: [R; JOINTS],
}

impl<R: Real> ArmModel<R> {
    /// The arm of `model/wam7.toml` with this payload.
    pub fn new(payload: Payload) -> Self {
        ArmModel::with(payload, 1.0, 0.0, None)
    }

    /// The same arm as a calibration of its weight found it; that of the model if it was found with another payload.
    pub fn corrected(payload: Payload, correction: &WeightCorrection) -> Self {
        ArmModel::with(payload, 1.0, 0.0, Some(correction).filter(|found| found.payload() == payload))
    }

    /// The same arm with every link mass and inertia scaled and extra mass at the tool: for tests of robustness against
    /// a model that is not the plant.
    pub fn disturbed(payload: Payload, inertia_scale: f64, extra_mass: f64) -> Self {
        ArmModel::with(payload, inertia_scale, extra_mass, None)
    }

    fn with(payload: Payload, scale: f64, extra_mass: f64, correction: Option<&WeightCorrection>) -> Self {
        let mounted = match payload {
            Payload::None => wam7::PAYLOAD_NONE,
            Payload::SensorAndHand => wam7::PAYLOAD_HAND,
        };
        let mut tables = wam7::LINKS;
        for table in &mut tables {
            table.mass *= scale;
            table.inertia = table.inertia.map(|value| value * scale);
        }
        let extra = BodyTable { mass: extra_mass, centre: [0.0, 0.0, mounted.tool_z], inertia: [0.0; 6] };
        let [first, second, third, fourth, fifth, sixth, last] = tables;
        let last = merged(merged(last, mounted.body), extra);
        let mut bodies = [first, second, third, fourth, fifth, sixth, last];
        if let Some(correction) = correction {
            correction.apply(&mut bodies);
        }
        let real = |values: [f64; JOINTS]| values.map(R::constant);
        let PayloadTable { tool_z, tool_cosine, tool_sine, .. } = mounted;
        ArmModel {
            link_length: real(wam7::DH_A),
            link_offset: real(wam7::DH_D),
            twist_cosine: real(wam7::DH_COSINE),
            twist_sine: real(wam7::DH_SINE),
            bodies: bodies.map(body),
            reflected_inertia: real(wam7::REFLECTED_INERTIA),
            reflected_inertia_j5_j6: R::constant(wam7::REFLECTED_INERTIA_J5_J6),
            tool_height: R::constant(tool_z),
            tool_cosine: R::constant(tool_cosine),
            tool_sine: R::constant(tool_sine),
            sensor_origin: Vector3::from(wam7::SENSOR_ORIGIN.map(R::constant)),
            hanging_mass: R::constant(match payload {
                Payload::None => 0.0,
                Payload::SensorAndHand => wam7::HAND_MASS,
            }),
            hanging_centre: Vector3::from(wam7::HAND_CENTRE.map(R::constant)),
            base_acceleration: -Vector3::from(wam7::GRAVITY.map(R::constant)),
            soft_min: real(wam7::SOFT_MIN),
            soft_max: real(wam7::SOFT_MAX),
        }
    }

    /// True if every joint lies within its soft limits. False for a NaN.
    pub fn within_soft_limits(&self, q: &JointPositions<R>) -> bool {
        q.0.iter().zip(self.soft_min.iter().zip(&self.soft_max)).all(|(q, (min, max))| q >= min && q <= max)
    }
}

/// Two rigid bodies as one (parallel-axis theorem), in the same frame.
fn merged(one: BodyTable, other: BodyTable) -> BodyTable {
    let mass = one.mass + other.mass;
    if other.mass == 0.0 {
        return one;
    }
    let mut centre = [0.0; 3];
    for (centre, (a, b)) in centre.iter_mut().zip(one.centre.iter().zip(&other.centre)) {
        *centre = (one.mass * a + other.mass * b) / mass;
    }
    let mut inertia = [0.0; 6];
    for part in [one, other] {
        let [x, y, z] = part.centre;
        let [cx, cy, cz] = centre;
        let (x, y, z) = (x - cx, y - cy, z - cz);
        let shift = [y * y + z * z, x * x + z * z, x * x + y * y, -x * y, -x * z, -y * z];
        for (sum, (own, shift)) in inertia.iter_mut().zip(part.inertia.iter().zip(shift)) {
            *sum += own + part.mass * shift;
        }
    }
    BodyTable { mass, centre, inertia }
}

fn body<R: Real>(table: BodyTable) -> Body<R> {
    let [xx, yy, zz, xy, xz, yz] = table.inertia.map(R::constant);
    Body {
        mass: R::constant(table.mass),
        centre: Vector3::from(table.centre.map(R::constant)),
        inertia: Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
    }
}
