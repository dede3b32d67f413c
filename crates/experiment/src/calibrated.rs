//! Arms that were weighed before the experiment, each as `tactus calibrate gravity` does it, on its own plant: cables
//! and friction included. A trial's device then computes with the weight that was found.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};
use sim::HOME;
use sim::world::mujoco::Scene;

use super::config::Config;
use super::plant::{self, Arm};
use super::preparation::in_parallel;
use super::trial::{self, TrialError};
use control::Payload;
use control::model::{LinkWeight, WeightCorrection, WeightError};
use lab::client::Interrupt;
use lab::procedure;
use lab::table::Table;
use lab::weigh::{TOUR, WeighError, weigh};

/// Result of weighing one arm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Weighed {
    /// Residual of each joint over the postures held out, N m RMS, before.
    pub before_nm: [f64; 7],
    /// The same after.
    pub after_nm: [f64; 7],
    /// Why the device goes on with the model's weight, where the correction was not accepted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refused: Option<String>,
    /// Share of mass beyond the model's, and shift of the first moment (x, y, z; m), of each link.
    pub links: [[f32; 4]; 7],
}

/// The arms that were weighed, by their seeds.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Calibrated {
    /// The arms in words: weights of others are not taken for theirs.
    of: String,
    /// Arm by arm.
    pub arms: BTreeMap<u64, Weighed>,
}

/// Why an arm was not weighed.
#[derive(Debug, thiserror::Error)]
pub enum CalibrationError {
    /// The tour could not be carried through.
    #[error("arm {seed} was not weighed: {cause}")]
    Tour {
        /// The arm.
        seed: u64,
        /// Why.
        #[source]
        cause: TrialError,
    },
    /// The torques that were measured cannot be regressed.
    #[error("arm {seed} was not weighed: {cause}")]
    Regression {
        /// The arm.
        seed: u64,
        /// Why.
        #[source]
        cause: WeighError,
    },
    /// Figures are asked for, and what the arm weighs is not known any more.
    #[error("the weight of arm {seed}, with which its trials were played, is not there any more")]
    Lost {
        /// The arm.
        seed: u64,
    },
}

impl Weighed {
    /// The correction that the arm's device computes with.
    ///
    /// # Errors
    /// The numbers are those of no arm.
    pub fn correction(&self) -> Result<WeightCorrection, WeightError> {
        if self.refused.is_some() {
            return Ok(WeightCorrection::none(Payload::SensorAndHand));
        }
        let links = self.links.map(|[share, x, y, z]| LinkWeight { share, shift: [x, y, z] });
        WeightCorrection::new(Payload::SensorAndHand, links)
    }

    /// Largest residual of a joint, N m RMS: before and after.
    #[must_use]
    pub fn worst(&self) -> [f64; 2] {
        [self.before_nm, self.after_nm].map(|rms| rms.into_iter().fold(0.0, f64::max))
    }
}

impl Calibrated {
    /// The arms of `config` that were weighed before, from a file; none where it is missing or of other arms.
    #[must_use]
    pub fn read(file: &Path, config: &Config) -> Self {
        Self::of(file, arms(config))
    }

    /// Those of a file if they are these, in words.
    fn of(file: &Path, of: String) -> Self {
        let read = std::fs::read(file).ok().and_then(|bytes| serde_json::from_slice::<Self>(&bytes).ok());
        read.filter(|read| read.of == of).unwrap_or(Self { of, arms: BTreeMap::new() })
    }

    /// Weighs the arms of `config` that are missing, some at a time.
    ///
    /// # Errors
    /// [`CalibrationError`] of the first arm that was not weighed.
    pub fn complete(&mut self, config: &Config, interrupt: &Interrupt) -> Result<(), CalibrationError> {
        let missing: Vec<u64> = config.seeds.iter().copied().filter(|seed| !self.arms.contains_key(seed)).collect();
        let weighed = in_parallel(config.jobs, &missing, |seed| weigh_arm(config, *seed, interrupt));
        self.keep(missing.into_iter().zip(weighed))
    }

    /// Checks that the arms with these seeds were weighed: for figures none is.
    ///
    /// # Errors
    /// [`CalibrationError::Lost`]
    pub fn must_have(&self, seeds: &[u64]) -> Result<(), CalibrationError> {
        let lost = seeds.iter().copied().find(|seed| !self.arms.contains_key(seed));
        lost.map_or(Ok(()), |seed| Err(CalibrationError::Lost { seed }))
    }

    /// Keeps all that was found, behind an error too: each arm took its time. The first error is told.
    fn keep<Error>(&mut self, weighed: impl Iterator<Item = (u64, Result<Weighed, Error>)>) -> Result<(), Error> {
        let mut outcome = Ok(());
        for (seed, weighed) in weighed {
            match weighed {
                Ok(weighed) => {
                    self.arms.insert(seed, weighed);
                }
                Err(error) => outcome = outcome.and(Err(error)),
            }
        }
        outcome
    }

