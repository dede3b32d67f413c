//! Reachability of the objects, checked before an experiment starts.

use std::fmt;

use lab::arm::tool_pose;
use sim::world::mujoco::{MujocoOptions, MujocoWorld, ObjectKind, ObjectSpec, Scene, WorldError};

use super::config::{self, Config};
use super::grid::{ApproachFrame, Cell, Grid};
use super::inverse;
use super::scenario::Scenario;

/// Farthest that a grasp can be beside the grasp point and still hold, m: what the fingers span.
const SPAN: f64 = 0.06;
/// Farthest that a demonstration ends beside what the teacher wants to show, m, with room to spare.
const LEEWAY: f64 = 0.03;

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

/// Where a hand arrives.
struct Arrival {
    position: [f64; 3],
    orientation: [f64; 4],
    posture: [f64; 7],
}

/// The cells whose object cannot be tried, with the reason.
pub fn check(config: &Config, frame: &ApproachFrame) -> Vec<(Cell, Unreachable)> {
    let goal = config.primitive.goal;
    let arrival = Arrival { position: goal.position, orientation: goal.orientation, posture: goal.posture };
    let obstacle = |cell: Cell| obstacle(config.object_at(frame, cell), &arrival, cell.distance());
    config.grid.cells.iter().filter_map(|&cell| Some((cell, obstacle(cell)?))).collect()
}

/// The cells whose object cannot be tried however the movement is shown, with the reason: teaching takes minutes.
pub fn check_untaught(scenario: Scenario, object: ObjectKind, grid: &Grid) -> Vec<(Cell, Unreachable)> {
    let movement = scenario.taught_movement();
    let (posture, (start, _)) = (movement.goal(), tool_pose(&movement.start()));
    let (position, orientation) = tool_pose(&posture);
    let Some(frame) = config::frame(scenario, start, position, orientation) else { return Vec::new() };
    let arrival = Arrival { position, orientation, posture };
    let obstacle = |cell: Cell| {
        let distance = cell.distance();
        let share = if distance > LEEWAY { 1.0 - LEEWAY / distance } else { 0.0 };
        let [along, sideways] = [cell.along(), cell.sideways()].map(|way| way * share * 100.0);
        let nearer = Cell::centimetres(along, sideways);
        obstacle(ObjectSpec::new(object).at(frame.world(nearer)), &arrival, nearer.distance())
    };
    grid.cells.iter().filter_map(|&cell| Some((cell, obstacle(cell)?))).collect()
}

/// Why an object at this distance from the goal of the hand cannot be tried.
fn obstacle(object: ObjectSpec, goal: &Arrival, distance: f64) -> Option<Unreachable> {
    // The world itself knows best what it takes; making one costs a few milliseconds.
    match MujocoWorld::new(&MujocoOptions { scene: Scene::with(object), ..MujocoOptions::default() }) {
        Ok(_) => {}
        Err(WorldError::OffTable { .. }) => return Some(Unreachable::OffTable),
        Err(error) => return Some(Unreachable::Refused(error.to_string())),
    }
    let [x, y] = object.position;
    // The hand may stay short of the object by what the fingers span.
    let share = if distance > SPAN { 1.0 - SPAN / distance } else { 0.0 };
    let near = [
        goal.position[0] + share * (x - goal.position[0]),
        goal.position[1] + share * (y - goal.position[1]),
        goal.position[2],
    ];
    inverse::reach(near, goal.orientation, goal.posture).is_none().then_some(Unreachable::OutOfReach)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The change that makes it fail: a grid that nobody can reach is found once a primitive was taught for it.
    #[test]
    fn a_cell_far_from_the_table_is_known_before_anything_is_taught_and_the_usual_grids_are_not_refused() {
        for scenario in [Scenario::Flashlight, Scenario::Cup, Scenario::Bottle, Scenario::Lift, Scenario::Fingers] {
            let refused = |grid: &Grid| check_untaught(scenario, scenario.object(), grid);
            assert_eq!(refused(&scenario.grid()), [], "{scenario}");
            let [near, far] = [Cell::centimetres(0.0, 0.0), Cell::centimetres(99.0, 99.0)];
            assert_eq!(refused(&Grid { cells: vec![near, far] }), [(far, Unreachable::OffTable)], "{scenario}");
        }
    }
}
