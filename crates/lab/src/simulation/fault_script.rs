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
    from: From,
    #[serde(default)]
    inject: Vec<Injection>,
}

/// States in which a scenario begins, as `crates/faults` has them.
#[derive(PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum From {
    PowerUp,
    Gravity,
    Hold,
    Approach,
    Run,
    Lowering,
}

impl FaultScript {
    /// Reads `FILE` or `FILE:NUMBER`, for a device `is_in_process` or emulated.
    ///
    /// # Errors
    /// [`SimulationError::Faults`] with the line, if the file has no such scenario, one of its faults means nothing or
    /// the device cannot have it.
    pub(super) fn read(name: &str, is_in_process: bool) -> Result<Self, SimulationError> {
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
            let sense = injection.check().and_then(|()| match injection.what.is_of_the_port() && !is_in_process {
                true => Err("only `sil:` can have it: other devices have a bus controller of their own".to_owned()),
                false => Ok(()),
            });
            sense.map_err(|cause| failed(format!("fault {} of scenario {number}: {cause}", index + 1)))?;
        }
        Ok(Self { is_from_power_up: scenario.from == From::PowerUp, injections: scenario.inject })
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
            FaultScript::read(file.to_str().unwrap(), true).map(|_| ()).map_err(|error| error.to_string())
        };
        assert_eq!(read("at = 1, lasts = 0.1, every = 1, times = 3, what.restart.node = 7"), Ok(()));
        for (fault, words) in [
            (
                "at = 1, what.count-jump = { node = 11, by = 1 }",
                "fault 2 of scenario 1: node is 11; it must be from 1 to 7",
            ),
            ("at = 1, what.restart.node = 10", "node is 10; motors"),
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
            ("at = 1, lasts = 0, what = \"bus-off\"", "lasts is 0"),
            ("at = 1, times = 3, what = \"bus-off\"", "every is 0"),
            ("at = 1, every = 1, what = \"bus-off\"", "times is 1"),
            ("at = 1, what.drop.most = 0", "most is 0"),
            ("at = 1, what.temperature = { node = 1, celsius = 40000 }", "celsius is 40000"),
        ] {
            let refused = read(fault).unwrap_err();
            assert!(refused.contains(words), "{fault}: {refused}");
        }
    }

    /// A word that names no state was taken for one: the faults came with the first torque. And an emulated controller
    /// was asked for faults that only the one in this process has, which then did not come.
    ///
    /// The change that makes it fail: a state is any text, or every device takes every fault.
    #[test]
    fn h15_a_script_that_the_device_cannot_carry_out_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("script.toml");
        let read = |from: &str, fault: &str, is_in_process: bool| {
            let text =
                format!("[[scenario]]\nname = \"odd\"\nfrom = \"{from}\"\ninject = [{{ at = 1, what{fault} }}]\n");
            std::fs::write(&file, text).unwrap();
            FaultScript::read(file.to_str().unwrap(), is_in_process).map(|_| ()).map_err(|error| error.to_string())
        };
        assert!(read("powerup", " = \"bus-off\"", true).unwrap_err().contains("`powerup`"));
        for from in ["power-up", "gravity", "hold", "approach", "run", "lowering"] {
            assert_eq!(read(from, ".restart.node = 1", false), Ok(()), "{from}");
        }
        for fault in [" = \"bus-off\"", ".refuse = \"any\"", ".clock = 0.1"] {
            assert_eq!(read("run", fault, true), Ok(()), "{fault}");
            let refused = read("run", fault, false).unwrap_err();
            assert!(refused.contains("fault 1 of scenario 1: only `sil:` can have it"), "{refused}");
        }
    }
}
