//! Reachability of the objects, checked before an experiment starts.

use std::fmt;

use sim::world::mujoco::{MujocoOptions, MujocoWorld, Scene, WorldError};

use super::config::Config;
use super::grid::{ApproachFrame, Cell};
use super::inverse;

/// Farthest that a grasp can be beside the grasp point and still hold, m: what the fingers span.
const SPAN: f64 = 0.06;

/// Why an object cannot be tried.
#[derive(Debug, Clone, PartialEq)]
pub enum Unreachable {
    /// It would stand beside the table.
    OffTable,
    /// The arm does not reach so far with the hand as it is taught.
    OutOfReach,
    /// The world does not take it.
    Refused(String),
}

impl fmt::Display for Unreachable {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Unreachable::OffTable => formatter.write_str("not on the table"),
            Unreachable::OutOfReach => formatter.write_str("out of reach"),
            Unreachable::Refused(reason) => formatter.write_str(reason),
        }
    }
}

/// The cells whose object cannot be tried, with the reason.
pub fn check(config: &Config, frame: &ApproachFrame) -> Vec<(Cell, Unreachable)> {
    let obstacles = config.grid.cells.iter().map(|&cell| (cell, obstacle(config, frame, cell)));
    obstacles.filter_map(|(cell, obstacle)| obstacle.map(|obstacle| (cell, obstacle))).collect()
}

fn obstacle(config: &Config, frame: &ApproachFrame, cell: Cell) -> Option<Unreachable> {
    let object = config.object_at(frame, cell);
    // The world itself knows best what it takes; making one costs a few milliseconds.
    match MujocoWorld::new(&MujocoOptions { scene: Scene::with(object), ..MujocoOptions::default() }) {
        Ok(_) => {}
        Err(WorldError::OffTable { .. }) => return Some(Unreachable::OffTable),
        Err(error) => return Some(Unreachable::Refused(error.to_string())),
    }
    let goal = config.primitive.goal;
    let [x, y] = object.position;
    // The hand may stay short of the object by what the fingers span.
    let distance = cell.distance();
    let share = if distance > SPAN { 1.0 - SPAN / distance } else { 0.0 };
    let near = [
        goal.position[0] + share * (x - goal.position[0]),
        goal.position[1] + share * (y - goal.position[1]),
        goal.position[2],
    ];
    inverse::reach(near, goal.orientation, goal.posture).is_none().then_some(Unreachable::OutOfReach)
}
