//! `Held`: a weight that the hand of a simulated arm holds fast, or that is screwed to it.

use std::fmt;
use std::str::FromStr;

use crate::chain::Vector;

/// Heaviest weight, kg: beyond it a WAM carries nothing.
const HEAVIEST: f64 = 4.0;

/// Farthest centre from the sensor along one axis, m.
const FARTHEST: f64 = 0.3;

/// The grasp point from the wrist sensor's origin, sensor axes, m.
const GRASP_POINT: Vector = [0.0, 0.0, 0.126];

/// A weight that keeps its place in the hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Held {
    mass: f64,
    centre: Vector,
}

/// The text is no weight that can be held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotHeld;

impl fmt::Display for NotHeld {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a held weight is KG or KG@X:Y:Z, at most {HEAVIEST} kg and {FARTHEST} m from the wrist sensor")
    }
}

impl std::error::Error for NotHeld {}

impl Held {
    /// A weight of `mass` (kg) with its centre here, from the wrist sensor's origin in sensor axes (m).
    ///
    /// # Errors
    /// [`NotHeld`] for numbers that no hand can hold.
    pub fn new(mass: f64, centre: [f64; 3]) -> Result<Self, NotHeld> {
        let is_near = centre.iter().all(|part| (-FARTHEST..=FARTHEST).contains(part));
        if (0.0..=HEAVIEST).contains(&mass) && is_near { Ok(Self { mass, centre }) } else { Err(NotHeld) }
    }

    /// Mass, kg.
    #[must_use]
    pub const fn mass(&self) -> f64 {
        self.mass
    }

    /// Centre from the wrist sensor's origin in sensor axes, m.
    #[must_use]
    pub const fn centre(&self) -> [f64; 3] {
        self.centre
    }
}

impl FromStr for Held {
    type Err = NotHeld;

    /// Reads `KG`, held at the grasp point, or `KG@X:Y:Z`.
    fn from_str(text: &str) -> Result<Self, NotHeld> {
        let number = |text: &str| text.parse::<f64>().map_err(|_| NotHeld);
        let Some((mass, centre)) = text.split_once('@') else { return Self::new(number(text)?, GRASP_POINT) };
        let parts = centre.split(':').map(number).collect::<Result<Vec<_>, _>>()?;
        Self::new(number(mass)?, parts.try_into().map_err(|_| NotHeld)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_held_weight_is_read_with_its_place_and_without() {
        assert_eq!("0.5".parse(), Held::new(0.5, GRASP_POINT));
        assert_eq!("0.5@0.01:-0.02:0.15".parse(), Held::new(0.5, [0.01, -0.02, 0.15]));
        for text in ["", "heavy", "-1", "5", "nan", "0.5@", "0.5@1:2", "0.5@0:0:0.4", "0.5@0:0:0:0"] {
            assert_eq!(text.parse::<Held>(), Err(NotHeld), "{text}");
        }
    }
}
