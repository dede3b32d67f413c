//! `Key`: the name of one setting, with its unit, and `Setting`: its value.

use std::fmt;
use std::str::FromStr;

use serde::Serialize;
use thiserror::Error;

const AXES: [char; 3] = ['x', 'y', 'z'];

/// One setting that a device keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    /// `home.joint_N_rad`: angle of a joint when the arm is zeroed; 0 for J1.
    HomeJoint(u8),
    /// `home.stored`: the device keeps a home of its own arm.
    HomeStored,
    /// `weight.link_N_mass_share`: share of mass beyond the model's; 0 for link 1.
    LinkShare(u8),
    /// `weight.link_N_shift_A_m`: shift of the first moment by the link's mass (m), of a link and an axis from 0.
    LinkShift(u8, u8),
    /// `weight.stored`: the device keeps a weight of its own arm.
    WeightStored,
    /// `weight.with_hand`: that was measured with sensor and hand.
    WeightHand,
}

/// There is no setting of that name.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("there is no setting '{0}'")]
pub struct UnknownKey(pub String);

impl Key {
    /// Every setting, sorted by name.
    #[must_use]
    pub fn all() -> Vec<Self> {
        let homes = (0..7).map(Self::HomeJoint).chain([Self::HomeStored]);
        let links = (0..7).flat_map(|link| {
            [Self::LinkShare(link), Self::LinkShift(link, 0), Self::LinkShift(link, 1), Self::LinkShift(link, 2)]
        });
        homes.chain(links).chain([Self::WeightStored, Self::WeightHand]).collect()
    }

    /// It says whether anything is kept at all.
    #[must_use]
    pub fn is_stored(&self) -> bool {
        matches!(self, Self::HomeStored | Self::WeightStored)
    }

    /// The setting that says whether this one is kept.
    #[must_use]
    pub fn stored(&self) -> Self {
        match self {
            Self::HomeJoint(_) | Self::HomeStored => Self::HomeStored,
            _ => Self::WeightStored,
        }
    }

    /// The table of the file that it stands in, and its name there.
    #[must_use]
    pub fn place(&self) -> (&'static str, String) {
        let one = |index: &u8| index + 1;
        match self {
            Self::HomeJoint(joint) => ("home", format!("joint_{}_rad", one(joint))),
            Self::HomeStored => ("home", "stored".to_owned()),
            Self::LinkShare(link) => ("weight", format!("link_{}_mass_share", one(link))),
            Self::LinkShift(link, axis) => {
                let axis = AXES.get(usize::from(*axis)).copied().unwrap_or('?');
                ("weight", format!("link_{}_shift_{axis}_m", one(link)))
            }
            Self::WeightStored => ("weight", "stored".to_owned()),
            Self::WeightHand => ("weight", "with_hand".to_owned()),
        }
    }
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (table, name) = self.place();
        write!(f, "{table}.{name}")
    }
}

impl FromStr for Key {
    type Err = UnknownKey;

    fn from_str(text: &str) -> Result<Self, UnknownKey> {
        Self::all().into_iter().find(|key| key.to_string() == text).ok_or_else(|| UnknownKey(text.to_owned()))
    }
}

/// Value of a setting.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, schemars::JsonSchema)]
#[serde(untagged)]
pub enum Setting {
    /// Yes or no.
    Switch(bool),
    /// A number, in the unit of the key.
    Number(#[serde(serialize_with = "shortest")] f32),
}

/// The `f64` with the fewest digits that gives the same `f32` again: 0.1, not 0.10000000149011612.
fn shortest<S: serde::Serializer>(number: &f32, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_f64(format!("{number:?}").parse().unwrap_or_else(|_| f64::from(*number)))
}

impl Setting {
    /// The number; `None` if it is none.
    #[must_use]
    pub fn number(self) -> Option<f32> {
        match self {
            Self::Number(number) => Some(number),
            Self::Switch(_) => None,
        }
    }

    /// The switch; `None` if it is none.
    #[must_use]
    pub fn switch(self) -> Option<bool> {
        match self {
            Self::Switch(switch) => Some(switch),
            Self::Number(_) => None,
        }
    }
}

impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Switch(switch) => write!(f, "{switch}"),
            // The shortest digits that give the same 32 bits again.
            Self::Number(number) => write!(f, "{number:?}"),
        }
    }
}

impl FromStr for Setting {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text {
            "true" => Ok(Self::Switch(true)),
            "false" => Ok(Self::Switch(false)),
            _ => text.parse().map(Self::Number).map_err(|_| "neither a number nor true or false"),
        }
    }
}
