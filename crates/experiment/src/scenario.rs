//! The experiments there are: what is grasped, how it is taught, and by what a trial is judged.

use std::fmt;
use std::str::FromStr;

use link::RunOptions;
use serde::{Deserialize, Serialize};
use sim::person::Lesson;

use super::grid::Grid;
use super::mode::Mode;

/// An experiment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Scenario {
    /// An upright flashlight, grasped from the side
    Flashlight,
    /// A cup, grasped from the side
    Cup,
    /// A lying bottle, grasped from above, with the table in the way
    Bottle,
    /// A weight that is grasped and lifted within the movement, expected or not
    Lift,
    /// A paper cup that stiff fingers crush
    Fingers,
}

impl Scenario {
    /// Its name in options and files.
    pub fn name(self) -> &'static str {
        match self {
            Scenario::Flashlight => "flashlight",
            Scenario::Cup => "cup",
            Scenario::Bottle => "bottle",
            Scenario::Lift => "lift",
            Scenario::Fingers => "fingers",
        }
    }

    /// What a person teaches for it.
    pub fn lesson(self) -> Lesson {
        match self {
            Scenario::Flashlight => Lesson::Flashlight,
            Scenario::Cup | Scenario::Fingers => Lesson::Cup,
            Scenario::Bottle => Lesson::Bottle,
            Scenario::Lift => Lesson::Lift,
        }
    }

    /// The object unless another one is asked for.
    pub fn object(self) -> Object {
        match self {
            Scenario::Flashlight => Object::Flashlight,
            Scenario::Cup => Object::Cup,
            Scenario::Bottle => Object::Bottle,
            Scenario::Lift => Object::Weight,
            Scenario::Fingers => Object::PaperCup,
        }
    }

    /// The cells unless others are asked for.
    pub fn grid(self) -> Grid {
        match self {
            Scenario::Flashlight => Grid::paper(),
            Scenario::Cup => Grid::spread(6, 4).unwrap_or_else(|_| Grid::paper()),
            // Ten places around the goal: what the fingers can reach around a bottle whose place is only roughly known.
            Scenario::Bottle => Grid::raster(&[-40, -20, 0, 20, 40], &[-20, 20]),
            Scenario::Lift => Grid::raster(&[0], &[0]),
            Scenario::Fingers => Grid::spread(4, 3).unwrap_or_else(|_| Grid::paper()),
        }
    }

    /// The modes unless others are asked for: the paper's three, or those between which the experiment decides.
    pub fn modes(self) -> Vec<Mode> {
        match self {
            Scenario::Flashlight | Scenario::Cup | Scenario::Bottle => Mode::PAPER.to_vec(),
            Scenario::Lift => vec![Mode::Adaptive],
            Scenario::Fingers => vec![Mode::Adaptive, Mode::RigidFingers],
        }
    }

    /// What the device is asked for in a mode. All modes of a scenario have the same gains.
    ///
    /// What stands is approached with compliant gains, so that a touch moves the arm before it topples the object. A hand above a table needs its
    /// height: with compliant gains it sags by its own friction as much as it shall give way, so there the gains are stiff.
    pub fn options(self, mode: Mode) -> RunOptions {
        RunOptions { compliant: self != Scenario::Bottle, ..mode.options() }
    }

    /// Whether the movement itself lifts the object.
    pub fn lifts_itself(self) -> bool {
        self == Scenario::Lift
    }
}

impl fmt::Display for Scenario {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

/// An object that can be grasped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Object {
    /// An upright flashlight of metal, head down: 0.86 kg, 313 mm
    Flashlight,
    /// An upright torch: 0.4 kg, radius 22 mm, 250 mm
    SmallTorch,
    /// A cup: 0.2 kg, radius 40 mm, 100 mm
    Cup,
    /// A lying bottle: 0.5 kg, radius 32 mm, 220 mm
    Bottle,
    /// A can whose weight is the matter: 0.6 kg, radius 30 mm, 160 mm
    Weight,
    /// A cup of paper that a finger can crush: 0.05 kg
    PaperCup,
}

impl Object {
    /// Its name in options and files.
    pub fn name(self) -> &'static str {
        match self {
            Object::Flashlight => "flashlight",
            Object::SmallTorch => "small-torch",
            Object::Cup => "cup",
            Object::Bottle => "bottle",
            Object::Weight => "weight",
            Object::PaperCup => "paper-cup",
        }
    }

    /// What it is called in a title.
    pub fn title(self) -> &'static str {
        match self {
            Object::Flashlight => "Flashlight",
            Object::SmallTorch => "Small torch",
            Object::Cup => "Cup",
            Object::Bottle => "Lying bottle",
            Object::Weight => "Weight",
            Object::PaperCup => "Paper cup",
        }
    }
}

impl FromStr for Object {
    type Err = String;

    fn from_str(text: &str) -> Result<Object, String> {
        <Object as clap::ValueEnum>::from_str(text, false)
    }
}

/// How well the controller's model fits the plant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum PlantKind {
    /// An arm as it might stand in a laboratory: link masses off by up to 10 %, friction by 30 %, elastic cables, a force sensor with bias and hysteresis
    Honest,
    /// An arm that equals the controller's model: rigid cables, a force sensor with noise only
    Ideal,
}

impl PlantKind {
    /// Its name in options and files.
    pub fn name(self) -> &'static str {
        match self {
            PlantKind::Honest => "honest",
            PlantKind::Ideal => "ideal",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_experiment_has_cells_around_its_goal() {
        for scenario in [Scenario::Flashlight, Scenario::Cup, Scenario::Bottle, Scenario::Lift, Scenario::Fingers] {
            let grid = scenario.grid();
            assert!(!grid.cells.is_empty() && grid.cells.iter().all(|cell| cell.distance() < 0.3), "{scenario}");
        }
        assert_eq!((Scenario::Flashlight.grid().cells.len(), Scenario::Bottle.grid().cells.len()), (48, 10));
    }

    #[test]
    fn names_are_those_of_the_command_line() {
        for object in
            [Object::Flashlight, Object::SmallTorch, Object::Cup, Object::Bottle, Object::Weight, Object::PaperCup]
        {
            assert_eq!(object.name().parse(), Ok(object));
        }
    }
}
