//! Scripts of faults for a simulated device, `faults=FILE` or `faults=FILE:NUMBER`: the files of `tests/faults`.
//!
//! A file has scenarios (`docs/faults.md`); the number, 1 unless given, says which. Only its faults are read here:
//! orders, figures and bars are for `cargo xtask faults`. Times count from the first torque on the bus that is not
//! zero, in a scenario that begins at the power-up from there.

use std::path::Path;

use crate::input_file;

use serde::Deserialize;
use sim::Plant;
use sim::fault::Injection;

use super::SimulationError;

/// The file, and the number of the scenario in it.
pub(super) fn scenario(name: &str) -> (&Path, usize) {
    let numbered = name.rsplit_once(':').and_then(|(path, number)| Some((path, number.parse().ok()?)));
    let (path, number) = numbered.unwrap_or((name, 1));
    (Path::new(path), number)
}

/// Faults to put into a plant.
pub(super) struct FaultScript {
    injections: Vec<Injection>,
    is_from_power_up: bool,
}

#[derive(Deserialize)]
struct File {
    #[serde(default)]
    scenario: Vec<Scenario>,
}

#[derive(Deserialize)]
struct Scenario {
    from: String,
    #[serde(default)]
    inject: Vec<Injection>,
}

impl FaultScript {
    /// Reads `FILE` or `FILE:NUMBER`.
    ///
    /// # Errors
    /// [`SimulationError::Faults`] with the line, if the file has no such scenario or one of its faults means nothing.
    pub(super) fn read(name: &str) -> Result<Self, SimulationError> {
        let (path, number) = scenario(name);
        let failed = |cause: String| SimulationError::Faults(path.to_owned(), cause);
        let text = input_file::read_text(path).map_err(|cause| failed(cause.to_string()))?;
        let file: File = toml::from_str(&text).map_err(|cause| failed(input_file::parser_words(&cause)))?;
        let scenario = number.checked_sub(1).and_then(|index| file.scenario.into_iter().nth(index));
        let scenario = scenario.ok_or_else(|| failed(format!("there is no scenario {number}")))?;
        if scenario.inject.is_empty() {
            return Err(failed(format!(
                "scenario {number} has no faults: what befalls the arm there comes from the host"
            )));
        }
        Ok(Self { is_from_power_up: scenario.from == "power-up", injections: scenario.inject })
    }

    /// Orders the faults.
    pub(super) fn order(self, plant: &mut Plant) {
        if self.is_from_power_up {
            plant.inject(&self.injections);
        } else {
            plant.inject_on_torque(self.injections);
        }
    }
}
