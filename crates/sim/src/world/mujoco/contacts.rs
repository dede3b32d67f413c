//! Who presses on whom: contact forces, summed by pairs of parts.

use super::error::WorldError;
use crate::rotation::norm;
use mujoco_rs::prelude::{MjData, MjModel, MjtObjBase};

/// Forces between hand, object and table in one physics step.
///
/// Single steps of a rigid-body solver show spikes that no sensor would feel: judge means over some 10 ms.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactForces {
    /// Net force of the robot (hand and arm) on the object, world axes, N.
    pub hand_on_object: [f64; 3],
    /// Force of F1, F2, F3 on the object: sum of the magnitudes over the contacts of each finger, N.
    pub fingers_on_object: [f64; 3],
    /// Force of the palm with the fingers' knuckles on the object, N.
    pub palm_on_object: f64,
    /// Net force of the robot on the table (and the floor), world axes, N.
    pub hand_on_table: [f64; 3],
    /// Net force of the object on its ground, world axes, N; zero while the untouched object sleeps.
    pub object_on_table: [f64; 3],
}

impl ContactForces {
    /// Element by element: `self + scale other`, for means over several steps.
    #[must_use]
    pub fn add_scaled(&self, scale: f64, other: &Self) -> Self {
        let sum = |a: [f64; 3], b: [f64; 3]| crate::rotation::add_scaled(a, scale, b);
        Self {
            hand_on_object: sum(self.hand_on_object, other.hand_on_object),
            fingers_on_object: sum(self.fingers_on_object, other.fingers_on_object),
            palm_on_object: self.palm_on_object + scale * other.palm_on_object,
            hand_on_table: sum(self.hand_on_table, other.hand_on_table),
            object_on_table: sum(self.object_on_table, other.object_on_table),
        }
    }
}

/// Owner of a geom.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    /// Table or floor.
    Table,
    /// The object's own ground.
    Ground,
    Object,
    Finger(usize),
    Palm,
    Arm,
}

/// The parts to which the geoms of a model belong.
#[derive(Clone, Debug)]
pub(super) struct Parts(Vec<Part>);

impl Parts {
    /// Looks up what every geom belongs to.
    pub(super) fn of(model: &MjModel) -> Result<Self, WorldError> {
        let body = |name: &str| model.name_to_id(MjtObjBase::mjOBJ_BODY, name);
        let needed = |name: &str| body(name).ok_or_else(|| WorldError::Missing { kind: "body", name: name.to_owned() });
        let palm = [needed("bh_palm")?, needed("f1_spread")?, needed("f2_spread")?, needed("f3_base")?];
        let fingers = [
            [needed("f1_inner")?, needed("f1_outer")?],
            [needed("f2_inner")?, needed("f2_outer")?],
            [needed("f3_inner")?, needed("f3_outer")?],
        ];
        let object = body("object");
        let ground = model.name_to_id(MjtObjBase::mjOBJ_GEOM, "ground");
        let part = |(geom, &owner): (usize, &i32)| {
            // MuJoCo numbers with `int`; an index that it gives out itself is never negative.
            let owner = owner as usize;
            match owner {
                0 if Some(geom) == ground => Part::Ground,
                0 => Part::Table,
                _ if Some(owner) == object => Part::Object,
                _ if palm.contains(&owner) => Part::Palm,
                _ => fingers.iter().position(|links| links.contains(&owner)).map_or(Part::Arm, Part::Finger),
            }
        };
        Ok(Self(model.geom_bodyid().iter().enumerate().map(part).collect()))
    }

    /// Part of a geom by MuJoCo's number, which is -1 for what is no geom.
    fn part(&self, geom: i32) -> Option<Part> {
        usize::try_from(geom).ok().and_then(|geom| self.0.get(geom).copied())
    }

    /// Number of contacts in which the arm or the hand takes part.
    pub(super) fn robot_contacts(&self, data: &MjData<Box<MjModel>>) -> usize {
        let robot = |geom| matches!(self.part(geom), Some(Part::Arm | Part::Palm | Part::Finger(_)));
        data.contact().iter().filter(|contact| robot(contact.geom1) || robot(contact.geom2)).count()
    }

    /// The forces that the solver found. Valid between the solver and the next collision detection.
    pub(super) fn forces(&self, data: &MjData<Box<MjModel>>) -> ContactForces {
        let mut sum = ContactForces::default();
        for (i, contact) in data.contact().iter().enumerate() {
            // Contacts the solver did not see (sleeping bodies) carry nothing.
            if contact.efc_address < 0 {
                continue;
            }
            let (Some(first), Some(second)) = (self.part(contact.geom1), self.part(contact.geom2)) else {
                continue;
            };
            let [along, across, aside, ..] = data.contact_force(i);
            let f = &contact.frame;
            // Rows of the contact frame: normal from the first geom to the second, two tangents. The force acts on the
            // second.
            let on_second: [f64; 3] = std::array::from_fn(|k| f[k] * along + f[k + 3] * across + f[k + 6] * aside);
            let on_first = on_second.map(|x| -x);
            for (on, by, force) in [(first, second, on_first), (second, first, on_second)] {
                sum.note(on, by, force);
            }
        }
        sum
    }
}

impl ContactForces {
    /// Adds the force of one contact, of `by` on `on`.
    fn note(&mut self, on: Part, by: Part, force: [f64; 3]) {
        let target = match (on, by) {
            (Part::Object, Part::Arm) => &mut self.hand_on_object,
            (Part::Object, Part::Palm) => {
                self.palm_on_object += norm(force);
                &mut self.hand_on_object
            }
            (Part::Object, Part::Finger(finger)) => {
                self.fingers_on_object[finger] += norm(force);
                &mut self.hand_on_object
            }
            (Part::Table, Part::Arm | Part::Palm | Part::Finger(_)) => &mut self.hand_on_table,
            (Part::Ground, Part::Object) => &mut self.object_on_table,
            _ => return,
        };
        *target = crate::rotation::add_scaled(*target, 1.0, force);
    }
}
