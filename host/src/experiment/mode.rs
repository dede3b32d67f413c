//! The three ways in which a primitive is played, so that they can be compared.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::procedure;

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
}

impl Mode {
    /// All modes, in their order.
    pub const ALL: [Mode; 3] = [Mode::OpenLoop, Mode::ForceControl, Mode::Adaptive];

    /// Its letter in tables, files and options.
    pub fn letter(self) -> char {
        match self {
            Mode::OpenLoop => 'a',
            Mode::ForceControl => 'b',
            Mode::Adaptive => 'c',
        }
    }

    /// Its name in a legend.
    pub fn name(self) -> &'static str {
        match self {
            Mode::OpenLoop => "open loop",
            Mode::ForceControl => "force control",
            Mode::Adaptive => "force control and adaptation",
        }
    }

    /// The same as a mode of `tactus run`.
    pub fn of_run(self) -> procedure::Mode {
        match self {
            Mode::OpenLoop => procedure::Mode::Open,
            Mode::ForceControl => procedure::Mode::Force,
            Mode::Adaptive => procedure::Mode::Adapt,
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
            format!("there is no mode '{text}'; there are a (open loop), b (force control) and c (with adaptation)")
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
        assert!("d".parse::<Mode>().unwrap_err().contains("no mode 'd'"));
    }

    #[test]
    fn only_the_last_mode_bends_the_plan_and_only_the_first_ignores_forces() {
        let options = Mode::ALL.map(|mode| mode.of_run().options());
        assert_eq!(options.map(|options| options.feedback), [false, false, true]);
        assert_eq!(options.map(|options| options.force_control), [false, true, true]);
        // Nothing else may differ between the modes that are compared.
        for option in options {
            assert_eq!((option.pose_feedback, option.compliant), (options[0].pose_feedback, options[0].compliant));
        }
    }
}
