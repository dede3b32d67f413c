//! Variations of the usual plant and run: one factor at a time shows the robustness of a result.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// Factors and additions to the plant and the run of an experiment. The default changes nothing.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Variation {
    /// Factor on the object's mass.
    pub mass: f64,
    /// Factor on the friction between object and table.
    pub table_friction: f64,
    /// Factor on the friction between object and fingers.
    pub finger_friction: f64,
    /// Factor on the dry and viscous friction of the arm's joints.
    pub joint_friction: f64,
    /// Factor on the masses and inertias of the arm's links.
    pub link_mass: f64,
    /// Factor on the noise of the force/torque sensor.
    pub noise: f64,
    /// Whole control cycles of delay beyond the usual one.
    pub delay: u8,
    /// Error that the force sensor comes to within 2 s after the run has started and been tared, N; its direction is
    /// drawn from the seed. An error from before would be tared away. `None`: that of the plant; 0: none at all.
    pub bias: Option<f64>,
    /// Speed of the run, relative to the taught one; the primitive and what it expects are those of the taught speed.
    pub speed: f64,
}

impl Default for Variation {
    fn default() -> Self {
        Self {
            mass: 1.0,
            table_friction: 1.0,
            finger_friction: 1.0,
            joint_friction: 1.0,
            link_mass: 1.0,
            noise: 1.0,
            delay: 0,
            bias: None,
            speed: 1.0,
        }
    }
}

/// Names of the parts of a variation with what they may be.
const PARTS: [(&str, f64, f64); 9] = [
    ("mass", 0.1, 5.0),
    ("table-friction", 0.1, 3.0),
    ("finger-friction", 0.1, 3.0),
    ("joint-friction", 0.0, 3.0),
    ("link-mass", 0.5, 2.0),
    ("noise", 0.0, 20.0),
    ("delay", 0.0, 3.0),
    ("bias", 0.0, 2.0),
    ("speed", 0.1, 2.0),
];

impl Variation {
    /// The value of each part; not a number for one that is left to the plant.
    fn values(&self) -> [f64; 9] {
        [
            self.mass,
            self.table_friction,
            self.finger_friction,
            self.joint_friction,
            self.link_mass,
            self.noise,
            f64::from(self.delay),
            self.bias.unwrap_or(f64::NAN),
            self.speed,
        ]
    }

    /// Number of the part of this name.
    pub(crate) fn part(name: &str) -> Option<usize> {
        PARTS.iter().position(|(known, ..)| *known == name)
    }

    /// Replaces a part; the value is one that [`FromStr`] accepts for it.
    pub(crate) fn set(&mut self, part: usize, value: f64) {
        match part {
            0 => self.mass = value,
            1 => self.table_friction = value,
            2 => self.finger_friction = value,
            3 => self.joint_friction = value,
            4 => self.link_mass = value,
            5 => self.noise = value,
            6 => self.delay = value as u8,
            7 => self.bias = Some(value),
            _ => self.speed = value,
        }
    }
}

/// The parts that differ from the usual plant, `mass=1.3,delay=1`; nothing for no difference.
impl fmt::Display for Variation {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let usual = Variation::default().values();
        let parts =
            PARTS.iter().zip(self.values()).zip(usual).filter(|((_, value), usual)| !value.is_nan() && value != usual);
        for (index, (((name, ..), value), _)) in parts.enumerate() {
            write!(formatter, "{}{name}={value}", if index > 0 { "," } else { "" })?;
        }
        Ok(())
    }
}

impl FromStr for Variation {
    type Err = String;

    fn from_str(text: &str) -> Result<Variation, String> {
        let mut variation = Variation::default();
        let mut given = [false; PARTS.len()];
        for part in text.split(',').map(str::trim).filter(|part| !part.is_empty()) {
            let (name, value) = part.split_once('=').ok_or_else(|| format!("'{part}' lacks its value"))?;
            let Some(index) = Variation::part(name.trim()) else {
                let known: Vec<&str> = PARTS.iter().map(|(name, ..)| *name).collect();
                return Err(format!("'{name}' cannot be varied; there are {}", known.join(", ")));
            };
            if std::mem::replace(&mut given[index], true) {
                return Err(format!("{} is given twice; one of the two would be ignored", name.trim()));
            }
            let (_, low, high) = PARTS[index];
            match value.trim().parse::<f64>() {
                Ok(value) if (low..=high).contains(&value) => variation.set(index, value),
                _ => return Err(format!("{name} must be a number between {low} and {high}, not '{value}'")),
            }
            if name.trim() == "delay" && variation.values()[index].fract() != value.trim().parse().unwrap_or(0.0) % 1.0
            {
                return Err(format!("delay is a whole number of control cycles, not '{value}'"));
            }
        }
        Ok(variation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_variation_reads_as_it_is_written() {
        for text in [
            "",
            "mass=1.3",
            "table-friction=0.7,delay=1",
            "noise=3,bias=0.2",
            "bias=0",
            "joint-friction=1.3,link-mass=0.9",
            "speed=1.8",
        ] {
            assert_eq!(text.parse::<Variation>().unwrap().to_string(), text);
        }
    }

    #[test]
    fn wrong_variations_say_what_is_possible() {
        assert!("colour=2".parse::<Variation>().unwrap_err().contains("table-friction"));
        assert!("mass=-1".parse::<Variation>().unwrap_err().contains("between 0.1 and 5"));
        assert!("mass".parse::<Variation>().unwrap_err().contains("lacks its value"));
        assert!("delay=1.5".parse::<Variation>().unwrap_err().contains("whole number"));
        assert!("bias=NaN".parse::<Variation>().is_err());
        assert!("mass=1.1,noise=2,mass=1.2".parse::<Variation>().unwrap_err().contains("mass is given twice"));
        assert!(
            "speed=2.1".parse::<Variation>().unwrap_err().contains("between 0.1 and 2"),
            "more than a device takes"
        );
    }

    #[test]
    fn results_from_before_a_part_existed_are_read_with_its_usual_value() {
        let old = r#"{"mass":1.3,"table_friction":1.0,"finger_friction":1.0,"joint_friction":1.0,"link_mass":1.0,"noise":1.0,"delay":0}"#;
        assert_eq!(serde_json::from_str::<Variation>(old).unwrap(), "mass=1.3".parse().unwrap());
    }
}
