//! The kinds of objects that can stand or lie on the table: each is a file of names, figures and appearance.
//!
//! The usual ones are in `crates/sim/objects` and compiled in; a user's own is read by [`ObjectKind::from_toml`]. The
//! physical worlds, the command line, results and figures take all of them from here. The bodies of another shape than
//! upright or lying cylinders are made in `mujoco/object.rs`.

use std::fmt;
use std::str::FromStr;
use std::sync::LazyLock;

use super::object_file::{self, ObjectFileError, ObjectRow};

/// Kind of an object.
#[derive(Clone, Copy, Debug, PartialEq)]
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
    /// An object of a user's own file.
    Own(&'static ObjectRow),
}

/// Rows of the kinds that are compiled in, in the order of [`ObjectKind::ALL`]. A test parses them all: none can fail.
static ROWS: LazyLock<[ObjectRow; 6]> = LazyLock::new(|| {
    [
        include_str!("../../objects/small-torch.toml"),
        include_str!("../../objects/flashlight.toml"),
        include_str!("../../objects/cup.toml"),
        include_str!("../../objects/bottle.toml"),
        include_str!("../../objects/weight.toml"),
        include_str!("../../objects/paper-cup.toml"),
    ]
    .map(|text| object_file::parse(text).unwrap_or_else(|error| panic!("an object that is compiled in: {error}")))
});

impl ObjectKind {
    /// All kinds that are compiled in.
    pub const ALL: [Self; 6] =
        [Self::SmallTorch, Self::Flashlight, Self::Cup, Self::Bottle, Self::Weight, Self::PaperCup];

    /// The object of a user's file. Its row stays in memory until the program ends.
    ///
    /// # Errors
    /// The text is no object, or one that cannot be simulated.
    pub fn from_toml(text: &str) -> Result<Self, ObjectFileError> {
        let row = object_file::parse(text)?;
        if Self::ALL.iter().any(|kind| kind.name() == row.name) {
            return Err(ObjectFileError::NameTaken(row.name));
        }
        Ok(Self::Own(Box::leak(Box::new(row))))
    }

    /// Names, figures and appearance.
    #[must_use]
    pub fn row(self) -> &'static ObjectRow {
        match self {
            Self::SmallTorch => &ROWS[0],
            Self::Flashlight => &ROWS[1],
            Self::Cup => &ROWS[2],
            Self::Bottle => &ROWS[3],
            Self::Weight => &ROWS[4],
            Self::PaperCup => &ROWS[5],
            Self::Own(row) => row,
        }
    }

    /// Name in options and files.
    #[must_use]
    pub fn name(self) -> &'static str {
        &self.row().name
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
            let top = row.rings.iter().map(|ring| ring.top).fold(0.0, f64::max);
            assert!((top - row.height).abs() < 1e-3, "{kind}: looks {top} m high, is {} m", row.height);
            let widest = row.rings.iter().map(|ring| ring.radius).fold(0.0, f64::max);
            let wide = row.head.map_or(1.0, |head| head.radius);
            assert!((widest - wide).abs() < 0.03, "{kind}: looks {widest} times its radius wide, is {wide}");
        }
    }
}
