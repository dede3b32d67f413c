//! The object on the table: what it is, how heavy and how slippery, and its bodies in MuJoCo's language.
//!
//! Friction between two geoms is the object's finger friction where the robot touches it, and its table friction where its
//! ground does, neither mixed with the other side's: the geoms carry MuJoCo's `priority` (object 1, ground 2, robot 0), and
//! the higher one decides alone.

use super::WorldError;
use std::f64::consts::FRAC_PI_2;
use std::fmt::Write as _;

/// Height of the table's top, world z, m.
pub const TABLE_TOP: f64 = -0.15;

/// Kind of an object; [`ObjectSpec::new`] knows its usual measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ObjectKind {
    /// An upright torch: 0.4 kg, radius 22 mm, 250 mm tall, friction 0.8.
    SmallTorch,
    /// An upright flashlight with a metal body, head down: 0.86 kg, 313 mm tall, head radius 28 mm, barrel radius 20 mm,
    /// friction 0.4 on the table.
    Flashlight,
    /// A cup: 0.2 kg, radius 40 mm, 100 mm tall, friction 0.5.
    Cup,
    /// A lying bottle: 0.5 kg, radius 32 mm, 220 mm long, friction 0.5 on the table.
    Bottle,
    /// A can whose weight is the matter: 0.6 kg unless told otherwise, radius 30 mm, 160 mm tall.
    Weight,
    /// A cup of paper: 0.05 kg, the size of the cup; a finger that presses with more than 10 N crushes it.
    PaperCup,
}

/// An object and where it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObjectSpec {
    /// What it is.
    pub kind: ObjectKind,
    /// Where it stands or lies (its middle), world x and y, m.
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

/// Radius of the flashlight's head over its barrel's.
const HEAD_RATIO: f64 = 1.4;

/// Height of the flashlight's head, m.
const HEAD_HEIGHT: f64 = 0.070;

impl ObjectSpec {
    /// An object with its usual measures at its usual place.
    #[must_use]
    pub fn new(kind: ObjectKind) -> Self {
        let plain = Self {
            kind,
            position: [0.75, 0.20],
            yaw: 0.0,
            mass: 0.4,
            radius: 0.022,
            table_friction: 0.8,
            finger_friction: 0.8,
            crush_force: None,
        };
        match kind {
            ObjectKind::SmallTorch => Self { position: [0.80, 0.0], ..plain },
            ObjectKind::Flashlight => Self { mass: 0.86, radius: 0.020, table_friction: 0.4, ..plain },
            ObjectKind::Cup => Self { mass: 0.2, radius: 0.040, table_friction: 0.5, finger_friction: 0.5, ..plain },
            ObjectKind::Bottle => {
                Self { position: [0.62, 0.10], mass: 0.5, radius: 0.032, table_friction: 0.5, ..plain }
            }
            ObjectKind::Weight => Self { mass: 0.6, radius: 0.030, table_friction: 0.5, ..plain },
            ObjectKind::PaperCup => Self {
                mass: 0.05,
                radius: 0.040,
                table_friction: 0.5,
                finger_friction: 0.5,
                crush_force: Some(10.0),
                ..plain
            },
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
        match self.kind {
            ObjectKind::SmallTorch => 0.250,
            ObjectKind::Flashlight => 0.313,
            ObjectKind::Cup | ObjectKind::PaperCup => 0.100,
            ObjectKind::Bottle => 0.220,
            ObjectKind::Weight => 0.160,
        }
    }

    /// Whether its axis is horizontal at the start.
    #[must_use]
    pub fn lies(&self) -> bool {
        self.kind == ObjectKind::Bottle
    }

    /// Radius of its foot, m: about its rim it topples.
    #[must_use]
    pub fn foot_radius(&self) -> f64 {
        if self.kind == ObjectKind::Flashlight { HEAD_RATIO * self.radius } else { self.radius }
    }

    /// Horizontal force at a height above the table that topples it, N: `m g r / h`. It slides instead where that exceeds
    /// friction, below the height `r / mu`.
    #[must_use]
    pub fn toppling_force(&self, height: f64) -> f64 {
        self.mass * 9.81 * self.foot_radius() / height
    }

    /// Generalized positions at the start: position, then quaternion (w, x, y, z). The body frame is in the middle of the axis, z along it.
    pub(super) fn start(&self) -> [f64; 7] {
        let [x, y] = self.position;
        let (lean, above) = if self.lies() { (FRAC_PI_2, self.radius) } else { (0.0, 0.5 * self.height()) };
        let ((sy, cy), (sl, cl)) = ((0.5 * self.yaw).sin_cos(), (0.5 * lean).sin_cos());
        // First the lean about y, then the yaw about z.
        [x, y, TABLE_TOP + above, cy * cl, -sy * sl, cy * sl, sy * cl]
    }

    /// Whatever passes here can be simulated.
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
        for look in self.looks() {
            let _ = writeln!(
                text,
                r#"      <geom class="look" type="cylinder" size="{}" fromto="0 0 {} 0 0 {}" material="{}"/>"#,
                look.radius, look.bottom, look.top, look.material
            );
        }
        text.push_str("    </body>\n");
        text
    }

