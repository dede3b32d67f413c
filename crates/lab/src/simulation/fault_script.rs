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
        for (index, injection) in scenario.inject.iter().enumerate() {
            injection.check().map_err(|cause| failed(format!("fault {} of scenario {number}: {cause}", index + 1)))?;
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A finger's puck, node 11, was taken for the arm's last one, and a time that is no number for the beginning.
    ///
    /// The change that makes it fail: a script is used as it is read.
    #[test]
    fn a_fault_that_means_nothing_is_refused_with_its_place() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("script.toml");
        let read = |fault: &str| {
            let fine = "{ at = 0.5, what = \"bus-off\" }";
            let text = format!("[[scenario]]\nname = \"odd\"\nfrom = \"power-up\"\ninject = [{fine}, {{ {fault} }}]\n");
            std::fs::write(&file, text).unwrap();
            FaultScript::read(file.to_str().unwrap()).map(|_| ()).map_err(|error| error.to_string())
        };
        assert_eq!(read("at = 1, lasts = 0.1, every = 1, times = 3, what.restart.node = 7"), Ok(()));
        for (fault, words) in [
            ("at = 1, what.restart.node = 11", "fault 2 of scenario 1: node is 11; it must be from 1 to 7"),
            ("at = 1, what.temperature = { node = 0, celsius = 80 }", "node is 0"),
            ("at = nan, what = \"bus-off\"", "at is NaN"),
            ("at = -1, what = \"bus-off\"", "at is -1"),
            ("at = 1e300, what = \"bus-off\"", "at is 1"),
            ("at = 1, lasts = -1, what = \"bus-off\"", "lasts is -1"),
            ("at = 1, times = 0, what = \"bus-off\"", "times is 0"),
            ("at = 1, times = 4000000000, what = \"bus-off\"", "times is 4000000000"),
            ("at = 1, what.drop.share = 2", "share is 2"),
            ("at = 1, what.drop.from = [77]", "from is 77"),
            ("at = 1, what.flood = { rate = 0, bytes = 8 }", "rate is 0"),
            ("at = 1, what.flood = { rate = 100, bytes = 9 }", "bytes is 9"),
            ("at = 1, what.payload = nan", "payload is NaN"),
            ("at = 1, what.push.force = [0, inf, 0]", "force is inf"),
        ] {
            let refused = read(fault).unwrap_err();
            assert!(refused.contains(words), "{fault}: {refused}");
        }
    }
}
