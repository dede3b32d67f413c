//! `tactus config`: the tool's settings that count, and where each comes from; its actions are on the device's.

use clap::Args;
use lab::table::Table;
use schemars::JsonSchema;
use serde::Serialize;

use super::{Failure, Global, files};
use crate::config::Origin;

/// Options of `config`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// Action on the settings of the device; the tool's own are shown without one.
    #[command(subcommand)]
    pub action: Option<super::settings::Action>,
}

/// A setting.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Setting {
    /// Its value as it would stand on the command line; `null`: there is none.
    pub value: Option<String>,
    /// Where it comes from.
    pub origin: Origin,
}

/// Every setting.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Settings {
    /// `--device`.
    pub device: Setting,
    /// `--timeout`, s.
    pub timeout: Setting,
    /// `--secret-file`.
    pub secret_file: Setting,
}

/// The settings, and the file for them.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Configured {
    /// The configuration file; `null` without a home.
    pub file: Option<String>,
    /// The file exists.
    pub exists: bool,
    /// Why the file cannot be used; `null`: it can. Nothing of it counts otherwise.
    pub problem: Option<String>,
    /// Those that count.
    pub settings: Settings,
}

/// Shows them, or does what the action says.
///
/// # Errors
/// Standard output was closed, or the action failed.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    if let Some(action) = &command.action {
        return super::settings::run(action, global);
    }
    let origins = &global.origins;
    let settings = Settings {
        device: Setting { value: global.device.clone(), origin: origins.device },
        timeout: Setting { value: Some(global.timeout.as_secs_f64().to_string()), origin: origins.timeout },
        secret_file: Setting { value: global.secret_file.as_deref().map(files::text), origin: origins.secret_file },
    };
    let exists = origins.file.as_ref().is_some_and(|file| file.exists());
    let problem = origins.problem.clone();
    if let Some(problem) = &problem {
        global.output().warn(format!("the configuration file is ignored: {problem}"));
    }
    let data = Configured { file: origins.file.as_deref().map(files::text), exists, problem, settings };
    let mut table = Table::new(["setting", "value", "from"]);
    let Settings { device, timeout, secret_file } = &data.settings;
    for (name, setting) in [("device", device), ("timeout", timeout), ("secret_file", secret_file)] {
        let from = match setting.origin {
            Origin::CommandLine => "command line",
            Origin::Environment => "environment",
            Origin::File => "file",
            Origin::Default => "default",
        };
        table.row([name.to_owned(), setting.value.clone().unwrap_or_else(|| "-".to_owned()), from.to_owned()]);
    }
    let file = match &data.file {
        Some(file) if exists => format!("file: {file}"),
        Some(file) => format!("file: {file} (does not exist)"),
        None => "no file: neither XDG_CONFIG_HOME nor HOME is set".to_owned(),
    };
    global.output().result(&data, format!("{table}{file}"))
}
