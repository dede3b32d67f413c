//! The ways in which a primitive is played, so that they can be compared: the paper's three, and one without the fingers' own adaptation.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use link::RunOptions;

use lab::procedure;

/// How the felt forces are used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Mode {
    /// Position control along the plan; forces are not used.
    #[serde(rename = "a")]
    OpenLoop,
    /// The force controller of Eq (12) follows the expected wrench; the plan stays as taught.
    #[serde(rename = "b")]
    ForceControl,
    /// Force control, and the difference between felt and expected wrench bends the plan (Eqs 8, 9).
    #[serde(rename = "c")]
    Adaptive,
    /// As the adaptive mode, but what the fingers feel does not bend their plan: tells what their own adaptation is good for.
    #[serde(rename = "d")]
    RigidFingers,
}

impl Mode {
    /// All modes, in their order.
    pub const ALL: [Mode; 4] = [Mode::OpenLoop, Mode::ForceControl, Mode::Adaptive, Mode::RigidFingers];

    /// Those that the paper compares.
    pub const PAPER: [Mode; 3] = [Mode::OpenLoop, Mode::ForceControl, Mode::Adaptive];

    /// Its letter in tables, files and options.
    pub fn letter(self) -> char {
        match self {
            Mode::OpenLoop => 'a',
            Mode::ForceControl => 'b',
            Mode::Adaptive => 'c',
            Mode::RigidFingers => 'd',
        }
    }

    /// Its name in a legend.
    pub fn name(self) -> &'static str {
        match self {
            Mode::OpenLoop => "open loop",
            Mode::ForceControl => "force control",
            Mode::Adaptive => "force control and adaptation",
            Mode::RigidFingers => "adaptation of the arm only",
        }
    }

    /// What the device is asked for: those of the modes of `tactus run`, with or without `--no-finger-feedback`.
    pub fn options(self) -> RunOptions {
        match self {
            Mode::OpenLoop => procedure::Mode::Open.options(),
            Mode::ForceControl => procedure::Mode::Force.options(),
            Mode::Adaptive => procedure::Mode::Adapt.options(),
            Mode::RigidFingers => RunOptions { finger_feedback: false, ..procedure::Mode::Adapt.options() },
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
        Mode::ALL.into_iter().find(|mode| text.trim() == mode.letter().to_string()).ok_or_else(|| {
            let known = Mode::ALL.map(|mode| format!("{mode} ({})", mode.name())).join(", ");
            format!("there is no mode '{text}'; there are {known}")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_mode_reads_as_it_is_written() {
        for mode in Mode::ALL {
            assert_eq!(mode.to_string().parse(), Ok(mode));
            assert_eq!(serde_json::to_string(&mode).unwrap(), format!("\"{mode}\""));
        }
        assert!("e".parse::<Mode>().unwrap_err().contains("no mode 'e'"));
    }

    #[test]
    fn modes_differ_in_what_they_are_named_for_and_in_nothing_else() {
        let options = Mode::ALL.map(Mode::options);
        assert_eq!(options.map(|options| options.feedback), [false, false, true, true]);
        assert_eq!(options.map(|options| options.force_control), [false, true, true, true]);
        let fingers = options.map(|options| options.feedback && options.finger_feedback);
        assert_eq!(fingers, [false, false, true, false]);
        // Nothing else may differ between the modes that are compared.
        for option in options {
            assert_eq!((option.pose_feedback, option.compliant), (options[0].pose_feedback, options[0].compliant));
        }
    }
}
