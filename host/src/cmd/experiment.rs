//! `tactus experiment`: the same movement on objects that are not where it expects them.

#[cfg(any(feature = "mujoco", test))]
mod device;
#[cfg(feature = "mujoco")]
mod failures;
#[cfg(any(feature = "mujoco", test))]
mod refusal;
#[cfg(feature = "mujoco")]
mod setup;
#[cfg(feature = "mujoco")]
mod work;

use std::ops::RangeInclusive;
use std::path::PathBuf;

use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;

use super::{ErrorCode, Failure, Global, experiment_values as values};
use experiment::sweep::Point;
use experiment::{Comparison, Grid, Mode, PlantKind, Scenario, Summary, Sweep, Variation};

/// Options of `experiment`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// Which experiment
    #[arg(value_enum)]
    pub scenario: Scenario,
    /// Where the object stands: `paper` (8 x 6 cells, 4 cm apart), a part of it such as `4x3`, or cells
    /// ALONG:SIDEWAYS in cm such as `-24:8,0:0`
    #[arg(long, visible_alias = "cells", allow_hyphen_values = true)]
    pub grid: Option<Grid>,
    /// Rotate the grid about its middle, degrees
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, value_parser = values::degrees, allow_hyphen_values = true)]
    pub rotate: f64,
    /// Shift the grid along the approach and sideways, cm
    #[arg(long, value_name = "ALONG,SIDEWAYS", value_parser = values::shift, default_value = "0,0", allow_hyphen_values = true)]
    pub shift: [f64; 2],
    /// Modes: a open loop, b force control, c force control and adaptation, d as c but the fingers do not adapt
    /// [default: a,b,c; lift c; fingers c,d]
    #[arg(long, value_delimiter = ',', value_parser = str::parse::<Mode>)]
    pub modes: Vec<Mode>,
    /// Try every cell with the seeds 1 to N, or FROM to TO; a seed is an arm
    #[arg(long, value_name = "N|FROM:TO", value_parser = values::numbers, conflicts_with = "seed")]
    pub seeds: Option<RangeInclusive<u64>>,
    /// Try every cell with this seed only
    #[arg(long)]
    pub seed: Option<u64>,
    /// Teach N times, each time by another person, and try every demonstration on every arm; FROM:TO names the persons
    #[arg(long, value_name = "N|FROM:TO", value_parser = values::numbers, conflicts_with = "primitive")]
    pub demonstrations: Option<RangeInclusive<u64>>,
    /// Repeat with a factor of `--vary` over a range, until less than half is held: `joint-friction=1:0`,
    /// `bias=0:2:4` (steps)
    #[arg(long, value_name = "NAME=FROM:TO[:STEPS]")]
    pub sweep: Option<Sweep>,
    /// The primitive, TOML; without it one is taught, learned and rehearsed first
    #[arg(long, value_name = "FILE")]
    pub primitive: Option<PathBuf>,
    /// Learn the movement this many times as fast as it is shown; the fingers keep their time
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = values::faster, conflicts_with = "primitive")]
    pub learn_speed: f64,
    /// Difference between the simulated arm and the controller's model [default: perturbed]
    #[arg(long, value_enum)]
    pub plant: Option<PlantKind>,
    /// Factors that differ from that arm: mass, table-friction, finger-friction, joint-friction, link-mass, noise
    /// (factors), delay (cycles), bias (N, comes up after the run's tare), speed (of the run, of the taught one)
    #[arg(long, value_name = "NAME=VALUE,...", default_value = "")]
    pub vary: Variation,
    /// Weigh every arm first, as `calibrate gravity` does, and give its device the result; what was found is kept in
    /// the folder
    #[arg(long, conflicts_with_all = ["demonstrations", "sweep"])]
    pub calibrated: bool,
    /// Object on the table instead of the usual one: small-torch, flashlight, cup, bottle, weight, paper-cup, or a file
    /// of your own such as `mug.toml`
    #[arg(long, value_name = "NAME|FILE")]
    pub object: Option<PathBuf>,
    /// Simulations at a time [default: one for each processor]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=512))]
    pub jobs: Option<u16>,
    /// Folder of the results [default: the experiment's name]
    #[arg(long, short, value_name = "FOLDER")]
    pub out: Option<PathBuf>,
    /// Go on with the results in the folder
    #[arg(long)]
    pub resume: bool,
    /// Make figures and tables of the results in the folder, without trials: of their grid and configuration, and of
    /// all modes and seeds that are there unless some are named
    #[arg(long, conflicts_with = "resume")]
    pub figures_only: bool,
    /// Render frames of one trial in each mode
    #[arg(long)]
    pub render: bool,
    /// Write the telemetry of every trial into the folder `recordings`
    #[arg(long)]
    pub keep_recordings: bool,
}

/// Data of `tactus --json experiment`, of one experiment.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Tried {
    /// Which experiment.
    pub experiment: Scenario,
    /// The folder of its results.
    pub folder: String,
    /// Statistics of each mode.
    pub modes: Vec<Summary>,
    /// Open loop against adaptation; `null` where there is nothing to compare.
    pub comparison: Option<Comparison>,
}

/// Data of `tactus --json experiment lift`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Lifted {
    /// Which experiment.
    pub experiment: Scenario,
    /// The folder of its results.
    pub folder: String,
    /// Figures of each case in each mode.
    pub cases: Vec<experiment::carried::Carried>,
}

/// Data of `tactus --json experiment` with `--demonstrations` or `--sweep`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Studied {
    /// Which experiment.
    pub experiment: Scenario,
    /// The folder of its results.
    pub folder: String,
    /// Demonstrations of each point.
    pub demonstrations: usize,
    /// Name of the factor that is swept; `null` without a sweep.
    pub sweep: Option<String>,
    /// Cells that were held, value by value.
    pub points: Vec<Point>,
}

/// Carries an experiment through.
///
/// # Errors
/// An object cannot be reached, results of another configuration are there, or a trial could not be carried through.
#[cfg(feature = "mujoco")]
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    work::run(command, global)
}

/// Says what is missing.
///
/// # Errors
/// Always: experiments need the MuJoCo world.
#[cfg(not(feature = "mujoco"))]
pub fn run(_command: &Cmd, _global: &Global) -> Result<(), Failure> {
    Err(Failure::new(ErrorCode::WithoutMujoco, "experiment", lab::simulation::SimulationError::WithoutMujoco)
        .help("`cargo xtask build`"))
}
