//! The object on the table: kind, place, mass and frictions, and its bodies in MuJoCo's language.
//!
//! Friction between two geoms is the object's finger friction where the robot touches it, and its table friction where
//! its ground does, neither mixed with the other side's: the geoms carry MuJoCo's `priority` (object 1, ground 2, robot
//! 0), and the higher one decides alone.

use super::error::WorldError;
use crate::world::ObjectKind;
use std::f64::consts::FRAC_PI_2;
use std::fmt::Write as _;

/// Height of the table's top, world z, m.
pub const TABLE_TOP: f64 = -0.15;

/// An object and where it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObjectSpec {
    /// Its kind.
    pub kind: ObjectKind,
    /// Place of its middle, world x and y, m.
    pub position: [f64; 2],
    /// Turn about the vertical, rad; a bottle of yaw 0 lies along world x.
    pub yaw: f64,
    /// Mass, kg.
    pub mass: f64,
    /// Radius where it is grasped, m; a flashlight's head grows with it.
    pub radius: f64,
    /// Coefficient of friction with the table.
    pub table_friction: f64,
    /// Coefficient of friction with fingers and palm.
    pub finger_friction: f64,
    /// Force of one finger that crushes it, N (mean over some 10 ms); `None` for what cannot be crushed.
    pub crush_force: Option<f64>,
}

impl ObjectSpec {
    /// An object with its usual measures at its usual place.
    #[must_use]
    pub fn new(kind: ObjectKind) -> Self {
        let row = kind.row();
        Self {
            kind,
            position: row.position,
            yaw: 0.0,
            mass: row.mass,
            radius: row.radius,
            table_friction: row.table_friction,
            finger_friction: row.finger_friction,
            crush_force: row.crush_force,
        }
    }

    /// The same object elsewhere, world x and y, m.
    #[must_use]
    pub fn at(self, position: [f64; 2]) -> Self {
        Self { position, ..self }
    }

    /// Length of its axis, m.
    #[must_use]
    pub fn height(&self) -> f64 {
        self.kind.row().height
    }

    /// True if its axis is horizontal at the start.
    #[must_use]
    pub fn lies(&self) -> bool {
        self.kind.row().lies
    }

    /// Radius of its foot, m: about its rim it topples.
    #[must_use]
    pub fn foot_radius(&self) -> f64 {
        self.kind.row().head.map_or(self.radius, |head| head.radius * self.radius)
    }

    /// Horizontal force at a height above the table that topples it, N: `m g r / h`. It slides instead where that
    /// exceeds friction, below the height `r / mu`.
    #[must_use]
    pub fn toppling_force(&self, height: f64) -> f64 {
        self.mass * 9.81 * self.foot_radius() / height
    }

    /// Generalized positions at the start: position, then quaternion (w, x, y, z). The body frame is in the middle of
    /// the axis, z along it.
    pub(super) fn start(&self) -> [f64; 7] {
        let [x, y] = self.position;
        let (lean, above) = if self.lies() { (FRAC_PI_2, self.radius) } else { (0.0, 0.5 * self.height()) };
        let ((sy, cy), (sl, cl)) = ((0.5 * self.yaw).sin_cos(), (0.5 * lean).sin_cos());
        // First the lean about y, then the yaw about z.
        [x, y, TABLE_TOP + above, cy * cl, -sy * sl, cy * sl, sy * cl]
    }

    /// Refuses what cannot be simulated.
    pub(super) fn check(&self) -> Result<(), WorldError> {
        for (what, value, range) in [
            ("the object's mass", self.mass, 0.005..=20.0),
            ("the object's radius", self.radius, 0.005..=0.15),
            ("the object's table friction", self.table_friction, 0.0..=3.0),
            ("the object's finger friction", self.finger_friction, 0.0..=3.0),
            ("the object's yaw", self.yaw, -7.0..=7.0),
        ] {
            if !range.contains(&value) {
                return Err(WorldError::OutOfRange { what, value });
            }
        }
        Ok(())
    }

    /// The object's ground and body. Geoms of the class "look" stand one a line.
    pub(super) fn xml(&self) -> String {
        let mut text = String::new();
        // A lying bottle rolls: 0.5 mm is the rolling resistance of hard plastic on wood. What stands does not roll.
        let ground_dimensions = if self.lies() { 6 } else { 3 };
        let table = self.table_friction;
        // Writing into a String cannot fail, here and below.
        let _ = write!(
            text,
            r#"    <geom name="ground" type="plane" size="3 3 0.1" pos="0 0 {TABLE_TOP}" contype="8" conaffinity="4" priority="2" condim="{ground_dimensions}" friction="{table} 0.005 0.0005" group="3"/>
    <body name="object">
      <freejoint name="object_free"/>
"#
        );
        for part in self.parts() {
            let _ = writeln!(
                text,
                r#"      <geom type="cylinder" size="{} {}" pos="0 0 {}" mass="{}" contype="4" conaffinity="2" priority="1" condim="4" friction="{} 0.01 0.0005" group="3"/>"#,
                part.radius,
                0.5 * (part.top - part.bottom),
                0.5 * (part.top + part.bottom),
                part.mass,
                self.finger_friction
            );
        }
        // Rings of material; heights over the foot, where the body's frame is in the middle of the axis.
        let half = 0.5 * self.height();
        for ring in &self.kind.row().rings {
            let (radius, bottom, top) = (ring.radius * self.radius, ring.bottom - half, ring.top - half);
            let material = ring.material.name();
            let _ = writeln!(
                text,
                r#"      <geom class="look" type="cylinder" size="{radius}" fromto="0 0 {bottom} 0 0 {top}" material="{material}"/>"#
            );
        }
        text.push_str("    </body>\n");
        text
    }

    /// The cylinders that collide, evenly dense.
    fn parts(&self) -> Vec<Part> {
        let half = 0.5 * self.height();
        let mut parts = Vec::new();
        let mut bottom = -half;
        if let Some(head) = self.kind.row().head {
            parts.push(Part { radius: self.foot_radius(), bottom, top: head.height - half, mass: 0.0 });
            bottom = head.height - half;
        }
        parts.push(Part { radius: self.radius, bottom, top: half, mass: 0.0 });
        // The common factor pi drops out.
        let volume = |part: &Part| part.radius * part.radius * (part.top - part.bottom);
        let total: f64 = parts.iter().map(volume).sum();
        for part in &mut parts {
            part.mass = self.mass * volume(part) / total;
        }
        parts
    }
}

/// A cylinder of the object that collides.
struct Part {
    radius: f64,
    bottom: f64,
    top: f64,
    mass: f64,
}
