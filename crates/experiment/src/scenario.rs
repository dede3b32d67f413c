//! The experiments there are: what is grasped, how it is taught, and by what a trial is judged.

use std::fmt;

use serde::{Deserialize, Serialize};
use sim::teacher::TaughtMovement;
use sim::world::ObjectKind;

use super::grid::Grid;
use lab::procedure::Mode;

/// An experiment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, clap::ValueEnum, schemars::JsonSchema)]
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

    /// The movement taught for it.
    pub fn taught_movement(self) -> TaughtMovement {
        match self {
            Scenario::Flashlight => TaughtMovement::Flashlight,
            Scenario::Cup | Scenario::Fingers => TaughtMovement::Cup,
            Scenario::Bottle => TaughtMovement::Bottle,
            Scenario::Lift => TaughtMovement::Lift,
        }
    }

    /// The object unless another one is asked for.
    pub fn object(self) -> ObjectKind {
        match self {
            Scenario::Flashlight => ObjectKind::Flashlight,
            Scenario::Cup => ObjectKind::Cup,
            Scenario::Bottle => ObjectKind::Bottle,
            Scenario::Lift => ObjectKind::Weight,
            Scenario::Fingers => ObjectKind::PaperCup,
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

    /// True if the movement itself lifts the object.
    pub fn lifts_itself(self) -> bool {
        self == Scenario::Lift
    }
}

impl fmt::Display for Scenario {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

/// Difference between the plant and the controller's model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum PlantKind {
    /// An arm as it might stand in a laboratory: link masses off by up to 10 %, friction by 30 %, elastic cables, a
    /// force sensor with bias and hysteresis
    Perturbed,
    /// An arm that equals the controller's model: rigid cables, a force sensor with noise only
    Ideal,
}

impl PlantKind {
    /// Its name in options and files.
    pub fn name(self) -> &'static str {
        match self {
            PlantKind::Perturbed => "perturbed",
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
}
