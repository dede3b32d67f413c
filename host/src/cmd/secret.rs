//! `tactus secret`: what a host must know before the device moves its arm or changes what it keeps.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use lab::{output_file, secret_file};
use link::{SecretReport, SecretState};
use schemars::JsonSchema;
use serde::Serialize;

use super::{Failure, Global, connection, files};
use lab::error::HostError;
use lab::quoted;

/// Options of `secret`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// The action.
    #[command(subcommand)]
    pub action: Action,
}

/// Actions on the secret of a device.
#[derive(Debug, Clone, Subcommand)]
pub enum Action {
    /// Draw a secret and write it into a new file; no device is asked
    New(FileOf),
    /// Have the device keep the secret of a file; a change of it needs `--secret-file` with the present one
    Set(FileOf),
    /// Have the device forget its secret; needs `--secret-file`
    Clear,
    /// Show whether the device keeps a secret, beside whoever commands it
    Status,
}

/// A file with a secret.
#[derive(Debug, Clone, Args)]
pub struct FileOf {
    /// The file: one line of 32 hexadecimal digits
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
}

/// Data of `tactus --json secret new`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Drawn {
    /// The file with the new secret.
    pub file: String,
}

/// Data of `tactus --json secret set`, `clear` and `status`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Shown {
    /// `none`, `kept`, `unreadable`, or `not offered` by a device without a place for it.
    pub secret: String,
    /// Wrong secrets that the device was given since it started.
    pub wrong_proofs: u32,
}

const DOING: &str = "secret";

/// Does what the command line asks for. No secret is ever shown.
///
/// # Errors
/// The file cannot be used, the device cannot be reached, or it refuses.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    let failed = |error: HostError| error.into_failure(DOING);
    match &command.action {
        Action::New(FileOf { file }) => {
            output_file::refuse_standard_output(file).map_err(|error| files::failure(error, DOING))?;
            secret_file::create(file).map_err(|error| connection::secret_failure(file, error, DOING))?;
            let data = Drawn { file: files::text(file) };
            let words = format!("{}: a new secret; keep a copy, a device that keeps it asks for it", data.file);
            global.output().result(&data, words)
        }
        Action::Set(FileOf { file }) => {
            let secret = connection::read_secret(file, global.output())
                .map_err(|error| connection::secret_failure(file, error, DOING))?;
            let mut client = connection::open_to_change_secret(global, DOING)?;
            client.keep_secret(&secret).map_err(failed)?;
            // It is kept: whatever becomes of the line now, who commands the device has to name this file.
            let word = quoted::path(file);
            global.output().say(format!("from now on: `--secret-file {word}`, or TACTUS_SECRET_FILE={word}"));
            global.tell_forgotten();
            client.unlock(&secret).map_err(failed)?;
            tell(&client.secret().map_err(failed)?, global)
        }
        Action::Clear => {
            let mut client = connection::open_to_change_secret(global, DOING)?;
            client.forget_secret().map_err(failed)?;
            let left = client.secret().inspect_err(|_| global.output().say("the device has forgotten the secret"));
            tell(&left.map_err(failed)?, global)
        }
        Action::Status => tell(&connection::observe(global, DOING)?.secret().map_err(failed)?, global),
    }
}

fn tell(report: &SecretReport, global: &Global) -> Result<(), Failure> {
    let words = match report.state {
        SecretState::Nothing => "none: whoever has its line may command the device",
        SecretState::Kept => "kept: who commands the device has to know it",
        SecretState::Unreadable => "unreadable: nothing moves until another one is set, or it is cleared",
        SecretState::NotOffered => "not offered: the device has no place to keep one",
    };
    let data = Shown { secret: report.state.name().to_owned(), wrong_proofs: report.wrong_proofs };
    global.output().result(&data, format!("secret: {words}\nwrong ones since start-up: {}", report.wrong_proofs))
}
