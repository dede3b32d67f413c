//! The file of an object: names, figures and appearance in TOML, checked where it is read.

use serde::Deserialize;

/// Names, figures and appearance of a kind of object. "Usual" figures can be changed per object.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObjectRow {
    /// Name in options and files.
    pub name: String,
    /// Name in the title of a figure.
    pub title: String,
    /// Line of the command's help.
    pub description: String,
    /// Usual place, world x and y, m.
    pub position: [f64; 2],
    /// Usual mass, kg.
    pub mass: f64,
    /// Usual radius where it is grasped, m.
    pub radius: f64,
    /// Length of its axis, m.
    pub height: f64,
    /// True if its axis is horizontal at the start.
    #[serde(default)]
    pub lies: bool,
    /// Usual coefficient of friction with the table.
    pub table_friction: f64,
    /// Usual coefficient of friction with fingers and palm.
    pub finger_friction: f64,
    /// Force of one finger that crushes it, N (mean over some 10 ms); `None` for what cannot be crushed.
    pub crush_force: Option<f64>,
    /// A thicker part at the foot.
    pub head: Option<Head>,
    /// Rings of material that are seen.
    pub rings: Vec<Ring>,
}

/// A thicker part at the foot of an object.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Head {
    /// Its radius over the grasped one.
    pub radius: f64,
    /// Its height, m.
    pub height: f64,
}

/// A ring of material that is seen.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ring {
    /// Radius as a share of the grasped one.
    pub radius: f64,
    /// Bottom, height over the foot, m.
    pub bottom: f64,
    /// Top, height over the foot, m.
    pub top: f64,
    /// Its material.
    pub material: Material,
}

/// A material of the arm's model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Material {
    /// White.
    Shell,
    /// Dark grey.
    Dark,
    /// Grey and shiny.
    Metal,
    /// Blue.
    Blue,
    /// Black and dull.
    Rubber,
    /// Yellow.
    Yellow,
    /// Nearly white and shiny.
    Glass,
}

impl Material {
    /// Its name in files and in the arm's model.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Shell => "shell",
            Self::Dark => "dark",
            Self::Metal => "metal",
            Self::Blue => "blue",
            Self::Rubber => "rubber",
            Self::Yellow => "yellow",
            Self::Glass => "glass",
        }
    }
}

/// Why a text is not the file of an object.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ObjectFileError {
    /// Not TOML, or a key is missing, unknown or of another type.
    #[error("{0}")]
    Syntax(Box<toml::de::Error>),
    /// Other characters, none or too many.
    #[error("the name '{0}' is not made of 1 to 32 small letters, digits and '-'")]
    Name(String),
    /// An object that is compiled in has this name.
    #[error("the name '{0}' is that of an object which is compiled in")]
    NameTaken(String),
    /// A figure that cannot be simulated.
    #[error("{what} is {value}; it must be from {from} to {to}")]
    OutOfRange {
        /// The key.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The smallest one.
        from: f64,
        /// The largest one.
        to: f64,
    },
    /// A ring that is not between foot and top, or upside down.
    #[error("ring {0} does not go upwards between the foot and the top")]
    Ring(usize),
}

/// A figure of an object; `None` where it has none of this kind.
type Figure = fn(&ObjectRow) -> Option<f64>;

/// Ranges of the figures: name, figure, smallest, largest.
const RANGES: [(&str, Figure, f64, f64); 10] = [
    ("position x", |row| Some(row.position[0]), -1.5, 1.5),
    ("position y", |row| Some(row.position[1]), -1.5, 1.5),
    ("mass", |row| Some(row.mass), 0.005, 20.0),
    ("radius", |row| Some(row.radius), 0.005, 0.15),
    ("height", |row| Some(row.height), 0.01, 1.0),
    ("table_friction", |row| Some(row.table_friction), 0.0, 3.0),
    ("finger_friction", |row| Some(row.finger_friction), 0.0, 3.0),
    ("crush_force", |row| row.crush_force, 0.1, 1000.0),
    ("head.radius", |row| row.head.map(|head| head.radius), 0.2, 5.0),
    // The part above the head has to have a length.
    ("head.height over the object's", |row| row.head.map(|head| head.height / row.height), 0.01, 0.99),
];

/// A ring may stand out of the top by so much, m: it would flicker with the face of another one.
const RING_ABOVE_TOP: f64 = 0.001;

/// The object of a file.
///
/// # Errors
/// The text is no object, or one that cannot be simulated.
pub(super) fn parse(text: &str) -> Result<ObjectRow, ObjectFileError> {
    let row: ObjectRow = toml::from_str(text).map_err(|error| ObjectFileError::Syntax(Box::new(error)))?;
    let plain = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'-';
    if !(1..=32).contains(&row.name.len()) || !row.name.bytes().all(plain) {
        return Err(ObjectFileError::Name(row.name));
    }
    for (what, value, from, to) in RANGES {
        if let Some(value) = value(&row).filter(|value| !(from..=to).contains(value)) {
            return Err(ObjectFileError::OutOfRange { what, value, from, to });
        }
    }
    for (index, ring) in row.rings.iter().enumerate() {
        let upwards = 0.0 <= ring.bottom && ring.bottom < ring.top && ring.top <= row.height + RING_ABOVE_TOP;
        if !upwards || !(0.05..=5.0).contains(&ring.radius) {
            return Err(ObjectFileError::Ring(index + 1));
        }
    }
    Ok(row)
}

#[cfg(test)]
mod tests {
    use super::{ObjectFileError, parse};

    const CUP: &str = include_str!("../../objects/cup.toml");

    #[test]
    fn a_file_that_is_wrong_is_refused_with_its_reason() {
        assert!(parse(CUP).is_ok());
        for (right, wrong, reason) in [
            ("mass = 0.2", "mass = 0.0", "mass is 0; it must be from 0.005 to 20"),
            ("mass = 0.2", "mass = nan", "mass is NaN; it must be from 0.005 to 20"),
            ("mass = 0.2", "", "missing field `mass`"),
            ("mass = 0.2", "mass = 0.2\nmas = 1", "unknown field `mas`"),
            ("mass = 0.2", "mass = 0.2\nhead = { radius = 1.2, height = 0.1 }", "head.height over the object's is 1;"),
            ("name = \"cup\"", "name = \"My cup\"", "the name 'My cup' is not made of"),
            ("bottom = 0.07", "bottom = 0.09", "ring 2 does not go upwards"),
            ("\"shell\"", "\"gold\"", "unknown variant `gold`"),
        ] {
            assert!(CUP.contains(right), "{right}");
            let error = parse(&CUP.replacen(right, wrong, 1)).unwrap_err().to_string();
            assert!(error.contains(reason), "{wrong}: {error}");
        }
    }

    #[test]
    fn an_object_of_a_file_cannot_take_the_name_of_a_compiled_one() {
        let own = |text: &str| super::super::ObjectKind::from_toml(text);
        assert_eq!(own(CUP), Err(ObjectFileError::NameTaken("cup".to_owned())));
        assert_eq!(own(&CUP.replacen("\"cup\"", "\"mug\"", 1)).unwrap().name(), "mug");
    }
}
