//! Experiments: the same movement tried on objects that are not where it expects them, in several modes, over a grid
//! and over seeds.
//!
//! ```text
//! Config --keys--> trial::run (own simulation, own noise) --> Report --> results.jsonl
//!                  | one thread each                                      |
//!                  '- Trace, Observation, Snapshot (first seed)           '-> Results -> Summary, map, figures
//! ```

#[cfg(feature = "mujoco")]
pub mod calibrated;
pub mod carried;
pub mod comparison;
#[cfg(feature = "mujoco")]
pub mod config;
pub mod figures;
#[cfg(test)]
pub mod fixtures;
pub mod grid;
pub mod header;
pub mod interval;
pub mod inverse;
#[cfg(feature = "mujoco")]
pub mod lift;
pub mod log;
pub mod map;
pub mod observation;
#[cfg(feature = "mujoco")]
pub mod observed;
pub mod outcome;
#[cfg(feature = "mujoco")]
pub mod plant;
#[cfg(feature = "mujoco")]
pub mod preparation;
mod quantile;
#[cfg(feature = "mujoco")]
pub mod reach;
pub mod results;
#[cfg(feature = "mujoco")]
mod runner;
pub mod scenario;
pub mod seed;
pub mod shaking;
pub mod statistics;
pub mod sweep;
pub mod trace;
#[cfg(feature = "mujoco")]
pub mod trial;
pub mod variation;
mod whole;

pub use comparison::Comparison;
#[cfg(feature = "mujoco")]
pub use config::Config;
pub use grid::{Cell, Grid};
pub use lab::procedure::Mode;
pub use outcome::Outcome;
pub use results::Results;
#[cfg(feature = "mujoco")]
pub use runner::{Experiment, ExperimentError, Progress, check, run, there};
pub use scenario::{PlantKind, Scenario};
pub use statistics::Summary;
pub use sweep::Sweep;
pub use variation::Variation;
