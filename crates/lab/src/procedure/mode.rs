//! The ways in which a primitive is played: stiff, the three that the paper compares, and one without the fingers'
//! own adaptation.

use std::fmt;
use std::str::FromStr;

use link::RunOptions;
use serde::{Deserialize, Serialize};

/// Use of the measured force in a run. In files and tables of experiments a mode is its letter.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Hash,
    Default,
    clap::ValueEnum,
    Serialize,
    Deserialize,
    schemars::JsonSchema,
)]
pub enum Mode {
    /// Position control with stiff gains; forces change nothing
    #[default]
    #[serde(rename = "t")]
    Track,
    /// (a) Open loop: compliant gains, forces change nothing
    #[serde(rename = "a")]
    #[value(name = "open")]
    OpenLoop,
    /// (b) Force control: compliant gains and the controller of Eq (12)
    #[serde(rename = "b")]
    #[value(name = "force")]
    ForceControl,
    /// (c) Force control, and the plan adapts to the measured force (Eq 8)
    #[serde(rename = "c")]
    #[value(name = "adapt")]
    Adaptive,
    /// As the adaptive mode, but the measured finger forces do not change the plan of the fingers
    #[serde(rename = "d")]
    #[value(skip)]
    RigidFingers,
}

impl Mode {
    /// The modes that experiments compare, in their order.
    pub const COMPARED: [Mode; 4] = [Mode::OpenLoop, Mode::ForceControl, Mode::Adaptive, Mode::RigidFingers];

    /// Those of the paper.
    pub const PAPER: [Mode; 3] = [Mode::OpenLoop, Mode::ForceControl, Mode::Adaptive];

    /// The switches of a run in this mode, at the taught speed and goal. All modes but `track` have the same gains,
    /// so that only the use of force differs between them.
    pub fn options(self) -> RunOptions {
        RunOptions {
            feedback: matches!(self, Mode::Adaptive | Mode::RigidFingers),
            force_control: self.needs_expectation(),
            finger_feedback: self != Mode::RigidFingers,
            compliant: self != Mode::Track,
            ..RunOptions::default()
        }
    }

    /// True if the mode compares forces with an expectation.
    pub fn needs_expectation(self) -> bool {
        matches!(self, Mode::ForceControl | Mode::Adaptive | Mode::RigidFingers)
    }

    /// The word for people and for the option `--mode`.
    pub fn name(self) -> &'static str {
        match self {
            Mode::Track => "track",
            Mode::OpenLoop => "open",
            Mode::ForceControl => "force",
            Mode::Adaptive => "adapt",
            Mode::RigidFingers => "adapt without fingers",
        }
    }

    /// The letter in files and tables of experiments.
    pub fn letter(self) -> char {
        match self {
            Mode::Track => 't',
            Mode::OpenLoop => 'a',
            Mode::ForceControl => 'b',
            Mode::Adaptive => 'c',
            Mode::RigidFingers => 'd',
        }
    }

    /// The words in a legend.
    pub fn title(self) -> &'static str {
        match self {
            Mode::Track => "stiff position control",
            Mode::OpenLoop => "open loop",
            Mode::ForceControl => "force control",
            Mode::Adaptive => "force control and adaptation",
            Mode::RigidFingers => "adaptation of the arm only",
        }
    }
}

impl fmt::Display for Mode {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}", self.letter())
    }
}

impl FromStr for Mode {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Mode::COMPARED.into_iter().find(|mode| text.trim() == mode.letter().to_string()).ok_or_else(|| {
            let known = Mode::COMPARED.map(|mode| format!("{mode} ({})", mode.title())).join(", ");
            format!("there is no mode '{text}'; there are {known}")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_mode_reads_as_it_is_written() {
        for mode in Mode::COMPARED {
            assert_eq!(mode.to_string().parse(), Ok(mode));
            assert_eq!(serde_json::to_string(&mode).unwrap(), format!("\"{mode}\""));
        }
        assert!("e".parse::<Mode>().unwrap_err().contains("no mode 'e'"));
    }

    #[test]
    fn modes_differ_in_what_they_are_named_for_and_in_nothing_else() {
        let options = Mode::COMPARED.map(Mode::options);
        assert_eq!(options.map(|options| options.feedback), [false, false, true, true]);
        assert_eq!(options.map(|options| options.force_control), [false, true, true, true]);
        let fingers = options.map(|options| options.feedback && options.finger_feedback);
        assert_eq!(fingers, [false, false, true, false]);
        // Nothing else may differ between the modes that are compared.
        for option in options {
            assert_eq!(option.compliant, options[0].compliant);
        }
    }
}