    /// The corrections by seed, for [`Config::weights`].
    ///
    /// # Errors
    /// Numbers of a file are those of no arm.
    pub fn weights(&self) -> Result<BTreeMap<u64, WeightCorrection>, WeightError> {
        self.arms.iter().map(|(seed, weighed)| Ok((*seed, weighed.correction()?))).collect()
    }

    /// Largest residual of a joint, arm by arm.
    #[must_use]
    pub fn table(&self) -> Table {
        let mut table = Table::new(["arm", "largest residual before, N m", "after, N m", ""]);
        for (seed, weighed) in &self.arms {
            let [before, after] = weighed.worst();
            let refused = weighed.refused.clone().unwrap_or_default();
            table.row([seed.to_string(), format!("{before:.3}"), format!("{after:.3}"), refused]);
        }
        table
    }
}

/// Everything that decides how the arms of an experiment weigh, in words.
fn arms(config: &Config) -> String {
    format!("{} 0x{:08x} {}", config.plant.name(), control::MODEL_HASH, config.variation)
}

/// Takes an arm through the tour of `tactus calibrate gravity`, from its home, on a bare table.
fn weigh_arm(config: &Config, seed: u64, interrupt: &Interrupt) -> Result<Weighed, CalibrationError> {
    let arm = Arm { engine: config.engine.clone(), kind: config.plant, variation: config.variation, seed };
    let options = plant::options(&arm, seed, HOME, Scene::EMPTY);
    let crossings = trial::connect(&options, interrupt).and_then(|mut client| {
        procedure::make_ready(&mut client, true, |_| {})?;
        Ok(procedure::cross_postures(&mut client, &TOUR, |_| {})?)
    });
    let crossings = crossings.map_err(|cause| CalibrationError::Tour { seed, cause })?;
    let none = WeightCorrection::none(Payload::SensorAndHand);
    let weighing = weigh(&none, Payload::SensorAndHand, &crossings.fitted, &crossings.held_out)
        .map_err(|cause| CalibrationError::Regression { seed, cause })?;
    let [before, after] = weighing.held_out;
    Ok(Weighed {
        before_nm: before.rms,
        after_nm: after.rms,
        refused: weighing.judge().err().map(|error| error.to_string()),
        links: weighing.correction.links().map(|LinkWeight { share, shift: [x, y, z] }| [share, x, y, z]),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn weighed(refused: Option<String>) -> Weighed {
        let links = [[0.02, 0.001, 0.0, -0.001]; 7];
        Weighed { before_nm: [0.1, 0.5, 0.1, 0.3, 0.0, 0.0, 0.0], after_nm: [0.01; 7], refused, links }
    }

    #[test]
    fn an_arm_whose_weighing_was_refused_goes_on_with_the_weight_of_the_model() {
        let none = WeightCorrection::none(Payload::SensorAndHand);
        assert_ne!(weighed(None).correction(), Ok(none));
        assert_eq!(weighed(Some("no better than before".to_owned())).correction(), Ok(none));
        assert_eq!(weighed(None).worst(), [0.5, 0.01]);
    }

    #[test]
    fn the_arms_behind_one_that_was_not_weighed_are_kept_and_the_first_error_is_told() {
        let mut calibrated = Calibrated::default();
        let found = [(1, Ok(weighed(None))), (2, Err("two")), (3, Ok(weighed(None))), (4, Err("four"))];
        assert_eq!(calibrated.keep(found.into_iter()), Err("two"));
        assert_eq!(calibrated.arms.keys().copied().collect::<Vec<_>>(), [1, 3]);
    }

    /// The change that makes it fail: arms of a file that is damaged count as none that are needed.
    #[test]
    fn figures_of_weighed_arms_need_their_weights() {
        let mut calibrated = Calibrated::default();
        assert!(matches!(calibrated.must_have(&[3]), Err(CalibrationError::Lost { seed: 3 })));
        calibrated.arms.insert(3, weighed(None));
        assert!(calibrated.must_have(&[3]).is_ok() && calibrated.must_have(&[3, 5]).is_err());
    }

    #[test]
    fn arms_that_were_weighed_are_read_back_and_those_of_another_experiment_are_not() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("calibrated.json");
        let arms = BTreeMap::from([(3, weighed(None))]);
        let kept = Calibrated { of: "perturbed 0x1 ".to_owned(), arms };
        std::fs::write(&file, serde_json::to_vec(&kept).unwrap()).unwrap();
        assert_eq!(Calibrated::of(&file, "perturbed 0x1 ".to_owned()), kept);
        let other = Calibrated::of(&file, "perturbed 0x1 joint-friction=0.3".to_owned());
        assert!(other.arms.is_empty() && other.of.ends_with("0.3"));
        assert!(Calibrated::of(&folder.path().join("missing"), "ideal".to_owned()).arms.is_empty());
    }
}
