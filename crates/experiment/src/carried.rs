//! Figures of the experiment with a weight. They need no physics, so that a tool without it can describe them.

use schemars::JsonSchema;
use serde::Serialize;

/// The result of one case in one mode.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Carried {
    /// The case.
    pub case: &'static str,
    /// Mass that is remembered, kg.
    pub remembered_kg: f64,
    /// Mass that is carried, kg.
    pub carried_kg: f64,
    /// The mode.
    pub mode: lab::procedure::Mode,
    /// Trials.
    pub trials: usize,
    /// Trials in which it was held.
    pub held: usize,
    /// Distance of the hand below or above its plan when it has lifted, m, over the last second of the run: median over
    /// the trials; `null` where every arm stopped before.
    pub sag_median_m: Option<f64>,
    /// The same, the worst trial.
    pub sag_max_m: Option<f64>,
    /// Distance of the free hand below or above its plan before it touches the weight, m: median over the trials;
    /// `null` where no hand was free for a second.
    pub free_sag_median_m: Option<f64>,
    /// The same, the worst trial.
    pub free_sag_max_m: Option<f64>,
}