    /// The cylinders that collide, evenly dense.
    fn parts(&self) -> Vec<Part> {
        let half = 0.5 * self.height();
        let mut parts = if self.kind == ObjectKind::Flashlight {
            let neck = HEAD_HEIGHT - half;
            vec![
                Part { radius: self.foot_radius(), bottom: -half, top: neck, mass: 0.0 },
                Part { radius: self.radius, bottom: neck, top: half, mass: 0.0 },
            ]
        } else {
            vec![Part { radius: self.radius, bottom: -half, top: half, mass: 0.0 }]
        };
        // The common factor pi drops out.
        let volume = |part: &Part| part.radius * part.radius * (part.top - part.bottom);
        let total: f64 = parts.iter().map(volume).sum();
        for part in &mut parts {
            part.mass = self.mass * volume(part) / total;
        }
        parts
    }

    /// What the eye sees: rings of material, bottom and top as heights over the foot, radius as a share of the grasped one.
    fn looks(&self) -> Vec<Look> {
        let (half, r) = (0.5 * self.height(), self.radius);
        let ring = |radius: f64, bottom: f64, top: f64, material: &'static str| Look {
            radius: radius * r,
            bottom: bottom - half,
            top: top - half,
            material,
        };
        match self.kind {
            ObjectKind::SmallTorch => vec![
                ring(0.93, 0.0, 0.195, "yellow"),
                ring(0.99, 0.0, 0.013, "rubber"),
                ring(0.97, 0.05, 0.12, "rubber"),
                ring(1.01, 0.195, 0.25, "dark"),
                ring(1.02, 0.237, 0.243, "metal"),
                ring(0.84, 0.245, 0.2506, "glass"),
            ],
            ObjectKind::Flashlight => vec![
                ring(1.40, 0.0, 0.052, "blue"),
                ring(1.42, 0.004, 0.010, "metal"),
                ring(1.25, 0.052, 0.062, "blue"),
                ring(1.10, 0.062, 0.072, "metal"),
                ring(1.00, 0.072, 0.300, "blue"),
                ring(1.02, 0.110, 0.210, "dark"),
                ring(1.01, 0.225, 0.229, "metal"),
                ring(1.04, 0.300, 0.313, "dark"),
            ],
            ObjectKind::Cup => {
                vec![ring(1.0, 0.0, 0.1, "shell"), ring(1.005, 0.070, 0.080, "blue"), ring(0.92, 0.096, 0.1004, "dark")]
            }
            ObjectKind::PaperCup => vec![
                ring(1.0, 0.0, 0.1, "shell"),
                ring(1.005, 0.030, 0.065, "yellow"),
                ring(0.92, 0.096, 0.1004, "dark"),
            ],
            ObjectKind::Bottle => vec![
                ring(1.0, 0.0, 0.150, "glass"),
                ring(1.01, 0.040, 0.110, "blue"),
                ring(0.85, 0.150, 0.165, "glass"),
                ring(0.60, 0.165, 0.180, "glass"),
                ring(0.42, 0.180, 0.200, "glass"),
                ring(0.47, 0.200, 0.220, "yellow"),
            ],
            ObjectKind::Weight => vec![
                ring(1.0, 0.0, 0.16, "metal"),
                ring(1.01, 0.012, 0.148, "yellow"),
                ring(0.9, 0.158, 0.1604, "dark"),
            ],
        }
    }
}

/// A cylinder of the object that collides.
struct Part {
    radius: f64,
    bottom: f64,
    top: f64,
    mass: f64,
}

/// A cylinder of the object that is looked at.
struct Look {
    radius: f64,
    bottom: f64,
    top: f64,
    material: &'static str,
}
