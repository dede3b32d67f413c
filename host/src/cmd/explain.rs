//! `tactus explain`: what an error or a fault means, without a device.

use clap::Args;
use control::Fault;
use lab::fault_guide::FaultGuide;
use link::Refusal;
use schemars::JsonSchema;
use serde::Serialize;

use super::{ErrorCode, Failure, Global};

/// Options of `explain`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// The code of an error, `E504` or 504, or the name of a fault, for example `ContactForce`, or its number, as in
    /// recordings
    #[arg(value_name = "CODE")]
    pub code: String,
}

/// Explains a code.
///
/// # Errors
/// There is no such code.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    let text = command.code.as_str();
    let mut faults = Fault::ALL.into_iter().filter(|fault| *fault != Fault::None);
    let fault = faults.find(|fault| {
        format!("{fault:?}").eq_ignore_ascii_case(text) || text.parse().is_ok_and(|number: u8| number == fault.code())
    });
    let (code, meaning, reaction, cause, check, remedy) = match (error(text), fault) {
        (Some(code), _) => (code.to_string(), code.meaning(), "", code.cause(), "", code.remedy()),
        (None, Some(fault)) => {
            let FaultGuide { reaction, cause, check, clear } = FaultGuide::of(fault);
            (format!("{fault:?}"), fault.explanation(), reaction, cause, check, clear)
        }
        (None, None) => {
            let cause = format!("'{text}' is neither the code of an error nor the name or number of a fault");
            return Err(Failure::new(ErrorCode::UnknownCode, "explain", cause));
        }
    };
    let exit = error(text).map(|code| code.exit() as u8);
    let mut words = format!("{code}: {meaning}");
    for (name, text) in [("the arm", reaction), ("usual cause", cause), ("check", check), ("help", remedy)] {
        if !text.is_empty() {
            words += &format!("\n  {name}: {text}");
        }
    }
    let text = str::to_owned;
    let (meaning, cause, check, help) = (text(meaning), text(cause), text(check), text(remedy));
    let data = Explained { code, meaning, cause, check, help, exit };
    global.output().result(&data, words)
}

/// Data of `tactus --json explain`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Explained {
    /// Code of the error or fault.
    pub code: String,
    /// Its meaning.
    pub meaning: String,
    /// The usual cause; empty where the meaning says it.
    pub cause: String,
    /// The places to look at first, of a fault of the device; empty otherwise.
    pub check: String,
    /// The remedy; empty where nothing helps in general.
    pub help: String,
    /// Exit code of a command that fails so; null for a fault of the device.
    pub exit: Option<u8>,
}

/// The error with this number, with or without the letter.
fn error(text: &str) -> Option<ErrorCode> {
    let number: u16 = text.strip_prefix(['E', 'e']).unwrap_or(text).parse().ok()?;
    let refusals = Refusal::ALL.map(ErrorCode::Refused);
    ErrorCode::ALL.iter().chain(&refusals).copied().find(|code| code.number() == number)
}
