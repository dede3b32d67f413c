//! The configuration file: defaults of options that every command has. An option counts before the environment, and the
//! environment before the file.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::builder::Resettable;
use clap::parser::ValueSource;
use clap::{ArgMatches, Command};
use lab::error_code::ErrorCode;
use lab::failure::Failure;
use lab::input_file;
use lab::quoted;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The variable of `--timeout`.
pub const TIMEOUT_VARIABLE: &str = "TACTUS_TIMEOUT";

/// The variable that names a device.
pub const DEVICE_VARIABLE: &str = "TACTUS_DEVICE";

/// Content of the file.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// `--device`.
    pub device: Option<String>,
    /// `--timeout`, s.
    pub timeout: Option<f64>,
    /// `--secret-file`.
    pub secret_file: Option<String>,
}

/// Where the value of a setting comes from.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Origin {
    /// The command line.
    #[serde(rename = "command line")]
    CommandLine,
    /// An environment variable.
    Environment,
    /// The configuration file.
    File,
    /// The tool.
    #[default]
    Default,
}

/// Where the settings come from.
#[derive(Debug, Clone, Default)]
pub struct Origins {
    /// The configuration file, whether or not it exists; `None` without a home.
    pub file: Option<PathBuf>,
    /// Why the file cannot be used; nothing of it counts then.
    pub problem: Option<String>,
    /// Of `--device`.
    pub device: Origin,
    /// Of `--timeout`.
    pub timeout: Origin,
    /// Of `--secret-file`.
    pub secret_file: Origin,
}

/// The place of the file: `$XDG_CONFIG_HOME/tactus/config.toml`, by default in `~/.config`.
#[must_use]
pub fn path() -> Option<PathBuf> {
    let folder = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|folder| folder.is_absolute());
    let base = folder("XDG_CONFIG_HOME").or_else(|| folder("HOME").map(|home| home.join(".config")))?;
    Some(base.join("tactus/config.toml"))
}

impl Config {
    /// Reads the file; one that does not exist says nothing.
    ///
    /// # Errors
    /// It cannot be read, has a word that means nothing, or a value out of its range.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        let failure =
            |cause: String| Failure::new(ErrorCode::Configuration, format!("reading {}", path.display()), cause);
        let text = match input_file::read_text(path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Self::default()),
            Err(error) => {
                let help = format!("`ls -ld {}` shows what is there, and who may read it", quoted::path(path));
                return Err(failure(error.to_string()).help(help));
            }
        };
        let config: Self = toml::from_str(&text).map_err(|error| failure(input_file::parser_words(&error)))?;
        let texts = [("device", &config.device), ("secret_file", &config.secret_file)];
        if let Some((name, _)) = texts.into_iter().find(|(_, text)| text.as_ref().is_some_and(String::is_empty)) {
            return Err(failure(format!("{name} = \"\": it is empty; give it a value, or leave out the line")));
        }
        // The same rule as for the option: its default is checked by nobody else.
        if let Some((timeout, Err(cause))) = config.timeout.map(|timeout| (timeout, seconds(&timeout.to_string()))) {
            return Err(failure(format!("timeout = {timeout}: {cause}")));
        }
        Ok(config)
    }

    /// The device that a file names which cannot be used for something else in it: for a stop, which shall not fail
    /// with a file that only saves typing.
    #[must_use]
    pub fn device_named(path: &Path) -> Option<String> {
        let table: toml::Table = input_file::read_text(path).ok()?.parse().ok()?;
        table.get("device")?.as_str().map(str::to_owned)
    }

    /// The command line with these defaults. An empty variable of the environment counts as none. A device that is no
    /// Unicode is named as well as can be: clap would refuse every command, and name neither variable nor remedy.
    #[must_use]
    pub fn defaults(&self, mut command: Command) -> Command {
        for option in ["device", "timeout", "secret_file"] {
            command = command.mut_arg(option, |argument| {
                let is_empty = argument.get_env().and_then(std::env::var_os).is_some_and(|value| value.is_empty());
                if is_empty { argument.env(Resettable::Reset) } else { argument }
            });
        }
        let timeout = self.timeout.map(|timeout| timeout.to_string());
        let unreadable = unreadable_device();
        if unreadable.is_some() {
            command = command.mut_arg("device", |argument| argument.env(Resettable::Reset));
        }
        let values = [
            ("device", unreadable.or_else(|| self.device.clone())),
            ("timeout", timeout),
            ("secret_file", self.secret_file.clone()),
        ];
        for (option, value) in values {
            if let Some(value) = value {
                // Read once a process, and clap keeps it as long as that lives.
                command = command.mut_arg(option, |argument| argument.default_value(&*value.leak()));
            }
        }
        command
    }

    /// Where the settings of a command line come from that was read with these defaults.
    #[must_use]
    pub fn origins(&self, matches: &ArgMatches, file: Option<PathBuf>) -> Origins {
        let mut deepest = matches;
        while let Some((_, inner)) = deepest.subcommand() {
            deepest = inner;
        }
        let origin = |option: &str, is_in_file: bool| match deepest.value_source(option) {
            Some(ValueSource::CommandLine) => Origin::CommandLine,
            Some(ValueSource::EnvVariable) => Origin::Environment,
            Some(_) if option == "device" && unreadable_device().is_some() => Origin::Environment,
            Some(_) if is_in_file => Origin::File,
            _ => Origin::Default,
        };
        let device = origin("device", self.device.is_some());
        let timeout = origin("timeout", self.timeout.is_some());
        Origins { file, problem: None, device, timeout, secret_file: origin("secret_file", self.secret_file.is_some()) }
    }
}

/// The device that the environment names, if its name is no Unicode; what cannot be read in it is replaced.
fn unreadable_device() -> Option<String> {
    let value = std::env::var_os(DEVICE_VARIABLE)?;
    value.to_str().is_none().then(|| value.to_string_lossy().into_owned())
}

/// The variable with a time-out, if its value is none: what is wrong with it, and the command line without it.
#[must_use]
pub fn without_wrong_timeout(command: Command) -> Option<(String, Command)> {
    let value = std::env::var_os(TIMEOUT_VARIABLE)?;
    let cause = value.to_str().map_or(Err("it is no Unicode".to_owned()), seconds).err()?;
    let command = command.mut_arg("timeout", |argument| argument.env(Resettable::Reset));
    Some((cause, command))
}

/// Shortest time that a setting may ask for: no line answers sooner.
const SHORTEST: f64 = 0.001;

/// A time in seconds: a millisecond to a day.
///
/// # Errors
/// It is none.
pub fn seconds(text: &str) -> Result<Duration, String> {
    let value: f64 = text.parse().map_err(|_| format!("`{text}` is not a number of seconds"))?;
    if (SHORTEST..=86_400.0).contains(&value) {
        Ok(Duration::from_secs_f64(value))
    } else {
        Err("a time of 0.001 to 86400 s is expected".to_owned())
    }
}
