//! Six joints and a gripper at 250 Hz: learned from three demonstrations, run in single precision, the goal changed on
//! the way, the gripper held back by its own coupling.

use std::error::Error;

use dmp::fit::{Demonstration, FitOptions, fit_several, minimum_jerk};
use dmp::{Coupling, Primitive, Rollout, StartState};

/// Six joint angles (rad) and the opening of the gripper (m).
const ROWS: usize = 7;
/// Control period, s.
const PERIOD: f64 = 1.0 / 250.0;

/// A demonstration of `samples` samples by somebody who ends `offset` rad beside the goal.
fn shown(samples: usize, offset: f64) -> Result<Demonstration<ROWS, 0>, Box<dyn Error>> {
    let start = [0.0, -1.2, 1.6, 0.0, 0.9, 0.0, 0.08];
    let goal = [0.8 + offset, -0.7, 1.1, 0.2, 0.6 - offset, -0.4, 0.02];
    Ok(Demonstration::new(PERIOD, [], minimum_jerk(start, goal, samples))?)
}

fn main() -> Result<(), Box<dyn Error>> {
    let demonstrations = [shown(700, -0.02)?, shown(750, 0.0)?, shown(800, 0.02)?];
    let learned = fit_several(&demonstrations, &FitOptions::default())?;
    println!("{:.2} s, spread of each row: {:.3?}", learned.duration, learned.report.spread);

    let primitive: Primitive<f32, ROWS, 0, 50> = learned.primitive()?;
    let mut rollout = Rollout::start(&primitive, &StartState::demonstrated(&primitive))?;
    let mut goal = primitive.goal().points;
    let mut plan = rollout.step(&primitive, PERIOD as f32, &Coupling::NONE)?;
    while plan.progress < 2.0 {
        if plan.progress > 0.5 {
            goal[0] = 1.0;
            rollout.set_goal_points(goal)?;
        }
        // The gripper meets something 1 cm before it is closed.
        let mut coupling = Coupling::NONE;
        coupling.points[6] = 0.01 * primitive.point_systems()[6].stiffness();
        plan = rollout.step(&primitive, PERIOD as f32, &coupling)?;
    }
    println!("at {:.2} s: {:.3?}", plan.time, plan.points.x);
    assert!((plan.points.x[0] - 1.0).abs() < 2e-3 && (plan.points.x[6] - 0.03).abs() < 1e-3);
    Ok(())
}
