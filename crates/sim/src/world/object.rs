//! The kinds of objects that can stand or lie on the table. Adding an upright or lying cylinder touches this file
//! only; the bodies of another shape are made in `mujoco/object.rs`.
//!
//! A kind is a variant of [`ObjectKind`], its place in [`ObjectKind::ALL`], and its row: names, figures and appearance.
//! The physical worlds, the command line, files and figures read all of them from here.

use std::fmt;
use std::str::FromStr;

/// Kind of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum ObjectKind {
    /// An upright torch.
    SmallTorch,
    /// An upright flashlight with a metal body, head down.
    Flashlight,
    /// A cup.
    Cup,
    /// A lying bottle.
    Bottle,
    /// A can whose weight is what matters.
    Weight,
    /// A cup of paper, the size of the cup, which a finger can crush.
    PaperCup,
}

/// Names, figures and appearance of a kind. "Usual" figures can be changed per object.
#[derive(Debug)]
pub struct ObjectRow {
    /// Name in options and files.
    pub name: &'static str,
    /// Name in the title of a figure.
    pub title: &'static str,
    /// Line of the command's help.
    pub description: &'static str,
    /// Usual place, world x and y, m.
    pub position: [f64; 2],
    /// Usual mass, kg.
    pub mass: f64,
    /// Usual radius where it is grasped, m.
    pub radius: f64,
    /// Length of its axis, m.
    pub height: f64,
    /// True if its axis is horizontal at the start.
    pub lies: bool,
    /// Usual coefficient of friction with the table.
    pub table_friction: f64,
    /// Usual coefficient of friction with fingers and palm.
    pub finger_friction: f64,
    /// Force of one finger that crushes it, N (mean over some 10 ms); `None` for what cannot be crushed.
    pub crush_force: Option<f64>,
    /// A thicker part at the foot: its radius over the grasped one, and its height, m.
    pub head: Option<(f64, f64)>,
    /// Rings of material that are seen: radius as a share of the grasped one, bottom and top as heights over the foot
    /// (m), name of the material in the arm's model.
    pub rings: &'static [(f64, f64, f64, &'static str)],
}

/// Figures that most objects share; a row names what differs.
const PLAIN: ObjectRow = ObjectRow {
    name: "",
    title: "",
    description: "",
    position: [0.75, 0.20],
    mass: 0.4,
    radius: 0.022,
    height: 0.1,
    lies: false,
    table_friction: 0.5,
    finger_friction: 0.8,
    crush_force: None,
    head: None,
    rings: &[],
};

const SMALL_TORCH: ObjectRow = ObjectRow {
    name: "small-torch",
    title: "Small torch",
    description: "An upright torch: 0.4 kg, radius 22 mm, 250 mm",
    position: [0.80, 0.0],
    height: 0.250,
    table_friction: 0.8,
    rings: &[
        (0.93, 0.0, 0.195, "yellow"),
        (0.99, 0.0, 0.013, "rubber"),
        (0.97, 0.05, 0.12, "rubber"),
        (1.01, 0.195, 0.25, "dark"),
        (1.02, 0.237, 0.243, "metal"),
        (0.84, 0.245, 0.2506, "glass"),
    ],
    ..PLAIN
};

const FLASHLIGHT: ObjectRow = ObjectRow {
    name: "flashlight",
    title: "Flashlight",
    description: "An upright flashlight of metal, head down: 0.86 kg, 313 mm",
    mass: 0.86,
    radius: 0.020,
    height: 0.313,
    table_friction: 0.4,
    head: Some((1.4, 0.070)),
    rings: &[
        (1.40, 0.0, 0.052, "blue"),
        (1.42, 0.004, 0.010, "metal"),
        (1.25, 0.052, 0.062, "blue"),
        (1.10, 0.062, 0.072, "metal"),
        (1.00, 0.072, 0.300, "blue"),
        (1.02, 0.110, 0.210, "dark"),
        (1.01, 0.225, 0.229, "metal"),
        (1.04, 0.300, 0.313, "dark"),
    ],
    ..PLAIN
};

const CUP: ObjectRow = ObjectRow {
    name: "cup",
    title: "Cup",
    description: "A cup: 0.2 kg, radius 40 mm, 100 mm",
    mass: 0.2,
    radius: 0.040,
    finger_friction: 0.5,
    rings: &[(1.0, 0.0, 0.1, "shell"), (1.005, 0.070, 0.080, "blue"), (0.92, 0.096, 0.1004, "dark")],
    ..PLAIN
};

