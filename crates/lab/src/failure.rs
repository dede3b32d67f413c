//! How a command fails: a code, what happened, where, and what the user can run next.

use std::error::Error;
use std::fmt::{self, Write as _};

use serde_json::json;

/// Exit codes of `tactus`; scripts rely on them, they are never renumbered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Exit {
    /// A defect of the tool itself.
    Internal = 1,
    /// The command line is wrong.
    Usage = 2,
    /// No such device, or no permission to use it.
    NoDevice = 3,
    /// Host and device, or tool and file, are of versions that do not fit.
    Incompatible = 4,
    /// The device refused or is faulted.
    Refused = 5,
    /// Something was checked and found wrong: limits, check sums, input files, fit.
    Invalid = 6,
    /// The link was lost or the device did not answer in time.
    LinkLost = 7,
    /// Interrupted by the user after a confirmed stop.
    Interrupted = 130,
}

/// A failed command.
#[derive(Debug)]
pub struct Failure {
    /// Exit code of the process.
    pub exit: Exit,
    /// Stable number of the reason, `E601` and so on; the hundreds are the exit code.
    pub code: &'static str,
    /// What was being done, `learn refused` for example.
    pub doing: String,
    /// Why it failed.
    pub cause: Box<dyn Error + Send + Sync>,
    /// A command or an action that helps.
    pub help: Option<String>,
    /// What was found out before it failed, for `--json`.
    pub data: Option<serde_json::Value>,
}

impl Failure {
    /// A failure with its reason.
    pub fn new(
        exit: Exit,
        code: &'static str,
        doing: impl Into<String>,
        cause: impl Into<Box<dyn Error + Send + Sync>>,
    ) -> Failure {
        Failure { exit, code, doing: doing.into(), cause: cause.into(), help: None, data: None }
    }

    /// The same with a hint.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Failure {
        self.help = Some(help.into());
        self
    }

    /// The same with what was found out: a script gets it under `result`.
    #[must_use]
    pub fn data(mut self, data: serde_json::Value) -> Failure {
        self.data = Some(data);
        self
    }

    /// The failure as one JSON object.
    pub fn to_json(&self) -> serde_json::Value {
        let mut object = json!({
            "error": {
                "exit": self.exit as u8,
                "code": self.code,
                "message": format!("{}: {}", self.doing, self.cause),
                "causes": self.causes(),
                "help": self.help,
            }
        });
        if let Some(data) = &self.data {
            object["result"] = data.clone();
        }
        object
    }

    fn causes(&self) -> Vec<String> {
        let mut causes = Vec::new();
        let mut said = self.cause.to_string();
        let mut source = self.cause.source();
        while let Some(cause) = source {
            let text = cause.to_string();
            // Some errors repeat their source in their own text: say it once.
            if !said.contains(&text) {
                causes.push(text.clone());
            }
            said = text;
            source = cause.source();
        }
        causes
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut text = format!("error[{}]: {}: {}", self.code, self.doing, self.cause);
        for cause in self.causes() {
            write!(text, "\n  because: {cause}")?;
        }
        if let Some(help) = &self.help {
            write!(text, "\n  help: {help}")?;
        }
        formatter.write_str(&text)
    }
}

impl Error for Failure {}
