//! The failure of a command: a code, what happened, where, and what the user can run next.

use std::error::Error;
use std::fmt::{self, Write as _};
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::Serialize;

use crate::error_code::ErrorCode;
use crate::visible::visible;

/// A failed command.
#[derive(Debug)]
pub struct Failure {
    /// The numbered reason; it says the exit code of the process as well.
    pub code: ErrorCode,
    /// The action that failed, `learn refused` for example.
    pub doing: String,
    /// Why it failed.
    pub cause: Box<dyn Error + Send + Sync>,
    /// A command or an action that helps.
    pub help: Option<String>,
    /// File of the recording up to the failure.
    pub kept: Option<PathBuf>,
    /// Data found before the failure, for `--json`.
    pub data: Option<Box<serde_json::Value>>,
}

impl Failure {
    /// A failure with its reason; its help is what the code advises.
    pub fn new(code: ErrorCode, doing: impl Into<String>, cause: impl Into<Box<dyn Error + Send + Sync>>) -> Failure {
        let help = Some(code.remedy()).filter(|remedy| !remedy.is_empty()).map(str::to_owned);
        Failure { code, doing: doing.into(), cause: cause.into(), help, kept: None, data: None }
    }

    /// The failure of a file: with the number of the system's reason where `cause` comes from one, else `otherwise`.
    pub fn of_file(
        otherwise: ErrorCode,
        doing: impl Into<String>,
        cause: impl Into<Box<dyn Error + Send + Sync>>,
    ) -> Failure {
        let cause = cause.into();
        let mut link: Option<&(dyn Error + 'static)> = Some(&*cause);
        let mut code = otherwise;
        while let Some(error) = link {
            if let Some(found) = error.downcast_ref().and_then(ErrorCode::of_file) {
                code = found;
            }
            link = error.source();
        }
        Failure::new(code, doing, cause)
    }

    /// The same with a hint that knows more than the code.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Failure {
        self.help = Some(help.into());
        self
    }

    /// The same with the file of what was recorded before it. One that has gone meanwhile, with its folder, is not
    /// named.
    #[must_use]
    pub fn kept(mut self, file: impl Into<PathBuf>) -> Failure {
        self.kept = Some(file.into()).filter(|file| file.exists());
        self
    }

    /// The same with what was found out: a script gets it under `result`.
    #[must_use]
    pub fn data(mut self, data: serde_json::Value) -> Failure {
        self.data = Some(Box::new(data));
        self
    }

    /// The failure as one JSON object.
    pub fn to_json(&self) -> serde_json::Value {
        let error = ErrorData {
            exit: self.code.exit() as u8,
            code: self.code.to_string(),
            message: format!("{}: {}", self.doing, self.cause),
            causes: self.causes(),
            help: self.help.clone(),
            kept: self.kept.as_ref().map(|kept| kept.display().to_string()),
        };
        let data = FailureData { error, result: self.data.as_deref().cloned() };
        // Texts, numbers and what is JSON already.
        serde_json::to_value(data).unwrap_or_default()
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
        if let Some(kept) = &self.kept {
            write!(text, "\n  kept: what was recorded until then is in {}", kept.display())?;
        }
        if let Some(help) = &self.help {
            write!(text, "\n  help: {help}")?;
        }
        formatter.write_str(&visible(&text))
    }
}

impl Error for Failure {}

/// A failure as `--json` shows it.
#[derive(Debug, Serialize, JsonSchema)]
pub struct FailureData {
    /// The failure.
    pub error: ErrorData,
    /// Findings of a command that failed with a result: the same object as after a success, or the part that is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub result: Option<serde_json::Value>,
}

/// Why a command failed.
#[derive(Debug, Serialize, JsonSchema)]
pub struct ErrorData {
    /// Exit code of the process.
    pub exit: u8,
    /// Code of the error, such as `E504`; `tactus explain` tells more.
    pub code: String,
    /// The action and the cause.
    pub message: String,
    /// Causes of the cause, the nearest first.
    pub causes: Vec<String>,
    /// The remedy.
    pub help: Option<String>,
    /// The file that holds what was recorded until then.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kept: Option<String>,
}