const BOTTLE: ObjectRow = ObjectRow {
    name: "bottle",
    title: "Lying bottle",
    description: "A lying bottle: 0.5 kg, radius 32 mm, 220 mm",
    position: [0.62, 0.10],
    mass: 0.5,
    radius: 0.032,
    height: 0.220,
    lies: true,
    rings: &[
        (1.0, 0.0, 0.150, "glass"),
        (1.01, 0.040, 0.110, "blue"),
        (0.85, 0.150, 0.165, "glass"),
        (0.60, 0.165, 0.180, "glass"),
        (0.42, 0.180, 0.200, "glass"),
        (0.47, 0.200, 0.220, "yellow"),
    ],
    ..PLAIN
};

const WEIGHT: ObjectRow = ObjectRow {
    name: "weight",
    title: "Weight",
    description: "A can whose weight is the matter: 0.6 kg, radius 30 mm, 160 mm",
    mass: 0.6,
    radius: 0.030,
    height: 0.160,
    rings: &[(1.0, 0.0, 0.16, "metal"), (1.01, 0.012, 0.148, "yellow"), (0.9, 0.158, 0.1604, "dark")],
    ..PLAIN
};

const PAPER_CUP: ObjectRow = ObjectRow {
    name: "paper-cup",
    title: "Paper cup",
    description: "A cup of paper that a finger can crush: 0.05 kg",
    mass: 0.05,
    crush_force: Some(10.0),
    rings: &[(1.0, 0.0, 0.1, "shell"), (1.005, 0.030, 0.065, "yellow"), (0.92, 0.096, 0.1004, "dark")],
    ..CUP
};

impl ObjectKind {
    /// All kinds.
    pub const ALL: [Self; 6] =
        [Self::SmallTorch, Self::Flashlight, Self::Cup, Self::Bottle, Self::Weight, Self::PaperCup];

    /// Names, figures and appearance.
    #[must_use]
    pub const fn row(self) -> &'static ObjectRow {
        match self {
            Self::SmallTorch => &SMALL_TORCH,
            Self::Flashlight => &FLASHLIGHT,
            Self::Cup => &CUP,
            Self::Bottle => &BOTTLE,
            Self::Weight => &WEIGHT,
            Self::PaperCup => &PAPER_CUP,
        }
    }

    /// Name in options and files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.row().name
    }
}

impl fmt::Display for ObjectKind {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

/// A name that no kind of object has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is no object '{0}'")]
pub struct UnknownObject(pub String);

impl FromStr for ObjectKind {
    type Err = UnknownObject;

    fn from_str(name: &str) -> Result<Self, UnknownObject> {
        Self::ALL.into_iter().find(|kind| kind.name() == name).ok_or_else(|| UnknownObject(name.to_owned()))
    }
}

impl TryFrom<String> for ObjectKind {
    type Error = UnknownObject;

    fn try_from(name: String) -> Result<Self, UnknownObject> {
        name.parse()
    }
}

impl From<ObjectKind> for String {
    fn from(kind: ObjectKind) -> Self {
        kind.name().to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::ObjectKind;

    #[test]
    fn every_kind_is_found_by_its_name_alone() {
        for kind in ObjectKind::ALL {
            assert_eq!(kind.name().parse(), Ok(kind));
            assert_eq!(ObjectKind::ALL.iter().filter(|other| other.name() == kind.name()).count(), 1);
        }
        assert_eq!("teapot".parse::<ObjectKind>().unwrap_err().to_string(), "there is no object 'teapot'");
    }

    #[test]
    fn what_is_seen_of_an_object_is_what_collides() {
        for kind in ObjectKind::ALL {
            let row = kind.row();
            let top = row.rings.iter().map(|(_, _, top, _)| *top).fold(0.0, f64::max);
            assert!((top - row.height).abs() < 1e-3, "{kind}: looks {top} m high, is {} m", row.height);
            let widest = row.rings.iter().map(|(radius, ..)| *radius).fold(0.0, f64::max);
            let wide = row.head.map_or(1.0, |(ratio, _)| ratio);
            assert!((widest - wide).abs() < 0.03, "{kind}: looks {widest} times its radius wide, is {wide}");
            assert!(row.rings.iter().all(|(_, bottom, top, _)| bottom < top), "{kind}");
        }
    }
}
